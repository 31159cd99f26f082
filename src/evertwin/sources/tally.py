"""What was wrong with the rows of a source: counted, the first of each kind kept with its line.

>>> tally = Tally("log", limit=0.01)
>>> tally.add([Problem("truncated", 12, "3 cells, expected 7")], "run.csv")
>>> tally.used += 3
>>> print(tally)
log: 1 of 4 rows left out (25 %): 1 truncated, run.csv line 12: 3 cells, expected 7
>>> tally.finding
True
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from evertwin.sources.table import Problem
from evertwin.types import Json

KEPT = 20
"""Problems of one kind that are kept whole."""
LIMIT = 0.01
"""Share of the rows that may be left out where nobody says."""
_STAYS = frozenset({"gap", "clock_set", "text"})
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
    first: dict[str, list[Problem]] = field(default_factory=dict)
    suspicions: list[str] = field(default_factory=list)
    """What is probably wrong, such as the unit of time, with the factor."""

    def add(self, problems: Iterable[Problem], file: str = "") -> None:
        """Count ``problems`` of a file."""
        for problem in problems:
            self.counts[problem.kind] = self.counts.get(problem.kind, 0) + 1
            kept = self.first.setdefault(problem.kind, [])
            if len(kept) < KEPT:
                kept.append(problem._replace(file=file) if file else problem)

    def suspect(self, what: str) -> None:
        """Name what is probably wrong; once."""
        if what and what not in self.suspicions:
            self.suspicions.append(what)

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
        return self.share > self.limit or bool(self.suspicions)

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
            "suspicions": list(self.suspicions), "finding": self.finding,
        }  # fmt: skip

    def __str__(self) -> str:
        """One line with all of it; empty where nothing was wrong."""
        rows = self.used + self.left_out
        said = [*self.lines(), *self.suspicions]
        if not said:
            return ""
        head = f"{self.left_out} of {rows} rows left out ({100 * self.share:.3g} %)"
        return f"{self.source or 'data'}: {head}: {'; '.join(said)}"
