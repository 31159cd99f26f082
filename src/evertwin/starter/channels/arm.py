"""The channels of an arm: one family of columns each for angle, speed, acceleration and torque.

Headings and units say what a family is. Where they do not, the numbers do: a speed is what an angle
is the integral of, and the factor between the two tells degrees from radians. What is not recorded
is derived.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from evertwin.signals import Channel
from evertwin.sources.columns.description import ColumnInfo
from evertwin.starter.channels.named import unit_of
from evertwin.starter.looks.families import families
from evertwin.starter.looks.relations import CLEAR, Relation, derivative
from evertwin.starter.looks.seen import Seen
from evertwin.starter.looks.words import quantity, role, words
from evertwin.starter.proposal import ASK, Answer, Derivation, Match
from evertwin.types import Float64

_WANTED = {
    "q": ("position",), "qd": ("velocity",), "qdd": ("acceleration",), "tau": ("torque", "force"),
}  # fmt: skip
"""Of a joint that slides the effort is a force."""
LONGEST = 5.0
"""Way of a slide of an arm [m]: one that goes farther is told in mm."""
LITTLE = 0.01
"""Part of the largest motion among the joints below which one rests."""
MOST = 1000.0
"""Whole numbers beyond it are no joint's degrees: an encoder counts them."""
_TURN = 180.0 / np.pi


class Group(NamedTuple):
    """A family of a table, and what its headings say.

    >>> Group(0, ("q_0",), "position", "", "q_#").quantity
    'position'
    """

    source: int
    columns: tuple[str, ...]
    quantity: str
    role: str
    stem: str
    """Of its headings; empty where there are none."""


class Found(NamedTuple):
    """Columns for an arm's channels, and what is computed from them.

    >>> Found((), ()).matches
    ()
    """

    matches: tuple[Match, ...]
    derivations: tuple[Derivation, ...]


def of_arm(channels: Sequence[Channel], joints: Sequence[str], seen: Sequence[Seen]) -> Found:
    """Columns of an arm with these ``joints``."""
    look = _Look(tuple(seen), _groups(seen, joints))
    chosen = look.chosen()
    units = {channel.name: channel.unit for channel in channels}
    matches: list[Match] = []
    derivations: list[Derivation] = []
    for name in ("q", "qd", "qdd", "tau"):
        for j in range(len(joints)):
            channel, before = f"{name}{j + 1}", f"{name[:-1]}{j + 1}"
            if name in chosen:
                matches.append(look.match(channel, units[channel], name, chosen, j))
            elif name in ("qd", "qdd") and (name == "qdd" or "q" in chosen):
                derivations.append(Derivation(channel, "derivative", (before,), units[channel]))
    return Found(tuple(matches), tuple(derivations))


def bare_joints(seen: Sequence[Seen], count: int) -> bool:
    """Do columns without headings hold so many angles, their speeds, and an effort of each?"""
    joints = [f"joint {i}" for i in range(count)]
    chosen = _Look(tuple(seen), tuple(g for g in _groups(seen, joints) if not g.stem)).chosen()
    return {"q", "qd", "tau"} <= chosen.keys()


def _groups(seen: Sequence[Seen], joints: Sequence[str]) -> tuple[Group, ...]:
    found = []
    for s, one in enumerate(seen):
        known = {column.name: column for column in one.columns}
        there = {column.name.removeprefix(one.table.name): column.name for column in one.columns}
        for family in families(tuple(there), joints):
            columns = tuple(there[name] for name in family.columns)
            if all(known[name].low == known[name].high for name in columns):
                continue
            said = words(family.stem)
            what = quantity(said, known[columns[0]].unit) or quantity(words(one.theme))
            found.append(Group(s, columns, what, role([*words(one.theme), *said]), family.stem))
    return tuple(found)


