"""What one node of a fleet has: it renews, loses, claims and gives up twins, step by step.

No node decides for another. Each looks at the shared store and takes what is free when nobody is
less busy; the store lets one of them win. What a node may rely on it counts on its own steady
clock, from before it asked: a lease that it could not renew in time is lost, whatever the store
says. It need not know: a transaction under an old token is refused (`evertwin.store.owners`).

A twin that has an owner moves (asked to, drained, or because nodes are busy unequally) when the
node that would take it has said that it can go on from its state: until then it stays where it
runs. A node that cannot go on with a twin says why, and leaves it to others.

>>> from evertwin.store.sql.database import Database
>>> from evertwin.store.owners.owners import SqlOwners
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
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from evertwin.errors import StoreUnwritable
from evertwin.fleet.balance import Uneven, loads, uneven
from evertwin.fleet.members import Member, Members, Says
from evertwin.store.owners.owners import Held, Owners

STEPS = 5  # in a lease
SURE = 0.9
"""Share of a lease that a node relies on: no steady clock is off by a tenth."""
TOGETHER = 4
"""Twins that one step takes at most: starts are staggered."""
COST = 0.02
"""Seconds of work a second, of a twin that was never measured."""
LASTS = 3
"""Leases for which a node has to be busier than another, before a twin goes for it."""
ANEW = " anew"
"""Behind the node that a twin is wanted at: also if it has to fold it from its first sample."""


class Told(NamedTuple):
    """What a node says of a twin.

    >>> Told(cost=0.25).pinned
    ''
    """

    cost: float = COST
    """Seconds of work a second, as measured."""
    lag: float = 0.0
    """Seconds from the arrival of a sample until its verdict is durable."""
    row: int = 0
    reason: str = ""
    """Why it does not run, where it is quarantined."""
    pinned: str = ""
    """The node that alone can run it; empty: any."""
    wrong: str = ""
    """Why this node cannot run it, as its files say."""


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
    look: Sequence[str] = ()
    """Twins of others that may come: can this node go on from their state? Then `Tenure.say`."""


class Seen(NamedTuple):
    """The shared store, as a step found it.

    >>> Seen({}, ()).says
    ()
    """

    held: Mapping[str, Held]
    nodes: Sequence[Member]
    """Those that may take twins."""
    says: Sequence[Says] = ()

    @property
    def names(self) -> set[str]:
        """Of the nodes."""
        return {one.node for one in self.nodes}

    def owner(self, twin: str) -> str:
        """The node whose lease of a twin lasts; empty: nobody's does."""
        held = self.held.get(twin)
        return held.node if held is not None and held.left > 0.0 else ""

    def able(self, twin: str, token: int) -> set[str]:
        """Nodes that can go on from the state of a twin under this token."""
        here = (one for one in self.says if (one.twin, one.token, one.reason) == (twin, token, ""))
        return {one.node for one in here} & self.names

    def unable(self, twin: str) -> set[str]:
        """Nodes that cannot."""
        return {one.node for one in self.says if one.twin == twin and one.reason} & self.names

    def may(self, node: str, twin: str) -> bool:
        """Is a node there that has not said that it cannot go on with a twin?"""
        return node in self.names - self.unable(twin)

    @property
    def costs(self) -> dict[str, tuple[str, float]]:
        """By twin that runs: its node, and what it costs."""
        runs = (one for one in self.held.values() if one.left > 0.0 and not _said(one)["reason"])
        return {one.twin: (one.node, cost_of(one)) for one in runs}


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
    held: Mapping[str, Held] = field(default_factory=dict, init=False)
    """How it stood with each twin at the newest step."""
    refused: dict[str, float] = field(default_factory=dict, init=False)
    """Twins that it cannot go on with, until when it does not try again."""
    _sure: dict[str, float] = field(default_factory=dict, init=False)
    """Until when each is surely its own, on its clock."""
    _free: dict[str, float] = field(default_factory=dict, init=False)
    """Since when each was seen without an owner."""
    _anew: dict[str, bool] = field(default_factory=dict, init=False)
    """Twins that are to be taken whatever their state is; has that been done?"""
    _others: bool = field(default=False, init=False)
    """Are there other nodes that may take twins?"""
    _begins: bool = field(default=True, init=False)
    """Is what this node said before void?"""
    _busy: float = field(default=math.inf, init=False)
    """Since when this node is so much busier than another that a twin should go."""

    def sure(self, twin: str) -> bool:
        """Is a twin surely this node's, as far as its own clock tells?"""
        return self.clock() < self._sure.get(twin, -math.inf)

    def cost(self, twin: str) -> float:
        """What a twin cost who had it last [s/s]."""
        return cost_of(self.held[twin]) if twin in self.held else COST

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
        self._say_wrong(twins)
        seen = self._seen()
        fixed = {one for one, told in twins.items() if told.pinned}
        fixed |= {one.twin for one in seen.held.values() if one.wanted}
        even = uneven(seen.costs, seen.names, fixed)
        leave = [one for one in wanted if one not in twins]
        leave += [one for one in self._leaving(wanted, seen, drains) if one in twins]
        leave += self._evened(even, seen)
        look = () if drains else tuple(self._looking(twins, seen, even))
        return Step({} if drains else self._claimed(twins, seen), lost, leave, look[:TOGETHER])

    def _seen(self) -> Seen:
        nodes = [one for one in self.members.all() if one.alive and not one.drains]
        held = {one.twin: one for one in self.owners.held()}
        self.held = held
        anew = [one for one, how in held.items() if how.wanted == self.node + ANEW]
        for twin in anew:
            if twin not in self._anew:
                self.refused.pop(twin, None)
        self._anew = {one: self._anew.get(one, False) for one in anew}
        self._others = any(one.node != self.node for one in nodes)
        return Seen(held, nodes, self.members.said())

    # ------------------------------------------------------------------ what is said

    def _say_wrong(self, twins: Mapping[str, Told]) -> None:
        """What its files keep this node from running, once."""
        if self._begins:
            self.members.unsay(self.node)
            self.refused.clear()
            self._begins = False
        for twin, told in twins.items():
            if told.wrong and twin not in self.refused:
                self.members.say(Says(self.node, twin, 0, told.wrong))
                self.refused[twin] = math.inf

    def again(self) -> None:
        """What it could not go on with it tries again: its files were read anew."""
        self._begins = True

    def say(self, twin: str, token: int, reason: str) -> None:
        """What `Step.look` asked for.

        Args:
            twin: name.
            token: under which its owner had it, as `held` tells.
            reason: why this node cannot go on from its state; empty: it can.

        Raises:
            StoreUnwritable: the store cannot be reached.
        """
        if reason:
            self.refused[twin] = math.inf
        else:
            self.refused.pop(twin, None)
        self.members.say(Says(self.node, twin, token, reason))

    def refuse(self, twin: str, reason: str, *, later: bool = False) -> None:
        """A twin that this node claimed and cannot go on with, and that it has stopped.

        Args:
            twin: name.
            reason: why.
            later: it takes the twin all the same when for a lease nobody else does.

        Raises:
            StoreUnwritable: the store cannot be reached; its lease ends by itself.
        """
        token = self.tokens.get(twin)
        if token is None:  # its lease was lost meanwhile
            return
        self.refused[twin] = self.clock() + self.lease if later else math.inf
        if twin in self._anew:
            self._anew[twin] = True
        self._drop([twin])
        self.members.say(Says(self.node, twin, token, reason))
        self.owners.release(twin, token)

    def began(self, twin: str) -> None:
        """A twin that this node claimed runs.

        Raises:
            StoreUnwritable: the store cannot be reached.
        """
        self._anew |= {twin: True} if twin in self._anew else {}
        if twin in self.tokens:
            self.say(twin, self.tokens[twin], "")

    def strict(self, twin: str) -> bool:
        """Is the twin to be refused where its state cannot be loaded?"""
        return self._anew.get(twin, True)

    def patient(self, twin: str) -> bool:
        """Is it to be refused where a run of it would have to begin anew?"""
        return self._others and self.strict(twin) and twin not in self.refused

    # ------------------------------------------------------------------ what goes

    def _leaving(self, wanted: Mapping[str, str], seen: Seen, drains: bool) -> Iterator[str]:
        """Twins that are to go, and that another node can go on with."""
        for twin, wish in wanted.items():
            able = seen.able(twin, self.tokens[twin]) - {self.node}
            where = wish.removesuffix(ANEW)
            if where in able or (drains and able and not seen.may(where, twin)):
                yield twin

    def _evened(self, even: Uneven, seen: Seen) -> list[str]:
        """One twin that goes because this node has been busier than another for a while."""
        now = self.clock()
        self._busy = min(self._busy, now) if even.busy == self.node and even.twins else math.inf
        if now >= self._busy + LASTS * self.lease:
            for twin in even.twins:
                if even.idle in seen.able(twin, self.tokens.get(twin, -1)):
                    self._busy = now - (LASTS - 1) * self.lease  # the next one a lease later
                    return [twin]
        return []

    def _looking(self, twins: Mapping[str, Told], seen: Seen, even: Uneven) -> Iterator[str]:
        """Twins of others that may come here, and of which nothing is said yet."""
        for twin, told in twins.items():
            owner = seen.owner(twin)
            if owner in ("", self.node) or told.pinned not in ("", self.node):
                continue
            held = seen.held[twin]
            wish = held.wanted.removesuffix(ANEW)
            evens = even.idle == self.node and twin in even.twins[:TOGETHER]
            asked = wish == self.node or (owner not in seen.names and not seen.may(wish, twin))
            known = twin in self.refused or self.node in seen.able(twin, held.token)
            if (evens or asked) and not known:
                yield twin

    # ------------------------------------------------------------------ what comes

    def _claimed(self, twins: Mapping[str, Told], seen: Seen) -> dict[str, int]:
        """What is free, and falls to this node."""
        begin, load = dict[str, int](), loads(seen.costs, {self.node, *seen.names})
        for twin in self._claimable(twins, seen):
            if len(begin) == TOGETHER:
                break
            asked = self.clock()
            try:
                mine = self._falls_here(twin, twins[twin], seen, load)
                token = self.owners.claim(twin, self.node, self.lease) if mine else None
            except StoreUnwritable:  # what was claimed so far is begun
                break
            if token is not None:
                self.tokens[twin], begin[twin] = token, token
                self._sure[twin] = asked + SURE * self.lease
                load[self.node] += self.cost(twin)
        return begin

    def _falls_here(self, twin: str, told: Told, seen: Seen, load: Mapping[str, float]) -> bool:
        """Is a free twin this node's to claim?"""
        if told.pinned:
            return told.pinned == self.node
        known = seen.held.get(twin)
        wish = "" if known is None else known.wanted.removesuffix(ANEW)
        others = seen.names - seen.unable(twin)
        if wish in others | {self.node}:
            return wish == self.node
        least = load[self.node] <= min((load[one] for one in others), default=math.inf)
        return least or self.clock() >= self._free[twin] + self.lease

    def _claimable(self, twins: Mapping[str, Told], seen: Seen) -> Iterator[str]:
        """Twins without an owner that this node may try, the longest free first."""
        now = self.clock()
        free = [one for one in twins if one not in self.tokens and not seen.owner(one)]
        self._free = {one: self._free.get(one, now) for one in free}
        tried = (one for one in free if self.refused.get(one, -math.inf) <= now)
        return iter(sorted(tried, key=lambda one: (self._free[one], one)))

    # ------------------------------------------------------------------ what it has

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


def _said(held: Held) -> Mapping[str, float | str]:
    return json.loads(held.told) if held.told else Told()._asdict()


def cost_of(held: Held) -> float:
    """As its owner measured it last [s/s].

    >>> cost_of(Held("arm", 1, "north", 1.0)) == COST
    True
    """
    return float(_said(held)["cost"])
