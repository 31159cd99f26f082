"""A mapping of columns to channels, for a person to check: each choice with its reason."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

ASK: Final = "?"
"""Stands in the twin file where a person has to say it; a run refuses it by name."""
Answer: TypeAlias = float | Literal["?"]


@dataclass(frozen=True)
class Match:
    """One channel and the column that could feed it.

    >>> Match("v", 0, "speed", "m/s", "stated by the file").scale
    1.0
    """

    channel: str
    """Of the model, or one that others are derived from."""
    source: int
    """Which of the tables that were seen."""
    column: str
    unit: str
    reason: str
    """Why this column, and where its unit comes from."""
    scale: Answer = 1.0
    """Multiplies the column's numbers before its unit is converted."""
    offset: float = 0.0
    """Added after that, in the column's unit."""


@dataclass(frozen=True)
class Derivation:
    """A channel that is computed from others.

    >>> Derivation("qd1", "derivative", ("q1",), "rad/s").value is None
    True
    """

    name: str
    op: str
    of: tuple[str, ...]
    unit: str
    value: Answer | None = None
    reason: str = ""


@dataclass(frozen=True)
class Proposal:
    """What was found, and what is left to say.

    >>> Proposal((Match("v", 0, "cur", "N", "", ASK),), (), ("x",), ()).questions
    ('v: scale', 'x: column')
    """

    matches: tuple[Match, ...]
    derivations: tuple[Derivation, ...]
    missing: tuple[str, ...]
    """Channels that found no column."""
    unused: tuple[str, ...]
    """Columns of numbers that no channel took."""

    @property
    def questions(self) -> tuple[str, ...]:
        """What a person has to say before a run."""
        asked = [(m.channel, "scale") for m in self.matches if m.scale == ASK]
        asked += [(d.name, "value") for d in self.derivations if d.value == ASK]
        asked += [(m.channel, "column") for m in self.matches if m.column == ASK]
        asked += [(name, "column") for name in self.missing]
        return tuple(f"{name}: {what}" for name, what in asked)

    def to_dict(self) -> dict[str, object]:
        """Plain values for JSON."""
        return {
            "channels": {m.channel: m for m in self.matches},
            "derived": {d.name: d for d in self.derivations},
            "missing": self.missing, "unused": self.unused, "questions": self.questions,
        }  # fmt: skip


def together(lines: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """Lines of (name, text) whose names differ in their number alone, as one line.

    >>> together([("q1", "column"), ("q2", "column"), ("x", "scale")])
    [('q1, q2', 'column'), ('x', 'scale')]
    """
    groups: dict[tuple[str, str], list[str]] = {}
    for name, text in lines:
        groups.setdefault((re.sub(r"\d+", "#", name), re.sub(r"\d+", "#", text)), []).append(name)
    out = []
    for (_, text), names in groups.items():
        shown = f"{names[0]} to {names[-1]}" if len(names) > 2 else ", ".join(names)
        out.append((shown, text))
    return out


def position(column: str) -> int | str:
    """How a twin file names a column: one without a heading goes by its position, from 0."""
    found = re.fullmatch(r"c(\d+)", column)
    return int(found[1]) - 1 if found else column
