"""Which kind of machine a recording is of, where its headings leave no doubt.

A pose and what drives a base, a heater between temperatures, one motion and what drives it, a flow
with its pressure: each is told by quantities and units. Anything else is a model of one's own,
whose channels a person names.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence

import numpy as np

from evertwin.machines.catalog import machine
from evertwin.sources.columns.description import ColumnInfo
from evertwin.starter.channels.axes import by_axis
from evertwin.starter.channels.bare import told_apart
from evertwin.starter.channels.joints import joints_of
from evertwin.starter.channels.mapping import mapped
from evertwin.starter.channels.named import unit_of
from evertwin.starter.draft import EFFORTS
from evertwin.starter.looks.seen import Seen
from evertwin.starter.looks.words import (
    AMBIENT,
    HEATER,
    QUANTITIES,
    is_temperature,
    quantity,
    role,
    same_kind,
    words,
)
from evertwin.starter.numbers.oscillator_guess import guess_oscillator
from evertwin.starter.numbers.starts import NEARER
from evertwin.starter.proposal import Match, Proposal

ARM = "joints"
"""An arm of which no description is given."""
PUMP = "pump"
"""A static map from speed and flow to pressure, written as a model of one's own."""
_FLOW, _PRESSURE, _SPEED = "m^3/s", "Pa", "rad/s"
_SPEED_LOOP = re.compile(r"(?<![A-Za-z])S(?:IC[-_ ]?|[CT][-_ ]?\d|IT[-_ ]?)\d")
"""A tag that begins with the letter of speed (ISA-5.1)."""
SWINGS = 20
"""Of what swings, in a recording."""
_AXES = 3
"""More axes than these are an arm's, of which a description is needed."""


def kind_of(seen: Sequence[Seen]) -> str:
    """A model's name, ``joints``, ``pump``, or ``python`` where the headings do not say."""
    seen, _ = told_apart(seen)
    base = _base(seen)
    if base:
        return base
    if joints_of(seen):
        return ARM
    columns = [column for _, column in _varying(seen)]
    if len(pump(seen)) == len(("speed", "flow", "pressure")):
        return PUMP
    warm = [c for c in columns if is_temperature(c) and role(words(c.name)) != "command"]
    heats = [c for c in columns if not HEATER.isdisjoint(words(c.name)) and c not in warm]
    ambient = [c for c in warm if not AMBIENT.isdisjoint(words(c.name))]
    shares = [c for c in columns if c.unit in ("%", "W", "kW") and c not in warm]
    alone = len(columns) == len(warm) + 1  # what else moves would be left out of its heat
    if (warm and heats) or (ambient and len(warm) > 1 and len(shares) == 1 and alone):
        return "thermal"
    axes = by_axis(seen)
    driven = len(axes) <= _AXES and all(_is_driven(part) for _, part in axes)
    if driven and not any(_swings(part) for _, part in axes):
        return "drive" if all(_is_told(part) for _, part in axes) else "drive_force"
    return "robot1d" if _goes(columns) else "python"


def _goes(columns: Sequence[ColumnInfo]) -> bool:
    """Is there one command, a speed, and one place that goes by it, whatever else is recorded that
    pushes nothing?"""
    said = [(words(c.name), c.unit) for c in columns]
    told = [unit for name, unit in said if role(name) == "command"]
    places = [unit for name, unit in said if role(name) != "command" and same_kind(unit, "m")]
    pushed = any(quantity([w for w in name if len(w) > 2], unit) in EFFORTS for name, unit in said)
    return len(told) == len(places) == 1 and same_kind(told[0], "m/s") and not pushed


def _base(seen: Sequence[Seen]) -> str:
    """The kind of a mobile base, where speeds and pose leave nothing to ask: one that is steered,
    one that is told to go sideways as it is told to go ahead, or one of two wheels; else empty."""
    steers = any("steering" in _meant(words(column.name)) for _, column in _varying(seen))
    for kind in (*["bicycle"] * steers, "omni", "differential"):
        found = mapped(machine(kind, {}), seen)
        sound = not found.questions and not found.derivations
        wheels = {one.name for one in found.derivations} == {"both", "v", "turning", "w"}
        sound |= kind == "differential" and wheels and not found.missing
        if sound and (kind != "omni" or _sideways(found, seen)):
            return kind
    return ""


def _meant(said: Sequence[str]) -> set[str]:
    return {"steering" if word in ("steer", "steered") else word for word in said}


