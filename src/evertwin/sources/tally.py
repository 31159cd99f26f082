"""A tally of problems: every one is counted, the first of each kind are kept with their line.

>>> tally = Tally()
>>> tally.add([Problem("truncated", 12, "3 cells, expected 7")])
>>> tally.counts, tally.lines()
({'truncated': 1}, ('1 truncated, line 12: 3 cells, expected 7',))
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from evertwin.sources.table import Problem

__all__ = ["Tally"]

KEPT = 20
"""Problems of one kind that are kept whole."""


@dataclass
class Tally:
    """Counts of problems by kind; memory does not grow with the file.

    >>> Tally().total
    0
    """

    counts: dict[str, int] = field(default_factory=dict)
    first: dict[str, list[Problem]] = field(default_factory=dict)

    def add(self, problems: Iterable[Problem]) -> None:
        """Count ``problems``."""
        for problem in problems:
            self.counts[problem.kind] = self.counts.get(problem.kind, 0) + 1
            kept = self.first.setdefault(problem.kind, [])
            if len(kept) < KEPT:
                kept.append(problem)

    @property
    def total(self) -> int:
        """Problems of all kinds."""
        return sum(self.counts.values())

    def lines(self) -> tuple[str, ...]:
        """One line a kind: how many, where the first one is, and what it was."""
        out = []
        for kind, count in sorted(self.counts.items()):
            problem = self.first[kind][0]
            out.append(f"{count} {kind}, line {problem.line}: {problem.detail}")
        return tuple(out)
