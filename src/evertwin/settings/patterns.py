"""Patterns: one line for what is alike.

``"q{1..6}" = { column = "position.{0..5}" }`` is six entries; ``{1..6}`` runs, ``{a, b, c}`` lists.
A pattern in a key, or in a text of a table that stands in an array (``[[derive]]``), repeats the
entry; the patterns inside it go along, step by step, so all have equally many members. A pattern in
a text of an array repeats that text. What is nothing but a pattern of numbers gives numbers.

>>> table = {"tau{1..2}": {"column": "{13, 14}", "unit": "Nm"}, "outputs": ["tau{1..2}", "t"]}
>>> out, origin = written_out(table)
>>> out["tau2"], out["outputs"]
({'column': 14, 'unit': 'Nm'}, ['tau1', 'tau2', 't'])
>>> origin[("tau2",)], origin[("outputs", 2)]
(('tau{1..2}',), ('outputs', 1))

``{{1..6}}`` stands for the text ``{1..6}``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from evertwin.settings.notes import Path, PlacedError

MOST = 10_000
"""Entries that the patterns of a file may give."""
_GROUP = re.compile(r"(?<![${])\{(?:(\d{1,9})\.\.(\d{1,9})|([^{},]+(?:,[^{},]+)+))\}(?!\})")
_LITERAL = re.compile(r"\{(\{[^{}]*(?:\.\.|,)[^{}]*\})\}")
_NUMBER = re.compile(r"[+-]?(?:0|[1-9]\d*)(\.\d+)?([eE][+-]?\d+)?")


def written_out(table: Mapping[str, Any]) -> tuple[dict[str, Any], dict[Path, Path]]:
    """The table without patterns, and where what they gave was written.

    Raises:
        PlacedError: two patterns of an entry differ in length, a pattern gives a key a second time,
            stands where nothing can be repeated, or gives too much.
    """
    work = _Work()
    return work.table(table, (), ()), work.origin


@dataclass(frozen=True)
class _Step:
    """The member that an entry is at."""

    at: int
    of: int
    said: str
    """The text whose pattern repeats the entry."""


@dataclass
class _Work:
    origin: dict[Path, Path] = field(default_factory=dict)
    """Place of what a pattern gave or moved → place in the text."""
    made: int = 0

    def table(
        self, node: Mapping[str, Any], old: Path, new: Path, step: _Step | None = None
    ) -> dict[str, Any]:
        out: dict[str, Any] = {}
        for key, value in node.items():
            at = (*old, key)
            for each in self._steps([key], at) if step is None else [step]:
                name = _text(key, each, at)
                if name in out:
                    raise PlacedError(f"{key!r} gives {name!r} a second time", at)
                if name != key:
                    self.origin[(*new, name)] = at
                out[name] = self._value(value, at, (*new, name), each)
        return out

    def _array(self, node: list[Any], old: Path, new: Path, step: _Step | None) -> list[Any]:
        out: list[Any] = []
        for i, item in enumerate(node):
            at = (*old, i)
            for each in self._steps(_texts(item), at) if step is None else [step]:
                place = (*new, len(out))
                if place != at:
                    self.origin[place] = at
                out.append(self._value(item, at, place, each))
        return out

    def _value(self, node: Any, old: Path, new: Path, step: _Step | None) -> Any:
        if isinstance(node, Mapping):
            return self.table(node, old, new, step)
        if isinstance(node, list):
            return self._array(node, old, new, step)
        return _member(node, step, old) if isinstance(node, str) else node

    def _steps(self, texts: list[str], at: Path) -> list[_Step] | list[None]:
        """What the patterns of ``texts`` repeat an entry over; once, without any."""
        first = next((text for text in texts if _GROUP.search(text)), None)
        if first is None:
            return [None]
        size = max(_size(group) for group in _GROUP.finditer(first))
        self.made += size
        if self.made > MOST:
            raise PlacedError(f"{first!r}: patterns give more than {MOST} entries", at)
        return [_Step(k, size, first) for k in range(size)]


def _texts(item: Any) -> list[str]:
    """The texts of an array's element whose patterns repeat it: itself, or those of its table."""
    values = item.values() if isinstance(item, Mapping) else [item]
    return [value for value in values if isinstance(value, str)]


def _member(text: str, step: _Step | None, at: Path) -> str | int | float:
    """The text at a step; the number, where it is nothing but a pattern of numbers."""
    made = _text(text, step, at)
    number = _NUMBER.fullmatch(made) if _GROUP.fullmatch(text) else None
    if number is None:
        return made
    return int(made) if number[1] is None and number[2] is None else float(made)


def _text(text: str, step: _Step | None, at: Path) -> str:
    def member(group: re.Match[str]) -> str:
        if step is None:
            raise PlacedError(
                f"{text!r}: a pattern in a text needs one in its key, or an array around it; for "
                "the text itself write {{...}}", at,
            )  # fmt: skip
        if _size(group) != step.of:
            raise PlacedError(
                f"{text!r} has {_size(group)} members, {step.said!r} has {step.of}: the patterns "
                "of an entry go along step by step", at,
            )  # fmt: skip
        return _pick(group, step.at)

    return _LITERAL.sub(r"\1", _GROUP.sub(member, text))


def _size(group: re.Match[str]) -> int:
    first, last, listed = group.groups()
    return listed.count(",") + 1 if listed is not None else abs(int(last) - int(first)) + 1


def _pick(group: re.Match[str], k: int) -> str:
    first, last, listed = group.groups()
    if listed is not None:
        return str(listed.split(",")[k].strip())
    number = int(first) + (k if int(last) >= int(first) else -k)
    return str(number).zfill(len(first) if first.startswith("0") else 0)
