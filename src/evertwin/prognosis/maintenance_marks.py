"""Maintenance written into a history file, row by row: whom it was done to, and what it means.

A cell says ``gearbox: replaced``; several are parted by ``;``. Without a name it holds for the
component that it mentions, and for all if it mentions none. Only what begins a new life (replaced,
new) or shifts the level (adjusted) may stand there, so that no word is taken for what it is not.

>>> from evertwin.sources.small_table import parse
>>> table = parse(["run,maintenance", "1,", "2,pump: seal replaced"], "h.csv")
>>> maintenance_of(table, "pump", table.column("run"), {"pump", "motor"})[0]
(Maintenance(at=2.0, kind='replaced', note='seal replaced'),)
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Collection
from typing import Literal, NamedTuple

import numpy as np

from evertwin.errors import DataError
from evertwin.prognosis.laws import Maintenance
from evertwin.sources.small_table import ABSENT, Table
from evertwin.types import Vector

Kind = Literal["replaced", "adjusted"]
WORDS: dict[str, Kind] = {"replaced": "replaced", "new": "replaced", "adjusted": "adjusted"}
NEGATIONS = {"not", "no", "never"}
_WORD = re.compile(r"[^\W\d_]+")


class Said(NamedTuple):
    """One thing that a cell says.

    >>> Said(2, 1.0, "pump", "replaced").whom
    'pump'
    """

    line: int
    at: float
    whom: str
    """Empty: it does not say."""
    text: str


def maintenance_of(
    table: Table, component: str, at: Vector, components: Collection[str]
) -> tuple[tuple[Maintenance, ...], tuple[str, ...]]:
    """The marks of a component, and notes on those of components that the twin does not know.

    Raises:
        DataError: a word that means neither, or a name that is nearly a known one.
    """
    marks, notes = [], []
    for said in _said(table, at):
        where = f"{table.name}:{said.line}: maintenance"
        named = [said.whom] if said.whom else _mentioned(said.text, components)
        unknown = [name for name in named if name not in components]
        for name in unknown:
            notes.append(_of_another(name, components, where))
        if not unknown and (not named or component in named):
            marks.append(Maintenance(said.at, _kind(said.text, where), said.text))
    return tuple(marks), tuple(notes)


def _said(table: Table, at: Vector) -> list[Said]:
    if "maintenance" in table.numbers and np.isfinite(table.numbers["maintenance"]).any():
        k = int(np.argmax(np.isfinite(table.numbers["maintenance"])))
        raise DataError(
            f"{table.name}:{table.lines[k]}: maintenance: expected what was done, as in 'gearbox: "
            "replaced', got numbers or dates alone"
        )
    found = []
    cells = table.text.get("maintenance", ())
    for line, moment, cell in zip(table.lines, at.tolist(), cells, strict=False):
        for text in cell.split(";"):
            whom, _, said = text.rpartition(":")
            if said.strip().lower() not in ABSENT:
                found.append(Said(line, moment, whom.strip(), said.strip()))
    return found


def _mentioned(text: str, components: Collection[str]) -> list[str]:
    return [name for name in components if re.search(rf"(?<!\w){re.escape(name)}(?!\w)", text)]


def _of_another(name: str, components: Collection[str], where: str) -> str:
    """A note that a mark is left out.

    Raises:
        DataError: the name is nearly a known one, by more than its number.
    """
    near = difflib.get_close_matches(name, components, n=1)
    if near and _unnumbered(near[0]) != _unnumbered(name):
        raise DataError(f"{where}: no component {name!r}, did you mean {near[0]!r}?")
    return f"{where} of {name!r} was left out: indicators tell of {', '.join(sorted(components))}"


def _unnumbered(name: str) -> str:
    return re.sub(r"\d+", "", name)


def _kind(text: str, where: str) -> Kind:
    words = _WORD.findall(text.lower())
    kinds = {WORDS[word] for word in words if word in WORDS}
    if len(kinds) == 1 and not NEGATIONS & set(words):
        return kinds.pop()
    near = [m for word in words for m in difflib.get_close_matches(word, WORDS, n=1, cutoff=0.7)]
    meant = f", did you mean {near[0]!r}" if near and not kinds else ""
    raise DataError(
        f"{where}: expected 'replaced' (a new life begins) or 'adjusted' (the level shifts, wear "
        f"goes on), got {text!r}{meant}? What does neither belongs into another column"
    )