def _sideways(found: Proposal, seen: Sequence[Seen]) -> bool:
    """Are the speeds ahead and to the side said alike? What a base is not told is slip, if it is
    small."""
    ahead, side = (next(m for m in found.matches if m.channel == name) for name in ("vx", "vy"))
    said = words(side.column)
    if [word if word != "y" else "x" for word in said] != words(ahead.column):
        return False
    across, along = (np.nanstd(seen[m.source].values(m.column)) for m in (side, ahead))
    return role(said) == "command" or bool(across > 0.3 * along)


def _varying(seen: Sequence[Seen]) -> Iterator[tuple[int, ColumnInfo]]:
    """Columns that vary and are no difference, limit or state, with their tables."""
    return (
        (s, column)
        for s, one in enumerate(seen) for column in one.columns
        if column.low != column.high and role(words(column.name)) != "other"
    )  # fmt: skip


def _is_driven(seen: Sequence[Seen]) -> bool:
    """Is there one motion that was measured, and one effort, and nothing that flows?"""
    columns = [column for _, column in _varying(seen)]
    if any(_is(c, unit, word) for c in columns for unit, word in _FLOWING):
        return False
    found = [
        (quantity([w for w in words(c.name) if len(w) > 2], c.unit), role(words(c.name)))
        for c in columns
    ]  # letters alone are no quantities
    measured = [what for what, said in found if said != "command"]
    places, speeds = measured.count("position"), measured.count("velocity")
    efforts = measured.count("force") + measured.count("torque")
    currents = measured.count("current")
    one = currents <= 1 if efforts == 1 else efforts == 0 and currents == 1  # a current makes it
    return one and places <= 1 and speeds <= 1 and places + speeds > 0


def _swings(seen: Sequence[Seen]) -> bool:
    """Does what the effort moves swing about a place, as a mass on a spring? No axis does."""
    said = {quantity(words(c.name), c.unit): (s, c.name) for s, c in _varying(seen)}
    effort = next((said[what] for what in EFFORTS if what in said), None)
    place = said.get("position")
    if effort is None or place is None or place[0] != effort[0] or len(list(_varying(seen))) > 2:
        return False
    one = seen[place[0]]
    t, y = one.clock, one.values(place[1])
    if t is None:
        return False
    found, off = guess_oscillator(t, one.values(effort[1]), y)
    if found is None or off > NEARER**2 * float(np.nanvar(y)):
        return False
    return math.sqrt(found.stiffness) * float(np.ptp(t)) > SWINGS * math.tau


def _is_told(seen: Sequence[Seen]) -> bool:
    """Is the effort told in steps, which hold while the motion goes on? One that is measured, or
    that a controller sets, is another at every row."""
    columns = [(quantity(words(c.name), c.unit), seen[s].values(c.name)) for s, c in _varying(seen)]
    efforts = [values for what, values in columns if what in EFFORTS]
    places = [values for what, values in columns if what == "position"]
    return len(efforts) == 1 and any(
        len(place) == len(efforts[0])
        and np.mean((np.diff(efforts[0]) == 0.0) & (np.diff(place) != 0.0)) > _HOLDS
        for place in places
    )


_HOLDS = 0.7
"""Share of rows at which what is told in steps is as before, and what it moves is not."""
_FLOWING = ((_FLOW, "flow"), (_PRESSURE, "pressure"))


def _is(column: ColumnInfo, unit: str, word: str) -> bool:
    said = words(column.name)
    return same_kind(column.unit, unit) if column.unit else word in said


def pump(seen: Sequence[Seen]) -> tuple[Match, ...]:
    """Speed, flow and pressure of a machine that moves a fluid, each where one column is it and
    says its unit."""
    out = []
    for name, unit in (("speed", _SPEED), ("flow", _FLOW), ("pressure", _PRESSURE)):
        fits = [
            (s, c) for s, c in _varying(seen)
            if role(words(c.name)) != "command" and same_kind(c.unit, unit)
            and (name != "speed" or "rpm" in (c.unit, *words(c.name)) or "speed" in words(c.name))
        ]  # fmt: skip
        shares = (
            [] if fits or name != "speed" else [(s, c) for s, c in _varying(seen) if _drives(c)]
        )
        if len(fits) == 1:
            ((s, column),) = fits
            said, scale, why = unit_of(unit, column)
            why = f"the only one in {said}" if said == column.unit else why
            out.append(Match(name, s, column.name, said, why, scale))
        elif len(shares) == 1:
            ((s, column),) = shares
            out.append(Match(name, s, column.name, "%", "the only speed, a share of its largest"))
    return tuple(out)


def _drives(column: ColumnInfo) -> bool:
    """Is it the speed that a drive is told, as a share?"""
    speeds = QUANTITIES["velocity"] | {"rpm"}
    says = not speeds.isdisjoint(words(column.name)) or _SPEED_LOOP.search(column.name) is not None
    return column.unit == "%" and says
