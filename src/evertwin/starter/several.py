"""A machine of one's own with several inputs or outputs: which column is which.

A heading says it by its words, or a signal in steps is what somebody set, as where one column
drives. The weather, a supply and a load drive, too; of what is left, a column whose change what
drives tells answers, and one that only tells others drives. What does neither is left out.

>>> weight("solar irradiance"), weight("outlet temp", "degC"), weight("T_out", "degC", weather=True)
(1, -1, 1)
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import replace
from keyword import iskeyword

import numpy as np

from evertwin.errors import UsageError
from evertwin.signals import to_si
from evertwin.sources.columns.description import ColumnInfo
from evertwin.sources.columns.names import listed, unit_problem
from evertwin.starter.answers import Answers
from evertwin.starter.channels.cause import stepped, told
from evertwin.starter.channels.named import short
from evertwin.starter.looks.seen import Seen
from evertwin.starter.looks.words import AMBIENT, is_temperature, quantity, role, same_kind, words
from evertwin.starter.numbers.network import Network, Signal, network_of
from evertwin.starter.proposal import Match, Proposal
from evertwin.types import Vector

WEATHER = {"sun", "solar", "wind", "irradiance", "irradiation", "radiation", "ghi", "cloud"}
OUTSIDE = {"inlet", "entry", "feed", "load", "disturbance"} | WEATHER | AMBIENT
"""Words of what acts on a machine beside what is set."""
MOVED = {"damper", "vent", "window", "opening"}
EFFORTS = ("force", "torque", "current")
AFTER = {"outlet", "exit", "return"}
ENOUGH = 400
"""Rows that tell, at least."""
MOST = 24
"""Columns that are looked at, at most."""
TAKEN = {"x", "u", "p", "dt", "math", "step", "model", "gain", "loss"}
"""Names that the model file has for something else."""


def weight(name: str, unit: str = "", *, weather: bool = False) -> int:
    """More than 0: it drives; less: it answers; 0: its heading does not say."""
    said = set(words(name))
    beside = OUTSIDE | MOVED | (set() if same_kind(unit, "K") else {"supply"})
    if role(words(name)) == "" and not said.isdisjoint(beside):
        return 1
    if weather and "out" in said:
        return 1
    if not said.isdisjoint(AFTER):
        return -1
    moves = quantity(words(name), unit) in ("position", "velocity", "temperature")
    found = told(name, unit)
    return found if found or not (moves and unit) else -1


def several(seen: Sequence[Seen], answers: Answers) -> tuple[Proposal, Network] | None:
    """What feeds a model with several inputs or outputs, and its equations; None: one of each is
    enough, nothing is told to drive, or the columns stand in several tables.

    Raises:
        UsageError: an answer names a column that is none.
    """
    if len(seen) != 1 or seen[0].clock is None or len(seen[0].rows) < ENOUGH:
        return None
    columns = _moving(seen[0])
    said = tuple(_said(answers.get((name, "column"), ""), seen[0]) for name in ("u", "y"))
    signals = _signals(seen[0], columns)
    inputs, outputs = _sides(seen[0], columns, said)
    if not inputs or not (outputs and len(columns) > 2):
        return None
    told = network_of(
        seen[0].clock, signals, [c.name for c in columns if c.name in inputs],
        [c.name for c in columns if c.name in outputs], fixed=all(said),
    )  # fmt: skip
    if told is None or (len(told.inputs) < 2 and len(told.outputs) < 2):
        return None
    if not all(said) and told.apart:  # records of one machine, or machines, side by side
        return None
    found = _distinct(told)
    return _proposal(seen[0], columns, found, said), found


def without_sides(answers: Answers) -> Answers:
    """Answers but for what drives and what answers."""
    return {k: v for k, v in answers.items() if k not in (("u", "column"), ("y", "column"))}


def _moving(seen: Seen) -> list[ColumnInfo]:
    found = [c for c in seen.columns if c.low != c.high and role(words(c.name)) != "other"]
    return found[:MOST]


def _said(text: str, seen: Seen) -> tuple[str, ...]:
    """The columns that an answer names, between commas."""
    names = [c.name for c in seen.columns]
    if not text or text in names:
        return (text,) if text else ()
    several = tuple(part.strip() for part in text.split(","))
    for one in several:
        if one not in names:
            raise UsageError(
                f"--answer: there is no column {one!r}: expected one of {listed(names, 8)}"
            )
    return several


def _sides(
    seen: Seen, columns: Sequence[ColumnInfo], said: Sequence[Collection[str]]
) -> tuple[set[str], set[str]]:
    """What drives, by words, steps or an answer; and all else that could answer."""
    outside = any(not (AMBIENT - {"room"}).isdisjoint(words(c.name)) for c in seen.columns)
    weather = any(not WEATHER.isdisjoint(words(c.name)) for c in seen.columns)
    rank = {c.name: weight(c.name, c.unit, weather=weather) for c in columns}
    if outside:  # of a room and what is around it, the room is what is heated
        rank |= {c.name: -1 for c in columns if "room" in words(c.name)}
    for column in columns:
        if rank[column.name] == 0 and is_temperature(column):
            rank[column.name] = -1
    in_steps = {c.name for c in columns if stepped(seen.values(c.name))}
    drives = {name for name, one in rank.items() if one > 0 or (name in in_steps and one > -2)}
    currents = {c.name for c in columns if quantity(words(c.name), c.unit) == "current"}
    if currents & in_steps or (currents and not in_steps):  # what is loaded answers by its voltage
        volts = {c.name for c in columns if quantity(words(c.name), c.unit) == "voltage"}
        drives = (drives - volts) | (currents if volts else set())
    # an effort that is measured beside what is set is what that takes
    if any(name in in_steps and OUTSIDE.isdisjoint(words(name)) for name in drives):
        efforts = {c.name for c in columns if quantity(words(c.name), c.unit) in EFFORTS}
        drives -= efforts - in_steps
    # what a controller is told acts by what it puts out, where that is recorded
    rest = [c for c in columns if c.name not in drives]
    wanted = {
        c.name for c in columns
        if role(words(c.name)) == "command" and any(same_kind(c.unit, one.unit) for one in rest)
    }  # fmt: skip
    sets = {name for name in drives if OUTSIDE.isdisjoint(words(name))}
    if not sets:  # what acts from outside alone: an effort moves, or what drives is not said
        moves = any(quantity(words(c.name), c.unit) in ("velocity", "position") for c in columns)
        pushes = {c.name for c in columns if quantity(words(c.name), c.unit) in EFFORTS and moves}
        sets = pushes - drives
        drives = drives | sets if sets else set()
    drives -= wanted if sets - wanted else set()
    inputs = set(said[0]) or drives - set(said[1])
    return inputs, set(said[1]) or {c.name for c in columns} - inputs - wanted


def _signals(seen: Seen, columns: Sequence[ColumnInfo]) -> dict[str, Signal]:
    """Values [SI] and what is known of them, under the names of their columns."""
    return {
        c.name: Signal(
            _identifier(_unitless(c)), _unit(c), _in_si(seen, c),
            same_kind(_unit(c), "K") or (not c.unit and _warm(c)),
            quantity(words(c.name), c.unit) == "velocity",
        )
        for c in columns
    }  # fmt: skip


def _warm(column: ColumnInfo) -> bool:
    return is_temperature(column) or not AMBIENT.isdisjoint(words(column.name))


def _unit(column: ColumnInfo) -> str:
    return column.unit if column.unit and not unit_problem(column.unit) else "1"


def _in_si(seen: Seen, column: ColumnInfo) -> Vector:
    return np.asarray(to_si(seen.values(column.name), _unit(column)), dtype=np.float64)


def _unitless(column: ColumnInfo) -> str:
    """A heading without the unit that it ends in."""
    unit = f" {column.unit}"
    return column.name.removesuffix(unit) if column.unit else column.name


def _identifier(column: str) -> str:
    name = short(column)
    name = name if re.match(r"[a-z]", name) else f"c_{name}"
    return f"{name}_" if iskeyword(name) or name in TAKEN else name


def _proposal(
    seen: Seen, columns: Sequence[ColumnInfo], found: Network, said: Sequence[Collection[str]]
) -> Proposal:
    units = {c.name: _unit(c) for c in columns}
    why = {"in": "assumed to drive: please check", "out": "assumed to answer: please check"}
    sides = ((found.inputs, "in", said[0]), (found.outputs, "out", said[1]))
    matches = tuple(
        Match(one.name, 0, column, units[column], "as answered" if answered else why[side])
        for names, side, answered in sides for column, one in names.items()
    )  # fmt: skip
    taken = {match.column for match in matches}
    return Proposal(matches, (), (), tuple(c.name for c in seen.columns if c.name not in taken))


def _distinct(found: Network) -> Network:
    """With names of which no two are the same."""
    names: dict[str, str] = {}
    for column, one in (*found.inputs.items(), *found.outputs.items()):
        name = one.name
        while name in names.values():
            name += "_"
        names[column] = name
    inputs, outputs = (
        {column: replace(one, name=names[column]) for column, one in side.items()}
        for side in (found.inputs, found.outputs)
    )
    return Network(inputs, outputs, found.equations)
