"""What was wrong with the rows of a source: counted, the first of each kind kept with its line.

>>> tally = Tally("log", limit=0.01)
>>> tally.add([Problem("truncated", 12, "3 cells, expected 7")], "run.csv")
>>> tally.used += 3
>>> print(tally)
log: 1 of 4 rows left out (25 %): 1 truncated, run.csv line 12: 3 cells, expected 7
>>> tally.finding
True

What is probably wrong with a clock is told from its first stamps and from what was lost.
Nanoseconds read as seconds leave most rows beyond the year 2262; a recording that was written
backward leaves one; stamps rounded to seconds repeat. Each has a sentence, with the factor.

>>> import numpy as np
>>> from evertwin.sources.clocks.time_unit import guess
>>> unit_of_time(guess("t", np.array([0, 50_000_000, 100_000_000])), "s", lost=True)
"the stamps look like ns (whole numbers ...), read as s, 10^9 times too long: set time ..."
>>> order_of_rows(np.array([3, 2, 1, 0]) * 10**9)
'the stamps fall in 3 of 3 steps: sort the rows by time'
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from evertwin.signals import compatible, conversion, lacks_angle
from evertwin.sources.clocks.stamps import NO_STAMP, UNITS
from evertwin.sources.clocks.time_unit import TimeGuess
from evertwin.sources.columns.names import unit_problem
from evertwin.sources.columns.table import Problem
from evertwin.types import Json, Stamps

KEPT = 20
"""Problems of one kind that are kept whole."""
LIMIT = 0.01
"""Share of the rows that may be left out where nobody says."""
SHUFFLED = 0.1
"""Share of the steps that fall from which on rows are out of order, and no clock was set."""
_STAYS = frozenset({"gap", "clock_set", "text", "empty"})
"""Kinds of problem whose row is used nevertheless."""


@dataclass
class Tally:
    """Counts of problems by kind; memory does not grow with the file.

    >>> Tally().total
    0
    """

    source: str = ""
    limit: float = LIMIT
    """Share of the rows from which on leaving them out is a finding."""
    used: int = 0
    """Rows that were used."""
    counts: dict[str, int] = field(default_factory=dict)
    first: dict[str, list[Problem]] = field(default_factory=dict, repr=False)
    cells: dict[str, int] = field(default_factory=dict)
    """Empty cells of each channel."""
    local: bool = False
    """Are its dates without a zone, those of a clock on a wall?"""
    suspicions: list[str] = field(default_factory=list)
    """What is probably wrong, such as the unit of time, with the factor."""
    advance: tuple[float, str, bool] = field(default=(0.0, "s", False), compare=False)
    """What its stamps advance by, what they are read in, and whether that is likely: the file
    states a unit, or they have decimals."""
    doubt: str = ""
    """The suspicion that is of all rows, those that were used above all."""
    notes: list[str] = field(default_factory=list)
    """How it was read where nobody had said so: no finding."""

    def add(self, problems: Iterable[Problem], file: str = "") -> None:
        """Count ``problems`` of a file."""
        for problem in problems:
            self.counts[problem.kind] = self.counts.get(problem.kind, 0) + 1
            kept = self.first.setdefault(problem.kind, [])
            if len(kept) < KEPT:
                kept.append(problem._replace(file=file) if file else problem)

    def empty(self, channel: str, count: int, first: Problem) -> None:
        """Count cells of a channel that have no value; their rows are used for the others."""
        self.counts["empty"] = self.counts.get("empty", 0) + count
        self.first.setdefault("empty", []).append(first)
        self.cells[channel] = self.cells.get(channel, 0) + count

    def suspect(self, what: str) -> None:
        """Name what is probably wrong; once."""
        if what and what not in self.suspicions:
            self.suspicions.append(what)

    @property
    def lacking(self) -> tuple[str, ...]:
        """Channels that lack more values than rows may be left out, each with its share."""
        rows = max(self.used, 1)
        return tuple(
            f"{name} lacks {100 * count / rows:.3g} % of its values"
            for name, count in self.cells.items()
            if count > self.limit * rows
        )

    @property
    def total(self) -> int:
        """Problems of all kinds."""
        return sum(self.counts.values())

    @property
    def left_out(self) -> int:
        """Rows that were read and not used."""
        return sum(count for kind, count in self.counts.items() if kind not in _STAYS)

    @property
    def share(self) -> float:
        """Rows left out of those that were read."""
        return self.left_out / max(self.used + self.left_out, 1)

    @property
    def finding(self) -> bool:
        """Whether more was left out than may be, or something is suspected."""
        return self.share > self.limit or bool(self.suspicions or self.lacking)

    def lines(self) -> tuple[str, ...]:
        """One line a kind: how many, where the first one is, and what it was."""
        out = []
        for kind, count in sorted(self.counts.items()):
            problem = self.first[kind][0]
            where = f"{problem.file} line" if problem.file else "line"
            out.append(f"{count} {kind}, {where} {problem.line}: {problem.detail}")
        return tuple(out)

    def to_dict(self) -> dict[str, Json]:
        """Plain content."""
        return {
            "source": self.source, "rows": self.used + self.left_out, "left_out": self.left_out,
            "share": self.share, "problems": dict(self.counts), "first": list(self.lines()),
            "suspicions": list(self.suspicions), "lacking": list(self.lacking),
            "notes": list(self.notes), "finding": self.finding,
        }  # fmt: skip

    def __str__(self) -> str:
        """One line with all of it; empty where nothing was wrong."""
        rows = self.used + self.left_out
        said = [*self.lines(), *self.lacking, *self.suspicions]
        head = f"{self.left_out} of {rows} rows left out ({100 * self.share:.3g} %): "
        told = "; ".join([*said, *self.notes])
        return f"{self.source or 'data'}: {head * bool(said)}{told}" if told else ""


def unit_of_time(found: TimeGuess, unit: str, *, lost: bool) -> str:
    """The sentence where stamps look like another unit than they are read in.

    Args:
        found: what they look like.
        unit: what they are read in.
        lost: rows fell away, so that a guess is worth its sentence; else only what is evident.
    """
    if not {found.unit, unit} <= UNITS.keys():
        return ""
    power = UNITS[unit] - UNITS[found.unit]
    if power == 0 or not (found.evident or (lost and power > 0)):
        return ""
    size = f"10^{abs(power)} times too {'long' if power > 0 else 'short'}"
    return (
        f"the stamps look like {found.unit} ({found.reason}), read as {unit}, {size}: set "
        f"time = {{ unit = '{found.unit}' }}"
    )


def order_of_rows(t: Stamps) -> str:
    """The sentence where most of the stamps [ns] fall or stand still, or many fall."""
    steps = np.diff(t[t != NO_STAMP])
    fall, stand = int((steps < 0).sum()), int((steps == 0).sum())
    if fall > SHUFFLED * len(steps):
        return f"the stamps fall in {fall} of {len(steps)} steps: sort the rows by time"
    if 2 * stand > len(steps):
        return (
            f"{stand} of {len(steps)} stamps repeat the one before: they are rounded, or several "
            "rows belong together"
        )
    return ""


def unit_of_channel(channel: str, stated: str, used: str) -> str:
    """The sentence where the file states another unit of the same kind than it is read in.

    >>> unit_of_channel("x", "mm", "m")
    "x: the file says 'mm', the twin file 'm': a factor of 0.001"
    >>> unit_of_channel("x", "mm", "mm"), unit_of_channel("x", "ticks", "m")
    ('', '')
    >>> unit_of_channel("w", "1/min", "rpm")  # which turns, a heading does not say
    ''
    """
    if not stated or unit_problem(stated) or not compatible(stated, used):
        return ""
    if lacks_angle(stated, used) or lacks_angle(used, stated):
        return ""
    factor = conversion(stated)[0] / conversion(used)[0]
    if conversion(stated) == conversion(used):
        return ""
    return f"{channel}: the file says {stated!r}, the twin file {used!r}: a factor of {factor:g}"
