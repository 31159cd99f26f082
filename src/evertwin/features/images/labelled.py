"""What a detector said of things whose class is known: rows of truth and label, simulated and real.

A table has a column of the true class, one of the class that was said, and may have the detector's
probability, a column that tells simulated from real, one that tells which rows hang together (the
scene, the recording, the thing that was followed), and columns of numbers: what the simulation
draws anew each time, such as light or distance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from evertwin.errors import DataError, UsageError
from evertwin.sources.texts.small_table import ABSENT, Table, read_table
from evertwin.types import Bools, Float64, Int64, Vector

NOTHING = "(nothing)"
"""Class of a row without a truth (nothing was there) or without a label (nothing was said)."""
OTHER = "(other)"
"""Class of words that are not known."""
COLUMNS = {
    "truth": ("truth", "true", "ground_truth", "true_label", "actual"),
    "label": ("label", "predicted", "prediction", "predicted_label"),
    "probability": ("probability", "score", "confidence"),
    "side": ("side", "domain", "source", "origin"),
    "group": ("group", "scene", "sequence", "track", "recording"),
}
"""What a column may be called."""
SIDES = {
    "simulated": True, "simulation": True, "sim": True, "synthetic": True, "real": False,
    "measured": False, "reality": False,
}  # fmt: skip


class Codes(NamedTuple):
    """Words as numbers.

    >>> Codes(("box",), np.zeros(2, np.int64)).names
    ('box',)
    """

    names: tuple[str, ...]
    of: Int64[np.ndarray, " n"]
    """Of each row, into ``names``."""


@dataclass(frozen=True)
class Labelled:
    """Rows of both sides.

    >>> words = (["box", "table"], ["box", "box"], [True, False])
    >>> rows = Labelled.of(*words)
    >>> rows.classes, rows.truth.tolist(), rows.label.tolist()
    (('box', 'table'), [0, 1], [0, 0])
    """

    classes: tuple[str, ...]
    truth: Int64[np.ndarray, " n"]
    """Into ``classes``."""
    label: Int64[np.ndarray, " n"]
    simulated: Bools
    probability: Vector
    """Of the label; NaN where it is not told."""
    group: Int64[np.ndarray, " n"] | None = None
    """Rows with the same number hang together; None: each stands for itself."""
    settings: Mapping[str, Vector] | None = None
    """Other columns of numbers, by name."""

    @classmethod
    def of(
        cls, truth: Sequence[str], label: Sequence[str], simulated: Sequence[bool] | Bools,
        group: Int64[np.ndarray, " n"] | None = None, settings: Mapping[str, Vector] | None = None,
    ) -> Labelled:  # fmt: skip
        """Rows from words."""
        both = coded([*truth, *label])
        n = len(truth)
        return cls(both.names, both.of[:n], both.of[n:], np.asarray(simulated, dtype=np.bool_),
                   np.full(n, np.nan), group, settings)  # fmt: skip


def coded(words: Sequence[str]) -> Codes:
    """Numbers for words, in the order of the alphabet.

    >>> coded(["table", "box", "table"]).of.tolist()
    [1, 0, 1]
    """
    names, numbers = np.unique(np.array(words, dtype=np.str_), return_inverse=True)
    return Codes(tuple(str(name) for name in names), numbers.astype(np.int64))


def read_labelled(files: Sequence[Path], least: float | None = None) -> Labelled:
    """The rows of one file that names both sides, or of two: the first simulated, the second real.

    Args:
        files: CSV.
        least: labels less probable than this count as `NOTHING`.

    Raises:
        DataError: a column is absent, a side has no rows, or a probability is none.
        UsageError: a least probability for rows that have none.
    """
    tables = [read_table(file) for file in files]
    columns = [_columns(table) for table in tables]
    sides = np.concatenate([
        np.full(len(table.lines), k == 0) if len(tables) > 1 else _sides(table, columns[0])
        for k, table in enumerate(tables)
    ])  # fmt: skip
    rows = _joined(tables, columns, sides, least)
    for kind, word in ((True, "simulated"), (False, "real")):
        if not (sides == kind).any():
            raise DataError(f"{files[0]}: expected {word} rows beside the others, got none")
    return rows


def read_alone(file: Path, least: float | None = None) -> Labelled:
    """The rows of a file that are all of one side, called simulated.

    Raises:
        DataError: a column is absent, there are no rows, or a probability is none.
        UsageError: a least probability for rows that have none.
    """
    table = read_table(file)
    if not table.lines:
        raise DataError(f"{file}: expected labels, got none")
    return _joined([table], [_columns(table)], np.ones(len(table.lines), dtype=np.bool_), least)


def with_others(rows: Labelled) -> Labelled:
    """With a class more, `OTHER`, for words that its rows have not.

    >>> with_others(Labelled.of(["a"], ["b"], [True])).classes
    ('a', 'b', '(other)')
    """
    return replace(rows, classes=(*rows.classes, OTHER))


def numbers_of(
    table: Table, known: Labelled, groups: dict[str, int], least: float | None = None
) -> Float64[np.ndarray, "n w"]:
    """Rows of a table as numbers: truth and label in the classes of ``known``, whose last one is
    for all others, probability, and where ``known`` has groups the group by ``groups``, to which
    new ones are added.

    Raises:
        DataError: a column is absent, or a probability is none.
        UsageError: a least probability for rows that have none.
    """
    names = _columns(table)
    wanted = known.group is not None
    if wanted != ("group" in names):
        raise DataError(f"{table.name}: expected a column 'group' in both files or in none")
    rows = _joined([table], [names], np.ones(len(table.lines), dtype=np.bool_), least)
    place = {name: k for k, name in enumerate(known.classes)}
    own = np.array([place.get(name, len(place) - 1) for name in rows.classes])
    columns = [own[rows.truth], own[rows.label], rows.probability]
    if wanted:
        words = _words(table, names["group"])
        columns.append(np.array([groups.setdefault(word, len(groups)) for word in words]))
    return np.column_stack(columns).astype(np.float64)


def _joined(
    tables: Sequence[Table], columns: Sequence[Mapping[str, str]], sides: Bools,
    least: float | None,
) -> Labelled:  # fmt: skip
    """The rows of all tables.

    Raises:
        DataError: a probability is none, or one table has groups and another has not.
        UsageError: a least probability for rows that have none.
    """
    file = tables[0].name
    probability = np.concatenate([
        table.column(names["probability"])
        if "probability" in names else np.full(len(table.lines), np.nan)
        for table, names in zip(tables, columns, strict=True)
    ])  # fmt: skip
    if not np.all((np.isnan(probability)) | ((probability >= 0) & (probability <= 1))):
        worst = probability[np.argmax(np.abs(np.nan_to_num(probability) - 0.5))]
        raise DataError(f"{file}: expected probabilities from 0 to 1, got {worst:g}: percent?")
    truth, label = (
        [word for table, names in zip(tables, columns, strict=True)
         for word in _words(table, names[what])]
        for what in ("truth", "label")
    )  # fmt: skip
    if least is not None:
        if np.isnan(probability).any():
            raise UsageError("--least: expected a probability in each row, got rows without one")
        label = [word if p >= least else NOTHING for word, p in zip(label, probability)]
    group = None
    if all("group" in names for names in columns):
        found = [f"{side:d} {word}" for side, word in zip(
            sides, (word for table, names in zip(tables, columns, strict=True)
                    for word in _words(table, names["group"])))]  # fmt: skip
        group = coded(found).of
    elif any("group" in names for names in columns):
        raise DataError(f"{file}: expected a column 'group' in both files or in none")
    rows = Labelled.of(truth, label, sides, group, _settings(tables, columns))
    return Labelled(rows.classes, rows.truth, rows.label, rows.simulated, probability, group,
                    rows.settings)  # fmt: skip


def _columns(table: Table) -> dict[str, str]:
    """Which column is which.

    Raises:
        DataError: truth or label is absent.
    """
    low = {name.lower(): name for name in (*table.text, *table.numbers)}
    found = {
        what: next(low[word] for word in words if word in low)
        for what, words in COLUMNS.items()
        if any(word in low for word in words)
    }
    for what in ("truth", "label"):
        if what not in found:
            raise DataError(
                f"{table.name}: expected a column {what!r} (or {', '.join(COLUMNS[what][1:])}), "
                f"got {', '.join(low.values())}"
            )
    return found


def _words(table: Table, name: str) -> list[str]:
    """A column as words: numbers of classes are words, too."""
    if name in table.text:
        return [NOTHING if word.lower() in ABSENT else word for word in table.text[name]]
    return [NOTHING if np.isnan(value) else f"{value:.15g}" for value in table.numbers[name]]


def _sides(table: Table, columns: Mapping[str, str]) -> Bools:
    """Which rows are simulated.

    Raises:
        DataError: no column tells it, or another word stands in it.
    """
    if "side" not in columns:
        raise DataError(
            f"{table.name}: expected a column 'side' that says simulated or real, or two files: "
            "the first simulated, the second real"
        )
    out = np.zeros(len(table.lines), dtype=np.bool_)
    for k, word in enumerate(_words(table, columns["side"])):
        if word.lower() not in SIDES:
            raise DataError(
                f"{table.name}:{table.lines[k]}: {columns['side']}: expected simulated or "
                f"real, got {word!r}"
            )
        out[k] = SIDES[word.lower()]
    return out


def _settings(tables: Sequence[Table], columns: Sequence[Mapping[str, str]]) -> dict[str, Vector]:
    """The other columns of numbers; NaN in the file that has them not."""
    names = {
        name: None
        for table, known in zip(tables, columns, strict=True)
        for name in table.names
        if name not in known.values()
    }
    return {
        name: np.concatenate([t.numbers.get(name, np.full(len(t.lines), np.nan)) for t in tables])
        for name in names
    }
