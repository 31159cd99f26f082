"""What a node takes, keeps, loses and gives up; the simulation of many nodes, on a few seeds."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

from evertwin.errors import StoreUnwritable, UsageError
from evertwin.fleet import FleetSpec, Members, Tenure, fleet_told
from evertwin.fleet import tenure as code
from evertwin.fleet.tenure import ANEW, Told
from evertwin.service.fleet_node import Tending
from evertwin.service.service import Service
from evertwin.store import SqlOwners
from evertwin.store.sql.database import Database
from planted.draws import first_of
from planted.serving import site
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

    def told(self, **pins: str) -> dict[str, tuple[str, str]]:
        """State and reason of each twin."""
        told = fleet_told(self.owners, self.members, self.lease, pins)
        return {one["twin"]: (one["state"], one["reason"]) for one in told["twins"]}


def looked(node: Tenure, twins: dict[str, Told], reason: str = "") -> list[str]:
    """A step of a node, and what it says of the twins that it is to look at."""
    step = node.step(twins)
    assert not step.begin
    for twin in step.look:
        node.say(twin, node.held[twin].token, reason)
    return list(step.look)


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
    assert not north.step(twins).leave  # south has not said yet that it can
    assert looked(south, twins) == ["a"] and not south.step(twins).look
    assert north.step(twins).leave == ["a"]
    north.release("a")
    assert not north.step(twins).begin and set(south.step(twins).begin) == {"a"}


def test_a_node_drains() -> None:
    fleet = Fleet()
    north, south = fleet.node("north"), fleet.node("south")
    north.step({"a": Told()})
    assert fleet.members.drain("north", True) and not fleet.members.drain("west", True)
    assert not north.step({"a": Told()}).leave and fleet.told()["a"] == ("owned", "")
    assert looked(south, {"a": Told()}) == ["a"]
    assert north.step({"a": Told()}).leave == ["a"]
    north.end()
    assert set(south.step({"a": Told()}).begin) == {"a"}
    assert {one.node: one.alive for one in fleet.members.all()} == {"north": False, "south": True}


def test_a_twin_stays_where_it_runs_until_another_node_can_go_on_with_it() -> None:
    fleet = Fleet()
    north, south, twins = fleet.node("north"), fleet.node("south"), {"a": Told()}
    north.step(twins)
    fleet.owners.want("a", "south")
    assert looked(south, twins, "field s.x is missing") == ["a"]
    assert not north.step(twins).leave and not south.step(twins).look  # said once
    assert fleet.told()["a"] == ("owned", "stays: south cannot: field s.x is missing")
    fleet.owners.want("a", "")
    fleet.members.drain("north", True)
    assert not north.step(twins).leave and not south.step(twins).look
    said = "stays while north runs: south cannot: field s.x is missing"
    assert fleet.told()["a"] == ("owned", said)
    north.end()
    assert not south.step(twins).begin
    assert fleet.told()["a"] == ("waits", "south cannot: field s.x is missing")
    west = fleet.node("west")
    assert set(west.step(twins).begin) == {"a"}  # at once: south is less busy, but cannot
    west.began("a")
    assert fleet.told()["a"] == ("owned", "")


def test_what_a_node_cannot_start_is_handed_on_and_waits_where_no_node_can() -> None:
    fleet = Fleet()
    north, south, twins = fleet.node("north"), fleet.node("south"), {"a": Told()}
    for node in (north, south):
        assert set(node.step(twins).begin) == {"a"}
        node.refuse("a", f"{node.node} lacks it")
    fleet.at += 10 * fleet.lease
    assert not north.step(twins).begin and not south.step(twins).begin
    assert fleet.told()["a"] == (
        "waits",
        "north cannot: north lacks it; south cannot: south lacks it",
    )
    south.again()  # its files were read anew
    assert set(south.step(twins).begin) == {"a"}


def test_what_its_files_say_a_node_need_not_try() -> None:
    fleet = Fleet()
    north, south = fleet.node("north"), fleet.node("south")
    assert not north.step({"a": Told(wrong="a.toml: no such file")}).begin
    assert fleet.told(a="")["a"] == ("free", "")
    assert set(south.step({"a": Told()}).begin) == {"a"}
    south.end()
    assert fleet.told(a="")["a"] == ("waits", "north cannot: a.toml: no such file")
    assert fleet.told(a="west")["a"] == ("waits", "only west can run it, and is not there")
    north.again()
    assert set(north.step({"a": Told()}).begin) == {"a"}


def test_a_new_run_is_begun_only_where_nobody_can_go_on_with_the_old_one() -> None:
    fleet = Fleet()
    north, south, twins = fleet.node("north"), fleet.node("south"), {"a": Told()}
    north.step({})
    assert set(north.step(twins).begin) == {"a"} and north.patient("a")
    north.refuse("a", "other settings", later=True)
    assert not north.step(twins).begin
    fleet.at += fleet.lease
    south.step({})
    assert set(north.step(twins).begin) == {"a"} and not north.patient("a")


def test_a_twin_that_no_node_can_load_begins_anew_where_the_operator_says_so() -> None:
    fleet = Fleet()
    north, twins = fleet.node("north"), {"a": Told()}
    north.step(twins)
    assert north.strict("a")
    north.refuse("a", "field s.x is missing")
    assert not north.step(twins).begin
    fleet.owners.want("a", "north" + ANEW)
    assert set(north.step(twins).begin) == {"a"} and not north.strict("a")
    north.refuse("a", "the model fails")  # it is tried once
    assert not north.step(twins).begin


def test_a_node_that_joins_gets_its_share_by_cost_and_nothing_comes_back() -> None:
    fleet = Fleet()
    north = fleet.node("north")
    costs = {"a": 0.5, "b": 0.3, "c": 0.1, "d": 0.1, "e": 0.05, "f": 0.05}
    twins = {name: Told(cost) for name, cost in costs.items()}
    twins |= {"g": Told(0.2, pinned="north"), "h": Told(0.2, reason="poison")}
    for _ in range(3):
        north.step(twins)
    assert len(north.tokens) == 8
    south, moved = fleet.node("south"), []
    for step in range(60):
        for node, other in ((north, south), (south, north)):
            found = node.step(twins)
            for twin in found.look:
                node.say(twin, node.held[twin].token, "")
            assert step >= 15 or not found.leave  # it has to last
            for twin in found.leave:
                moved.append(twin)
                node.release(twin)
                assert twin in other.step(twins).begin
        fleet.at += fleet.lease / 5
        fleet.database.query("UPDATE owners SET until = until + 60000000 RETURNING 1")
        fleet.database.query("UPDATE nodes SET until = until + 60000000 RETURNING 1")
    load = [sum(twins[o].cost for o in node.tokens if o != "h") for node in (north, south)]
    assert abs(load[0] - load[1]) <= 0.25 * max(load) and {"g", "h"} <= set(north.tokens)
    assert len(moved) == len(set(moved)) <= 3


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


@first_of("seed", range(1, 16))
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


def test_a_store_that_is_away_is_told_once_and_so_is_its_return(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    away, fleet = "postgresql://nobody@127.0.0.1:9/hall", Fleet()
    tending = Tending(Service(site(tmp_path)), FleetSpec(away, "north"))
    caplog.set_level(logging.INFO, "evertwin.service")
    for _ in range(3):
        tending._stepped({})
    tending.tenure = fleet.node("north")
    for _ in range(2):
        tending._stepped({})
    said = [record.message for record in caplog.records]
    assert len(said) == 2 and "nothing is taken: 127.0.0.1:9/hall" in said[0], said
    assert said[1] == "fleet: the store answers again"
