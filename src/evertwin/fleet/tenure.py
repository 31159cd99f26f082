"""What one node of a fleet has: it renews, loses, claims and gives up twins, step by step.

No node decides for another. Each looks at the shared store and takes what is free when nobody is
less busy; the store lets one of them win. What a node may rely on it counts on its own steady
clock, from before it asked: a lease that it could not renew in time is lost, whatever the store
says. It need not know: a transaction under an old token is refused (`evertwin.store.owners`).

>>> from evertwin.store.database import Database
>>> from evertwin.store.owners import SqlOwners
>>> database = Database(":memory:")
>>> north = Tenure("north", 10.0, SqlOwners(database), Members(database))
>>> north.step({"arm": Told(), "robot": Told()}).begin
{'arm': 1, 'robot': 1}
>>> south = Tenure("south", 10.0, SqlOwners(database), Members(database))
>>> south.step({"arm": Told(), "robot": Told()}).begin
{}
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from evertwin.errors import StoreUnwritable
from evertwin.fleet.members import Member, Members
from evertwin.store.owners import Held, Owners

STEPS = 5
"""Steps in a lease."""
SURE = 0.9
"""Share of a lease that a node relies on: no steady clock is off by a tenth."""
TOGETHER = 4
"""Twins that one step takes at most: starts are staggered."""
COST = 0.02
"""Seconds of work a second, of a twin that was never measured."""


class Told(NamedTuple):
    """What a node says of a twin.

    >>> Told(cost=0.25).pinned
    ''
    """

    cost: float = COST
    """Seconds of work a second, as measured."""
    lag: float = 0.0
    """Seconds from the arrival of a sample until what the twin says of it is durable."""
    row: int = 0
    reason: str = ""
    """Why it does not run, where it is quarantined."""
    pinned: str = ""
    """The node that alone can run it; empty: any."""


class Step(NamedTuple):
    """What is to be done.

    >>> Step().begin
    {}
    """

    begin: Mapping[str, int] = {}
    """Twins to start, each with its token."""
    lost: Sequence[str] = ()
    """Twins to drop at once: nothing of them may be written or published any more."""
    leave: Sequence[str] = ()
    """Twins to stop properly, then `Tenure.release`."""


@dataclass
class Tenure:
    """The twins of one node. See the module."""

    node: str
    lease: float
    """Seconds."""
    owners: Owners
    members: Members
    clock: Callable[[], float] = time.monotonic
    address: str = ""
    """Where this node is reached."""
    tokens: dict[str, int] = field(default_factory=dict, init=False)
    """Of the twins that it has."""
    _sure: dict[str, float] = field(default_factory=dict, init=False)
    """Until when each is surely its own, on its clock."""
    _free: dict[str, float] = field(default_factory=dict, init=False)
    """Since when each was seen without an owner."""

    def sure(self, twin: str) -> bool:
        """Is a twin surely this node's, as far as its own clock tells?"""
        return self.clock() < self._sure.get(twin, -float("inf"))

    def step(self, twins: Mapping[str, Told]) -> Step:
        """Renews what it has, drops what it lost, claims what is free.

        Args:
            twins: all that the site file names.
        """
        try:
            return self._stepped(twins)
        except StoreUnwritable:  # cut off: it keeps what it has while it may be sure
            return Step(lost=self._drop([one for one in self.tokens if not self.sure(one)]))

    def _stepped(self, twins: Mapping[str, Told]) -> Step:
        asked = self.clock()
        wanted = self.owners.renew(
            {one: (token, _text(twins.get(one))) for one, token in self.tokens.items()}, self.lease
        )
        self._sure |= dict.fromkeys(wanted, asked + SURE * self.lease)
        lost = self._drop([one for one in self.tokens if one not in wanted])
        drains = self.members.beat(self.node, self.address, self.lease)
        nodes = [one for one in self.members.all() if one.alive and not one.drains]
        names = {one.node for one in nodes}
        leave = [
            one for one, other in wanted.items()
            if one not in twins or drains or (other != self.node and other in names)
        ]  # fmt: skip
        begin = {} if drains else self._claimed(twins, nodes)
        return Step(begin, lost, leave)

    def _claimed(self, twins: Mapping[str, Told], nodes: Sequence[Member]) -> dict[str, int]:
        """What is free, and falls to this node."""
        held, begin = {one.twin: one for one in self.owners.held()}, dict[str, int]()
        load = {self.node: 0.0} | {one.node: 0.0 for one in nodes}
        for one in held.values():
            if one.left > 0.0 and one.node in load:
                load[one.node] += _cost(one)
        for twin in self._claimable(twins, held):
            if len(begin) == TOGETHER:
                break
            known, names = held.get(twin), set(load)
            wanted = twins[twin].pinned or (known.wanted if known is not None else "")
            least = load[self.node] <= min(load.values())
            patient = self.clock() < self._free[twin] + self.lease
            mine = wanted == self.node if wanted in names else (least or not patient)
            if twins[twin].pinned and wanted != self.node:
                mine = False
            asked = self.clock()
            try:
                token = self.owners.claim(twin, self.node, self.lease) if mine else None
            except StoreUnwritable:  # what was claimed so far is begun
                break
            if token is not None:
                self.tokens[twin], begin[twin] = token, token
                self._sure[twin] = asked + SURE * self.lease
                load[self.node] += COST if known is None else _cost(known)
        return begin

    def _claimable(self, twins: Mapping[str, Told], held: Mapping[str, Held]) -> Iterator[str]:
        """Twins without an owner, the longest free first."""
        free = [
            one for one in twins
            if one not in self.tokens and (one not in held or held[one].left <= 0.0)
        ]  # fmt: skip
        now = self.clock()
        self._free = {one: self._free.get(one, now) for one in free}
        return iter(sorted(free, key=lambda one: (self._free[one], one)))

    def _drop(self, twins: Sequence[str]) -> Sequence[str]:
        for one in twins:
            del self.tokens[one]
            self._sure.pop(one, None)
        return tuple(twins)

    def release(self, twin: str) -> None:
        """A twin that was stopped properly: another node may have it at once.

        Raises:
            StoreUnwritable: the store cannot be reached; its lease ends by itself.
        """
        token = self.tokens[twin]
        self._drop([twin])
        self.owners.release(twin, token)

    def end(self) -> None:
        """This node takes no more part: what it has was stopped."""
        try:
            for twin in tuple(self.tokens):
                self.release(twin)
            self.members.leave(self.node)
        except StoreUnwritable:  # its leases end by themselves
            self.tokens.clear()


def _text(told: Told | None) -> str:
    return "" if told is None else json.dumps(told._asdict())


def _cost(held: Held) -> float:
    """As its owner measured it last."""
    return float(json.loads(held.told)["cost"]) if held.told else COST
