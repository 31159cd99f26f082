"""Several axes in one table: each is a machine of its own, with a twin file of its own.

Headings that differ in one letter or number alone (``x_pos``, ``y_pos``; ``axis1_cur``,
``axis2_cur``) belong to axes where each of them has two columns or more.

>>> named = ["x_vel", "x_cur", "y_vel", "y_cur", "temp"]
>>> tokens(named)
('x', 'y')
>>> tokens(["x_vel", "x_cur", "temp"]), tokens(["pos_x", "pos_y"])
((), ())
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from evertwin.starter.looks.seen import Seen
from evertwin.starter.looks.words import words

_LETTERS = frozenset("xyzabc")
LEAST = 2
"""Columns of an axis: of its motion, and of what drives it."""


def tokens(names: Sequence[str]) -> tuple[str, ...]:
    """The words that tell axes apart, in the order of the columns; none where there is one axis."""
    stems: dict[str, set[tuple[str, ...]]] = {}
    for name in names:
        said = words(name)
        for place, word in enumerate(said):
            if word.isdigit() or word in _LETTERS:
                stems.setdefault(word, set()).add((*said[:place], "#", *said[place + 1 :]))
    for first in stems.values():
        alike = tuple(word for word, other in stems.items() if other == first)
        if len(alike) > 1 and len(first) >= LEAST:
            return alike
    return ()


def by_axis(seen: Sequence[Seen]) -> tuple[tuple[str, tuple[Seen, ...]], ...]:
    """(word, what was seen of the axis), axis by axis; one without a word where there is one."""
    found = tokens([c.name for c in seen[0].columns]) if len(seen) == 1 else ()
    if not found:
        return (("", tuple(seen)),)
    return tuple((word, (_without(seen[0], set(found) - {word}),)) for word in found)


def _without(seen: Seen, others: set[str]) -> Seen:
    """Without the columns of other axes."""
    names = [c.name for c in seen.columns]
    gone = {name for name in names if others & set(words(name))}
    columns = tuple(c for c in seen.table.columns if c.name not in gone)
    rows = seen.rows[:, [name not in gone for name in names]]
    return replace(seen, table=replace(seen.table, columns=columns), rows=rows)
