"""Which column could feed which channel, by their names, units and ranges.

Names are compared as words with the field's usual synonyms (``forward velocity`` and ``v``),
numbers in a name must agree (``q3`` is never ``joint 2``), and a stated unit must measure the same
kind of quantity. What a machine is told goes by columns that say so, never by what a wheel or an
encoder measured; what it answers never goes by a command. What does not vary is nothing to learn
from. Without a stated unit the range decides: an angle that reaches 180 is in degrees.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Collection, Iterable, Sequence

from evertwin.signals import Channel, conversion, lacks_angle
from evertwin.sources.columns.description import ColumnInfo
from evertwin.sources.columns.names import unit_problem
from evertwin.starter.channels.compass import COMPASS, EAST, NORTH
from evertwin.starter.looks.seen import Seen
from evertwin.starter.looks.words import (
    AMBIENT,
    HEATER,
    WHEEL,
    quantity,
    role,
    said_unit,
    same_kind,
    words,
)
from evertwin.starter.proposal import ASK, Answer, Match

_SYNONYMS = (
    {"v", "speed", "velocity", "vel", "linear", "lin", "forward"},
    {"speed", "rpm"},
    {"w", "omega", "turn", "yawrate", "angular", "ang", "rotational", "rotation", "wz"},
    {"heading", "hdg", "yaw", "theta", "orientation", "psi", "phi", "angle", *COMPASS},
    {"x"} | EAST,
    {"y"} | NORTH,
    {"steering", "steer", "steered"},
    {"position", "pos", "q", "qm", "angle", "joint"},
    {"qd", "dq", "velocity", "vel", "speed"},
    {"qdd", "ddq", "acceleration", "accel"},
    {"tau", "torque", "effort", "moment"},
    {"t", "temp", "temperature", "box"},
    {"on", "state", "switch"},
    HEATER,
    AMBIENT,
    {"force", "f", "vir", "voltage", "u", "current", "cur", "i", "torque"},
)
_DRIVING = {"vir", "voltage", "volt", "u", "current", "cur", "i", "torque"}
"""What drives a force, times a constant."""
_EFFORTS, _DRIVES = {"N": "", "Nm": "torque"}, ("A", "V", "Nm")
_QUATERNION = {"orientation", "quaternion"}
_LEAST = 0.45
SHAFT = "rad/s of a shaft"
_RANGES = (
    ("rad", "deg", 7.0, math.inf),
    (SHAFT, "rpm", 1000.0, math.inf),
    ("rad/s", "deg/s", 60.0, math.inf),
    ("K", "degC", -math.inf, 200.0),
    ("m", "mm", 1000.0, math.inf),
    ("m/s", "mm/s", 50.0, math.inf),
)
"""(unit of the channel, unit of the column, largest magnitude above, and below)."""
FULL = 1.05
"""What a share reaches at most."""


def matched(
    channels: Iterable[Channel], seen: Sequence[Seen], told: Collection[str] = ()
) -> tuple[Match, ...]:
    """A column for every channel where one is near enough, best matches first.

    Args:
        channels: to be fed.
        seen: the tables.
        told: names of the channels that the machine is commanded by.
    """
    channels = tuple(channels)
    columns = [(s, column) for s, one in enumerate(seen) for column in one.columns]
    scored = sorted(
        (
            (_score(channel, seen[s], column, told), -i, -j)
            for i, channel in enumerate(channels)
            for j, (s, column) in enumerate(columns)
        ),
        reverse=True,
    )
    # what does not vary is nothing to learn from: it comes last, and is asked about
    scored.sort(key=lambda one: columns[-one[2]][1].low == columns[-one[2]][1].high)
    taken: dict[int, int] = {}
    for score, i, j in scored:
        if score >= _LEAST and -i not in taken and -j not in taken.values():
            taken[-i] = -j
    out = []
    for i, channel in enumerate(channels):
        if i in taken:
            s, column = columns[taken[i]]
            unit, scale, reason = _unit_for(channel, column)
            if column.low == column.high:
                reason = f"{column.name} would do, but stays at {column.low:g} in these recordings"
                out.append(Match(channel.name, s, ASK, unit, reason))
            else:
                out.append(Match(channel.name, s, column.name, unit, reason, scale))
    return tuple(out)


def sole(
    channels: Iterable[Channel], seen: Sequence[Seen], told: Collection[str],
    taken: Collection[tuple[int, str]],
) -> tuple[Match, ...]:  # fmt: skip
    """For channels that no name fits: the only column whose stated unit does.

    Args:
        taken: source and name of columns that feed something already.
    """
    out: list[Match] = []
    for channel in channels:
        fits = [
            (s, column)
            for s, one in enumerate(seen) for column in one.columns
            if (s, column.name) not in {*taken, *((m.source, m.column) for m in out)}
            and column.low != column.high and _measures(_stated(column), channel)
            and _may_be(role(words(column.name)), channel.name in told, channel, words(column.name))
        ]  # fmt: skip
        if len(fits) == 1:
            ((s, column),) = fits
            unit, scale, reason = _unit_for(channel, column)
            alike = sum(c.unit == column.unit for one in seen for c in one.columns)
            left = "the only one left" if alike > 1 else "the only one"
            reason = f"{left} in {unit}" if scale == 1.0 else reason
            out.append(Match(channel.name, s, column.name, unit, reason, scale))
    return tuple(out)


def _stated(column: ColumnInfo) -> str:
    """The unit that the file or the name states, where it is one; or none."""
    return column.unit if not unit_problem(column.unit) else ""


def _measures(unit: str, channel: Channel) -> bool:
    """Does a unit fit the channel, or what drives its force?"""
    kinds = (channel.unit, *(_DRIVES if channel.unit in _EFFORTS else ()))
    return any(same_kind(unit, kind) for kind in kinds)


def _unit_for(channel: Channel, column: ColumnInfo) -> tuple[str, Answer, str]:
    """`unit_of`; of a share from 0 to 1 whose unit nobody states, by its values too."""
    found = unit_of(channel.unit, column, shaft=channel.name == "speed")
    if column.unit or (channel.low, channel.high) != (0.0, 1.0) or not column.high > FULL:
        return found
    said = f"values reach {column.high:.4g}: too large for a share"
    if column.low >= 0.0 and column.high <= 100.0 * FULL:
        return "%", 1.0, said
    return "1", ASK, f"{said}: what is one over the full value?"


def unit_of(wanted: str, column: ColumnInfo, shaft: bool = False) -> tuple[str, Answer, str]:
    """Unit of a column that feeds a channel in ``wanted``, its scale, and why.

    A ``shaft`` turns faster than a joint or a base.
    """
    said, named = words(column.name), column.unit == said_unit(column.name)
    if column.unit and unit_problem(column.unit):
        return wanted, ASK, f"the file says {column.unit!r}: how many {wanted} is one?"
    if column.unit and not same_kind(column.unit, wanted):
        who = "name" if named else "file"
        return wanted, ASK, f"the {who} says {column.unit}: how many {wanted} is one?"
    if column.unit and lacks_angle(column.unit, wanted):
        return _turning(wanted, column)
    if column.unit:
        return (
            column.unit,
            1.0,
            f"the name ends in {column.unit}" if named else "stated by the file",
        )
    if wanted in _EFFORTS and not (_DRIVING - {_EFFORTS[wanted]}).isdisjoint(said):
        what = "force" if wanted == "N" else "torque"
        return wanted, ASK, f"drives the {what}: how many {wanted} is one?"
    largest = max(abs(column.low), abs(column.high))
    range_of = SHAFT if shaft and wanted == "rad/s" else wanted
    for inside, outside, above, below in _RANGES:
        if range_of == inside and above < largest < below and (EAST | NORTH).isdisjoint(said):
            size = "small" if above < 0 else "large"
            return outside, 1.0, f"values reach {largest:.4g}: too {size} for {wanted}"
    return wanted, 1.0, "assumed: please check"


def _turning(wanted: str, column: ColumnInfo) -> tuple[str, Answer, str]:
    """Of a rate in no angle: per minute, or in Hz, shafts are counted in turns."""
    factor, _ = conversion(column.unit)
    if wanted == "rad/s" and (column.unit == "Hz" or math.isclose(factor, 1.0 / 60.0)):
        unit = "turn/s" if column.unit == "Hz" else "rpm"
        return unit, 1.0, f"the file says {column.unit!r}, taken as turns"
    return wanted, ASK, f"the file says {column.unit!r}: how many {wanted} is one?"


def _score(channel: Channel, seen: Seen, column: ColumnInfo, told: Collection[str]) -> float:
    names = (column.name.removeprefix(seen.table.name), *column.also)
    commanded = channel.name in told
    said = ([w for w in words(name) if w not in seen.shared] for name in names)
    alike = max(_alike(channel, theirs, column, commanded) for theirs in said)
    about = role(words(seen.theme))
    fits = about == ("command" if commanded else "measured")
    return alike + (0.15 if fits else -0.2 if about else 0.0) if alike else 0.0


def _alike(channel: Channel, theirs: list[str], column: ColumnInfo, told: bool) -> float:
    mine = words(channel.name)
    numbers = [w for w in mine if w.isdigit()], [w for w in theirs if w.isdigit()]
    if mine != theirs and numbers[0][-1:] != numbers[1][-1:]:
        return 0.0
    what = role(theirs)
    if mine != theirs and not _may_be(what, told, channel, theirs):
        return 0.0
    if what == "command":  # a base is told how fast it yaws
        theirs = ["turn" if word == "yaw" else word for word in theirs]
    unit = _stated(column)
    if unit and not _measures(unit, channel):
        return 0.0
    if mine == theirs:
        return 1.0
    if mine == ["box"] and not (AMBIENT | HEATER).isdisjoint(theirs):
        return 0.0  # what is heated is neither the heater nor what is around
    if not _QUATERNION.isdisjoint(theirs) and theirs[-1] in ("x", "y", "z", "w"):
        return 0.0  # a part of a quaternion is no angle
    letters = [w for w in mine if not w.isdigit()], [w for w in theirs if not w.isdigit()]
    hits = sum(any(_synonyms(a, b) for b in letters[1]) for a in letters[0])
    alike = difflib.SequenceMatcher(None, " ".join(mine), " ".join(theirs)).ratio()
    share = hits / max(len(letters[0]), 1)
    stated = 0.1 if unit else 0.0
    # a current is a force times a constant; a voltage drives a speed as well
    alike -= 0.3 if channel.unit in _EFFORTS and quantity(theirs, unit) == "voltage" else 0.0
    says = 0.15 if what == ("command" if told else "measured") and hits else 0.0
    return min(0.84, 0.6 * share + 0.3 * alike + stated + says)


def _may_be(what: str, told: bool, channel: Channel, theirs: Collection[str]) -> bool:
    """May a column of this role feed a channel that the machine is told, or answers with? How fast
    a wheel turns is no command of a base; what its motor draws drives the force."""
    if what == "other":
        return False
    wheel = WHEEL.isdisjoint(words(channel.name)) and channel.unit not in _EFFORTS
    if told and wheel and not WHEEL.isdisjoint(theirs):
        return False
    return what != ("measured" if told else "command")


def _synonyms(a: str, b: str) -> bool:
    return a == b or any(a in group and b in group for group in _SYNONYMS)


def short(name: str) -> str:
    """A name for a source: what a twin file's reader would call it.

    >>> short("/cmd_vel"), short("Robot1_Odometry")
    ('cmd_vel', 'robot1_odometry')
    """
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") or "log"
