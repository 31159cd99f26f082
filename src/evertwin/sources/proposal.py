"""Which column could feed which channel, and in which unit: a proposal for a person to check.

Names are compared as words with the field's usual synonyms (``forward velocity`` and ``v``),
numbers in a name must agree (``q3`` is never ``joint 2``), and a stated unit must measure the same
kind of quantity. Without a stated unit the range decides: an angle that reaches 180 is in degrees.
Every choice carries its reason, and what found no column is named.

>>> import tempfile
>>> from pathlib import Path
>>> from evertwin.sources.info import inspect
>>> file = Path(tempfile.mkdtemp()) / "run.csv"
>>> _ = file.write_text("time [s],forward velocity [cm/s]\\n0,10\\n0.1,12\\n0.2,11\\n")
>>> match = propose(inspect(file), Layout.of(v="m/s")).matches[0]
>>> match.channel, match.column, match.unit
('v', 'forward velocity', 'cm/s')
"""

from __future__ import annotations

import difflib
import math
import re
from dataclasses import dataclass

from evertwin.errors import UsageError
from evertwin.signals import Channel, Layout, compatible
from evertwin.sources.description import ColumnInfo, Info, TableInfo
from evertwin.sources.names import unit_problem

_SYNONYMS = (
    {"v", "speed", "velocity", "vel", "linear", "forward"},
    {"w", "omega", "turn", "yawrate", "angular", "rotational", "rotation", "wz"},
    {"heading", "yaw", "theta", "orientation", "psi", "phi", "angle"},
    {"q", "position", "pos", "angle", "joint"},
    {"qd", "dq", "velocity", "vel", "speed", "joint"},
    {"qdd", "ddq", "acceleration", "accel", "joint"},
    {"tau", "torque", "effort", "moment", "joint"},
    {"i", "current", "amps", "motor", "joint"},
    {"t", "temp", "temperature", "box"},
    {"cmd", "command", "commanded", "desired", "reference", "setpoint", "target"},
    {"on", "state", "switch"},
    {"force", "f"},
    {"voltage", "vir", "u", "volt"},
)
_OTHERS = {"delta", "diff", "difference", "increment", "error", "variance", "std"}
"""What a column with such a word holds is said about the quantity, and is not the quantity."""
_AXIS = re.compile(r"(v)([xy])")
_LEAST = 0.45
_RANGES = (
    ("rad", "deg", 7.0, math.inf),
    ("rad/s", "deg/s", 60.0, math.inf),
    ("K", "degC", -math.inf, 200.0),
    ("m", "mm", 1000.0, math.inf),
    ("m/s", "mm/s", 50.0, math.inf),
)
"""(unit of the channel, unit of the column, largest magnitude above, and below)."""


@dataclass(frozen=True)
class Match:
    """One channel and the column that could feed it.

    >>> Match("v", "", "speed", "m/s", 0.9, "stated").score
    0.9
    """

    channel: str
    table: str
    """Topic of a bag, else empty."""
    column: str
    unit: str
    score: float
    """0 to 1: how well the names agree."""
    reason: str
    """Where the unit comes from."""


@dataclass(frozen=True)
class Proposal:
    """A mapping to check, with what is missing.

    >>> Proposal((), ("v",), ()).missing
    ('v',)
    """

    matches: tuple[Match, ...]
    missing: tuple[str, ...]
    """Channels that found no column."""
    unused: tuple[str, ...]
    """Columns of numbers that no channel took."""


def propose(info: Info, layout: Layout) -> Proposal:
    """A column for every channel of ``layout`` where one is near enough, best matches first."""
    columns = [
        (table, column)
        for table in info.tables
        for column in table.columns
        if column.kind in ("number", "boolean")
        and (table.time is None or column.name != table.time.column)
    ]
    scored = sorted(
        (
            (_score(channel, table, column), -i, -j)
            for i, channel in enumerate(layout)
            for j, (table, column) in enumerate(columns)
        ),
        reverse=True,
    )
    taken: dict[int, tuple[int, float]] = {}
    used: set[int] = set()
    for score, i, j in scored:
        if score >= _LEAST and -i not in taken and -j not in used:
            taken[-i] = (-j, score)
            used.add(-j)
    matches = []
    for i, channel in enumerate(layout):
        if i in taken:
            j, score = taken[i]
            table, column = columns[j]
            unit, reason = _unit(channel, column)
            name = (channel.name, table.name, column.name)
            matches.append(Match(*name, unit, round(score, 2), reason))
    missing = tuple(c.name for i, c in enumerate(layout) if i not in taken)
    unused = tuple(c.name for j, (_, c) in enumerate(columns) if j not in used)
    return Proposal(tuple(matches), missing, unused)


def _words(name: str) -> list[str]:
    spaced = re.sub(r"([a-z])([A-Z])", r"\1 \2", name)
    words = re.findall(r"[a-z]+|\d+", spaced.lower())
    along = ((word, _AXIS.fullmatch(word)) for word in words)  # vx: v along x
    return [part for word, found in along for part in (found.groups() if found else (word,))]


def _score(channel: Channel, table: TableInfo, column: ColumnInfo) -> float:
    names = (column.name.removeprefix(table.name), *column.also)
    return max(_alike(channel, _words(name), column) for name in names)


def _alike(channel: Channel, theirs: list[str], column: ColumnInfo) -> float:
    mine = _words(channel.name)
    numbers = [w for w in mine if w.isdigit()], [w for w in theirs if w.isdigit()]
    if mine != theirs and numbers[0][-1:] != numbers[1][-1:]:
        return 0.0
    if not _OTHERS.isdisjoint(theirs) and _OTHERS.isdisjoint(mine):
        return 0.0
    if column.unit and not _same_kind(column.unit, channel.unit):
        return 0.0
    if mine == theirs:
        return 1.0
    letters = [w for w in mine if not w.isdigit()], [w for w in theirs if not w.isdigit()]
    hits = sum(any(_synonyms(a, b) for b in letters[1]) for a in letters[0])
    alike = difflib.SequenceMatcher(None, " ".join(mine), " ".join(theirs)).ratio()
    share = hits / max(len(letters[0]), 1)
    stated = 0.1 if column.unit else 0.0
    return min(0.99, 0.6 * share + 0.3 * alike + stated)


def _synonyms(a: str, b: str) -> bool:
    return a == b or any(a in group and b in group for group in _SYNONYMS)


def _same_kind(a: str, b: str) -> bool:
    try:
        return compatible(a, b)
    except UsageError:
        return False


def _unit(channel: Channel, column: ColumnInfo) -> tuple[str, str]:
    if column.unit and not unit_problem(column.unit):
        return column.unit, "stated by the file"
    suffix = _words(column.name)[-1:]
    for word, unit in (("deg", "deg"), ("rad", "rad"), ("mm", "mm"), ("cm", "cm"), ("mps", "m/s")):
        if suffix == [word] and _same_kind(unit, channel.unit):
            return unit, f"the name ends in {word}"
    largest = max(abs(column.low), abs(column.high))
    for inside, outside, above, below in _RANGES:
        if channel.unit == inside and above < largest < below:
            size = "small" if above < 0 else "large"
            return outside, f"values reach {largest:.4g}: too {size} for {inside}"
    return channel.unit, "assumed: please check"
