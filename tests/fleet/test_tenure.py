"""What a node takes, keeps, loses and gives up; the simulation of many nodes, on a few seeds."""

from __future__ import annotations

import logging

import pytest

from evertwin.errors import StoreUnwritable, UsageError
from evertwin.fleet import FleetSpec, Members, Tenure
from evertwin.fleet import tenure as code
from evertwin.fleet.tenure import Told
from evertwin.store import SqlOwners
from evertwin.store.database import Database
from proofs.owners import World

DOUBLE = 68
"""A seed in which a node is paused in the middle of its work until another has its twin."""


class Fleet:
    """Nodes on one database in memory."""

    def __init__(self, lease: float = 60.0) -> None:
        self.database, self.lease = Database(":memory:"), lease
        self.owners, self.members = SqlOwners(self.database), Members(self.database)
        self.at = 0.0

    def node(self, name: str) -> Tenure:
        made = Tenure(name, self.lease, self.owners, self.members, lambda: self.at)
        made.members.beat(name, "", self.lease)
        return made


def test_twins_fall_to_who_is_least_busy() -> None:
    fleet = Fleet()
    north, south = fleet.node("north"), fleet.node("south")
    assert set(north.step({"a": Told(), "b": Told()}).begin) == {"a"}  # then south is less busy
    assert set(south.step({"a": Told(), "b": Told()}).begin) == {"b"}
    some = {name: Told(cost=0.5 if name == "a" else 0.1) for name in "abcdef"}
    assert not north.step(some).begin
    assert set(south.step(some).begin) == set("cdef")


def test_one_step_takes_a_few() -> None:
    node = Fleet().node("north")
    many = {str(k): Told() for k in range(9)}
    assert [len(node.step(many).begin) for _ in range(4)] == [4, 4, 1, 0]


def test_what_nobody_takes_is_taken_in_the_end() -> None:
    fleet = Fleet()
    north, south = fleet.node("north"), fleet.node("south")
    north.step({"a": Told()})
    assert not north.step({"a": Told(cost=1.0), "b": Told()}).begin  # it falls to south
    fleet.at += fleet.lease + 1.0
    assert set(north.step({"a": Told(cost=1.0), "b": Told()}).begin) == {"b"}
    assert not south.step({"a": Told(), "b": Told()}).begin


def test_a_pinned_twin_waits_for_its_node() -> None:
    fleet = Fleet()
    north = fleet.node("north")
    only = {"a": Told(pinned="south")}
    fleet.at += 10 * fleet.lease
    assert not north.step(only).begin and not north.step(only).begin
    assert set(fleet.node("south").step(only).begin) == {"a"}


def test_a_twin_moves_where_it_is_asked_to() -> None:
    fleet = Fleet()
    north, south = fleet.node("north"), fleet.node("south")
    twins = {"a": Told()}
    north.step(twins)
    fleet.owners.want("a", "west")  # nobody is called so
    assert not north.step(twins).leave
    fleet.owners.want("a", "south")
    assert north.step(twins).leave == ["a"]
    north.release("a")
    assert not north.step(twins).begin and set(south.step(twins).begin) == {"a"}


def test_a_node_drains() -> None:
    fleet = Fleet()
    north, south = fleet.node("north"), fleet.node("south")
    north.step({"a": Told()})
    assert fleet.members.drain("north", True) and not fleet.members.drain("west", True)
    assert north.step({"a": Told()}).leave == ["a"]
    north.end()
    assert set(south.step({"a": Told()}).begin) == {"a"}
    assert {one.node: one.alive for one in fleet.members.all()} == {"north": False, "south": True}


def test_a_node_that_is_cut_off_is_sure_for_less_than_its_lease(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    fleet = Fleet()
    north = fleet.node("north")
    north.step({"a": Told()})

    def cut(*_: object) -> None:
        raise StoreUnwritable("cut off")

    monkeypatch.setattr(fleet.owners, "renew", cut)
    fleet.at += 0.8 * fleet.lease
    assert not north.step({"a": Told()}).lost and north.sure("a")
    fleet.at += 0.2 * fleet.lease
    assert north.step({"a": Told()}).lost == ("a",) and not north.sure("a")


def test_a_twin_that_another_has_is_lost() -> None:
    fleet = Fleet(lease=0.0)  # ends at once
    north, south = fleet.node("north"), fleet.node("south")
    north.step({"a": Told()})
    south.lease = fleet.lease = 60.0
    assert fleet.owners.claim("a", "south", 60.0) == 2
    step = north.step({"a": Told()})
    assert (step.lost, step.begin) == (("a",), {})


@pytest.mark.parametrize("seed", range(1, 16))
def test_no_invariant_fails(seed: int) -> None:
    assert World(seed, fenced=True).play() == []


def test_without_fencing_two_write(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.CRITICAL)
    assert any(one.startswith("token: ") for one in World(DOUBLE, fenced=False).play())
    assert World(DOUBLE, fenced=True).play() == []


def test_who_is_sure_for_too_long_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(code, "SURE", 1.5)
    assert any("sure: " in one for seed in range(1, 31) for one in World(seed, fenced=True).play())


@pytest.mark.parametrize(
    ("store", "said"),
    [
        ("mysql://db/plant", "expected postgresql://"),
        ("postgresql://me:secret@localhost/plant", "belongs into the user's .pgpass"),
        ("postgresql://me@db.example/plant", "expected \\?sslmode=verify-full"),
        ("postgresql://me@192.0.2.7/plant?sslmode=require", "another machine"),
    ],
)
def test_a_shared_store_is_reached_safely(store: str, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        FleetSpec(store)


def test_what_a_node_is_called() -> None:
    assert FleetSpec("postgresql:///plant?sslmode=verify-full", node="north").name == "north"
    assert FleetSpec("postgresql://me@db.example/plant?sslmode=verify-full").name
    with pytest.raises(UsageError, match="node: expected letters"):
        FleetSpec(node="north star")
