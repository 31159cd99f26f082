"""Detections against what an image is known to show: rows of truth and label, average precision.

What is known is a table (CSV) of one row a thing: ``t_ns`` of its image, ``label``, its box ``left
upper right lower`` [pixels], and may have ``group`` (what hangs together) and numbers that the
simulation draws. A row without a label marks a place where nothing is asked, such as a thing too
small to be told.

A detection and a thing are one where their boxes overlap by half, those of one class first, then
the closest; each is one of at most one. What is left is a miss or a false alarm, unless it lies
where nothing is asked: `evertwin.features.images.labelled.NOTHING`.

>>> mark = Mark(0, "table", (0.0, 0.0, 10.0, 10.0))
>>> seen = [Detection("box", 0.9, (0.0, 0.0, 9.0, 10.0)), Detection("box", 0.4, (20, 0, 30, 9))]
>>> [(one.truth, one.label) for one in judged([mark], seen)]
[('table', 'box'), ('(nothing)', 'box')]
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from evertwin.errors import DataError
from evertwin.features.images.detector import SAME, Corners, Detection, overlap
from evertwin.features.images.labelled import NOTHING
from evertwin.sources.texts.small_table import ABSENT, read_table

EDGES = ("left", "upper", "right", "lower")
COLUMNS = ("t_ns", "label", *EDGES)


class Mark(NamedTuple):
    """What an image shows. See the module for an example."""

    t: int
    """Of the image [ns]."""
    label: str
    """Empty: nothing is asked there."""
    corners: Corners
    group: str = ""
    settings: Mapping[str, float] = {}


class Judged(NamedTuple):
    """A row of truth and label.

    >>> Judged("table", NOTHING, float("nan"), None).label
    '(nothing)'
    """

    truth: str
    label: str
    probability: float
    """NaN for a miss."""
    mark: Mark | None


def read_marks(file: Path) -> list[Mark]:
    """The marks of a table, in the order of their images.

    Raises:
        DataError: a column is absent, or a box is none.
    """
    table = read_table(file)
    if "label" not in table.text:
        raise DataError(f"{file}: expected columns {', '.join(COLUMNS)}, got no words in 'label'")
    t = table.column("t_ns").astype(np.int64)
    edges = np.column_stack([table.column(name) for name in EDGES])
    bad = ~((edges[:, 0] < edges[:, 2]) & (edges[:, 1] < edges[:, 3]))
    if bad.any():
        raise DataError(
            f"{file}:{table.lines[int(np.argmax(bad))]}: expected left < right and upper < lower"
        )
    groups = table.text.get("group") or [
        f"{one:.15g}" for one in table.numbers.get("group", np.full(len(t), np.nan))
    ]
    more = [name for name in table.numbers if name not in (*COLUMNS, "group")]
    labels = ("" if one.lower() in ABSENT else one for one in table.text["label"])
    found = [
        Mark(int(t[k]), label, (row[0], row[1], row[2], row[3]),
             "" if groups[k].lower() in ABSENT else groups[k],
             {name: float(table.numbers[name][k]) for name in more})
        for k, (label, row) in enumerate(zip(labels, edges.tolist(), strict=True))
    ]  # fmt: skip
    return sorted(found, key=lambda one: one.t)


def judged(marks: Sequence[Mark], seen: Sequence[Detection]) -> list[Judged]:
    """Rows of one image: each thing that is asked, then the false alarms."""
    asked = [one for one in marks if one.label]
    pairs = sorted(
        (one.label != other.label, -overlap(one.corners, other.corners), i, j)
        for i, one in enumerate(asked)
        for j, other in enumerate(seen)
        if overlap(one.corners, other.corners) >= SAME
    )
    of: dict[int, int] = {}
    for _, _, i, j in pairs:
        if i not in of and j not in of.values():
            of[i] = j
    rows = [
        Judged(one.label, seen[of[i]].label, seen[of[i]].probability, one)
        if i in of else Judged(one.label, NOTHING, float("nan"), one)
        for i, one in enumerate(asked)
    ]  # fmt: skip
    left = (one for j, one in enumerate(seen) if j not in of.values())
    return rows + [Judged(NOTHING, one.label, one.probability, None)
                   for one in left if not unasked(one, marks)]  # fmt: skip


def unasked(seen: Detection, marks: Iterable[Mark]) -> bool:
    """Does it lie where nothing is asked, by half of its own area or of both?"""
    left, upper, right, lower = seen.corners
    area = (right - left) * (lower - upper)
    for mark in marks:
        if mark.label:
            continue
        width = min(right, mark.corners[2]) - max(left, mark.corners[0])
        height = min(lower, mark.corners[3]) - max(upper, mark.corners[1])
        if width > 0 and height > 0 and 2 * width * height >= area:
            return True
    return False


def average_precision(
    images: Iterable[tuple[Sequence[Mark], Sequence[Detection]]], label: str
) -> float:
    """Area under precision over recall of one class, at an overlap of half.

    As PASCAL VOC has it since 2010 (Everingham et al., IJCV 2015): detections of all images from
    the most probable on, each right if it is the first of a thing that no other had; precision at
    each recall is the highest at this or a higher one. NaN where no image shows the class.
    """
    said: list[tuple[float, bool]] = []
    count = 0
    for marks, seen in images:
        mine = [one for one in marks if one.label == label]
        count += len(mine)
        free = set(range(len(mine)))
        for one in sorted(
            (one for one in seen if one.label == label), key=lambda d: -d.probability
        ):
            over = {k: overlap(one.corners, mine[k].corners) for k in free}
            best = max(over, key=lambda k: over[k], default=-1)
            if best >= 0 and over[best] >= SAME:
                free.remove(best)
                said.append((one.probability, True))
            elif not unasked(one, marks):
                said.append((one.probability, False))
    if not count:
        return float("nan")
    said.sort(key=lambda one: -one[0])
    right = np.cumsum([hit for _, hit in said])
    precision = right / np.arange(1, len(said) + 1)
    highest = np.maximum.accumulate(precision[::-1])[::-1]
    hits = np.array([hit for _, hit in said], dtype=bool)
    return float(highest[hits].sum() / count)
