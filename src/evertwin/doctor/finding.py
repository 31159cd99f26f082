"""One finding of the doctor: what, where, why, and the next step."""

from __future__ import annotations

import html
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from evertwin.fold import plain
from evertwin.sources.columns.names import listed
from evertwin.types import Json

RANKS = (
    "model_failed", "sentinel", "not_tuned", "not_asked", "lost", "unrelated", "unit", "sign",
    "exchanged", "turned", "rate", "repeated", "missing", "frozen", "clock", "command", "lag",
    "lever", "current", "held", "jump", "absurd", "range", "gap", "not_possible", "not_connected",
    "gate", "horizon", "requirement", "tolerance", "tuning", "at_bound", "hidden",
    "not_identifiable", "weak", "shared",
)  # fmt: skip
"""Kinds of finding, what spoils a result most first: rows that are refused before those that are
judged by too much or too little, changes that stay untold behind what keeps one from fitting."""
SHOWN = 5
"""Findings that a person reads at once."""


@dataclass(frozen=True)
class Finding:
    """Something that is wrong, or will be.

    >>> print(Finding("unit", "x", "x moves 100 times too far", "robot.csv", "unit = 'cm'"))
    unit: x moves 100 times too far (robot.csv)
      next: unit = 'cm'
    """

    kind: str
    """unrelated, unit, sign, exchanged, turned, not_tuned, command, lag, lever, current, rate,
    held, repeated, clock, gap, frozen, absurd, missing, sentinel, lost, not_identifiable, weak,
    not_connected, at_bound, shared, range, horizon, tolerance, requirement, hidden, not_possible,
    model_failed, not_asked."""
    subject: str
    """Channel, parameter or setting."""
    reason: str
    """What was found, with its figure."""
    where: str
    """File and line, section of the twin file, or rows."""
    step: str
    """What to do next."""
    evidence: Mapping[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.kind}: {self.reason} ({self.where})\n  next: {self.step}"


@dataclass(frozen=True)
class Diagnosis:
    """What the doctor found, and the figures that it looked at.

    >>> Diagnosis("robot", 0, (), {}).findings
    ()
    """

    name: str
    rows: int
    findings: tuple[Finding, ...]
    figures: Mapping[str, Any]
    """Per output: lag, noise, mismatch; per source: its clock; per parameter: verdict."""

    def to_dict(self) -> dict[str, Json]:
        """Plain content, ``schema: "evertwin.doctor/1"``."""
        return plain({"schema": "evertwin.doctor/1", **vars(self)})  # type: ignore[return-value]

    def of_kind(self, *kinds: str) -> tuple[Finding, ...]:
        """The findings of some kinds."""
        return tuple(item for item in self.findings if item.kind in kinds)

    @property
    def ranked(self) -> tuple[tuple[Finding, ...], ...]:
        """The findings, alike ones together, what spoils the result most first.

        >>> two = (Finding("weak", "b", "", "", ""), Finding("unit", "x", "", "", ""))
        >>> [group[0].kind for group in Diagnosis("robot", 0, two, {}).ranked]
        ['unit', 'weak']
        """
        groups: dict[tuple[str, str], list[Finding]] = {}
        for one in self.findings:
            groups.setdefault((one.kind, one.step), []).append(one)
        place = {kind: number for number, kind in enumerate(RANKS)}
        order = sorted(groups.values(), key=lambda group: place.get(group[0].kind, len(RANKS)))
        return tuple(map(tuple, order))

    def text(self, most: int = SHOWN) -> str:
        """For a terminal: the ``most`` important findings, and how many others there are."""
        count, ranked = len(self.findings), self.ranked
        head = f"{self.name}: {self.rows} rows, {count} finding{'s' * (count != 1)}"
        shown = [_told(group) for group in ranked[:most]]
        rest = [f"{one.kind} ({one.subject})" for group in ranked[most:] for one in group]
        if rest:
            shown.append(f"and {len(rest)} less important (--all): {listed(rest, 4)}")
        told = {item.subject for item in self.of_kind("clock")}
        known = self.figures.get("clocks", {}).items()
        clocks = [f"clock: {found['said']}" for source, found in known if source not in told]
        about = [] if "simulated_rows" not in self.figures else [
            "the model is not compiled: what needs simulations was told from the first "
            f"{self.figures['simulated_rows']} rows, faults of sensors from the first "
            f"{self.figures['judged_rows']}"
        ]  # fmt: skip
        return "\n".join([head, *shown, *clocks, *about])

    def __str__(self) -> str:
        return self.text()

    def _repr_html_(self) -> str:
        cells = ((f.kind, f.reason, f.where, f.step) for f in self.findings)
        told = ("".join(f"<td>{html.escape(cell)}" for cell in row) for row in cells)
        rows = "".join(f"<tr>{row}</tr>" for row in told)
        title = html.escape(f"{self.name}: {len(self.findings)} findings in {self.rows} rows")
        return f"<p>{title}</p><table><tr><th>kind<th>why<th>where<th>next</tr>{rows}</table>"


def _told(group: tuple[Finding, ...]) -> str:
    """Findings of one kind and one remedy: the first in words, the others by name."""
    first, others = group[0], dict.fromkeys(one.subject for one in group[1:])
    if not others:
        return str(first)
    also = listed([name for name in others if name != first.subject] or ["the same again"], 8)
    return (
        f"{first.kind}, {len(group)} times: {first.reason} ({first.where}); also {also}"
        f"\n  next: {first.step}"
    )