@dataclass(frozen=True)
class _Look:
    seen: tuple[Seen, ...]
    groups: tuple[Group, ...]

    def chosen(self) -> Mapping[str, Group]:
        """Group of each quantity of the arm that has one."""
        usable = [g for g in self.groups if g.role not in ("command", "other")]
        usable = usable or [g for g in self.groups if g.role != "other"]
        out: dict[str, Group] = {}
        for name, wanted in _WANTED.items():
            said = [g for g in usable if g.quantity in wanted and g not in out.values()]
            said.sort(key=lambda g: g.role != "measured")
            if said:
                out[name] = said[0]
        nameless = [g for g in usable if not g.quantity]
        if "q" not in out:
            self._by_numbers(out, nameless)
        elif "qd" not in out:
            found = next((g for g in nameless if self.follows(out["q"], g)), None)
            out |= {} if found is None else {"qd": found}
        current = [g for g in usable if g.quantity == "current"]
        rest = current or [g for g in nameless if g not in out.values()]
        if "tau" not in out and rest and "q" in out:
            out["tau"] = rest[0]
        return out

    def _by_numbers(self, out: dict[str, Group], nameless: Sequence[Group]) -> None:
        """Angles are what other columns are the derivative of, and no derivative themselves."""
        pairs = [
            (a, b) for a in nameless for b in nameless
            if a is not b and a not in out.values() and self.follows(a, b)
        ]  # fmt: skip
        speeds = [b for _, b in pairs]
        for a, b in pairs:
            if a not in speeds:
                out |= {"q": a} | ({} if "qd" in out else {"qd": b})
                break
        else:
            if nameless and "tau" in out:  # one family beside the torques can be but the angles
                out["q"] = nameless[0]
        more = [
            b for a, b in pairs
            if a is out.get("qd") and b not in out.values() and self._in_its_unit(a, b)
        ]  # fmt: skip
        if more and "qdd" not in out:
            out["qdd"] = more[0]

    def follows(self, a: Group, b: Group) -> bool:
        """Is ``b`` the derivative of ``a``, for most of the joints that move?"""
        found = self._moving(a, b)
        return bool(found) and float(np.median([r.correlation for r in found])) >= CLEAR

    def _in_its_unit(self, a: Group, b: Group) -> bool:
        """Is ``b`` what ``a`` changes by? A torque goes as the change of a speed, not by one."""
        factors = [r.factor for r in self._moving(a, b) if r.clear]
        return bool(factors) and abs(float(np.median(factors)) - 1.0) < 0.1

    def _moving(self, a: Group, b: Group) -> list[Relation]:
        """Of the joints that do not rest beside the others' motion."""
        sizes = [np.nanstd(self._rows(group), axis=0) for group in (a, b)]
        moves = np.all([size > LITTLE * size.max() for size in sizes], axis=0)
        found = self.relations(a, b)
        return [r for r, on in zip(found, moves, strict=bool(found)) if on and r is not None]

    def relations(self, a: Group, b: Group) -> list[Relation | None]:
        """`derivative` of each joint; None where it does not move, or they share no clock."""
        if a.source != b.source:
            return []
        t, of, by = self.seen[a.source].t, self._rows(a), self._rows(b)
        moves = (np.nanstd(of, axis=0) > 0) & (np.nanstd(by, axis=0) > 0)
        return [derivative(t, of[:, j], by[:, j]) if on else None for j, on in enumerate(moves)]

    def _rows(self, group: Group) -> Float64[np.ndarray, "n joints"]:
        one = self.seen[group.source]
        place = {column.name: i for i, column in enumerate(one.columns)}
        return one.rows[:, [place[name] for name in group.columns]]

    def match(
        self, channel: str, wanted: str, name: str, chosen: Mapping[str, Group], j: int
    ) -> Match:
        """The column of joint ``j``, and its unit."""
        group = chosen[name]
        column = self._column(group, j)
        slide = wanted in ("m", "m/s") and not column.unit and {"q", "qd"} <= chosen.keys()
        known = self._of_slide(name, chosen, j) if slide else None
        unit, scale, reason = known or self._unit(wanted, name, chosen, column)
        return Match(channel, group.source, column.name, unit, reason, scale)

    def _column(self, group: Group, j: int) -> ColumnInfo:
        """Described by the whole family: one joint may turn by little."""
        known = {column.name: column for column in self.seen[group.source].columns}
        there = [known[name] for name in group.columns]
        low, high = min(c.low for c in there), max(c.high for c in there)
        return replace(there[j], low=low, high=high)

    def _counted(self, group: Group) -> bool:
        """Is all that a family says whole, and too much for degrees?"""
        rows = self._rows(group)
        known = rows[np.isfinite(rows)]
        return bool((known == np.round(known)).all() and np.abs(known).max(initial=0.0) > MOST)

    def _of_slide(
        self, name: str, chosen: Mapping[str, Group], j: int
    ) -> tuple[str, Answer, str] | None:
        """Unit of a slide's place or speed, by how far it goes and what the one changes by over the
        other; None: they do not say."""
        relation = next(iter(self.relations(chosen["q"], chosen["qd"])[j : j + 1]), None)
        if name not in ("q", "qd") or relation is None or not relation.clear:
            return None
        own = {c.name: c for c in self.seen[chosen["q"].source].columns}[chosen["q"].columns[j]]
        fine = max(abs(own.low), abs(own.high)) > LONGEST
        units = {1.0: ("mm", "mm/s") if fine else ("m", "m/s"), 1e3: ("mm", "m/s"),
                 1e-3: ("m", "mm/s")}  # fmt: skip
        for factor, pair in units.items():
            if abs(relation.factor / factor - 1.0) < 0.1:
                return pair[name == "qd"], 1.0, "place and speed fit each other"
        return None

    def _unit(
        self, wanted: str, name: str, chosen: Mapping[str, Group], column: ColumnInfo
    ) -> tuple[str, Answer, str]:
        if name == "tau" and chosen[name].quantity not in _WANTED["tau"]:
            what = "a current" if chosen[name].quantity == "current" else "no name says what it is"
            return wanted, ASK, f"{what}: how many {wanted} at the joint is one?"
        unit, scale, reason = unit_of(wanted, column)
        if name == "q" and not column.unit and self._counted(chosen[name]):
            return wanted, ASK, f"counts of an encoder: how many {wanted} is one?"
        turns = name in ("q", "qd") and wanted.startswith("rad")
        if column.unit or not turns or not {"q", "qd"} <= chosen.keys():
            return unit, scale, reason
        factors = [
            r.factor for r in self.relations(chosen["q"], chosen["qd"]) if r is not None and r.clear
        ]
        if not factors:
            return unit, scale, reason
        factor = float(np.median(factors))
        if self._counted(chosen["q"]) and abs(factor - 1.0) < 0.1:
            return wanted, ASK, f"counts of an encoder: how many {wanted} is one?"
        if abs(factor / _TURN - 1.0) < 0.1:
            return (
                ("deg" if name == "q" else "rad/s"),
                1.0,
                "degrees: its change over its speed is 57.3",
            )
        if abs(factor * _TURN - 1.0) < 0.1:
            return (
                ("rad" if name == "q" else "deg/s"),
                1.0,
                "its speed is in degrees: their ratio is 57.3",
            )
        if abs(factor - 1.0) < 0.1:
            widest = self._column(chosen["q"], 0)
            degrees = max(abs(widest.low), abs(widest.high)) > 7.0
            part = "deg" if degrees else "rad"
            return part if name == "q" else f"{part}/s", 1.0, "angle and speed fit each other"
        return unit, scale, f"its change is {factor:.3g} times its speed: please check"
