"""Columns that no channel takes, though they tell what those that are taken do not.

A hoist whose load is recorded, an oven with a second heater: a model that does not take the column
makes up for it by its numbers, and anew whenever it changes. So the columns that are left are asked
how much they tell of what the taken ones leave, on the half of the recording that they were not
fitted on. What follows a machine tells as much of it as what drives it: which of the two it is, is
for a person to say.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from evertwin.models import Model
from evertwin.starter.looks.seen import Seen
from evertwin.starter.proposal import ASK, Match, Proposal
from evertwin.types import Float64, Vector

SHOWN = 3
"""Columns that are told of, at most."""
ONE_WAY = 0.8
"""Correlation with time from which on a column only goes one way."""
PIECES = 40
"""Pieces of a recording that tell, at least."""
TELLS, MORE = 0.4, 0.05
"""Share of what is left, squared, that they tell of either half, at least; and one more of them."""


def untaken(
    model: Model | None, found: Proposal, seen: Sequence[Seen], judged: Collection[str], rows: float
) -> tuple[tuple[str, ...], float]:
    """Columns that no channel takes and that tell what the taken ones leave, and the share.

    Args:
        model: what is proposed; None: a store of one's own.
        found: what its channels are.
        seen: the tables.
        judged: its outputs; none: it is not asked.
        rows: of a prediction.
    """
    matches = {one.channel: one for one in found.matches if one.column != ASK}
    match = next((matches[name] for name in judged if name in matches), None)
    if match is None or not 1.0 <= rows < np.inf:
        return (), 0.0
    table, names = seen[match.source], ("u",) if model is None else model.inputs.names
    taken = [one for name in names if len(one := _channel(name, matches, found, table, match))]
    others = {c.name: table.values(c.name) for c in table.columns if c.name in found.unused}
    keeps = model is None or len(model.states) > 0
    return telling(table.values(match.column), taken, others, round(rows), keeps=keeps)


def _channel(
    name: str, matches: Mapping[str, Match], found: Proposal, table: Seen, answer: Match
) -> Vector:
    """An input's rows, or those of what it is derived from; none of another table."""
    if name in matches:
        same = matches[name].source == answer.source
        return table.values(matches[name].column) if same else np.zeros(0)
    rule = next((d for d in found.derivations if d.name == name and d.op == "derivative"), None)
    of = np.zeros(0) if rule is None else _channel(rule.of[0], matches, found, table, answer)
    return np.gradient(of) if len(of) > 1 else of


def telling(
    answer: Vector, taken: Sequence[Vector], others: Mapping[str, Vector], rows: int, *, keeps: bool
) -> tuple[tuple[str, ...], float]:
    """The few columns that together tell most of what the taken ones leave of the answer, and the
    share of it; none where that is little.

    Args:
        answer: what a model predicts, (n,).
        taken: what it predicts it from.
        others: columns that it does not take.
        rows: of a piece: what answers is asked by means over pieces.
        keeps: has it a state? Then its change over a piece is asked, by where it began, too.

    >>> rng = np.random.default_rng(0)
    >>> load, v = (np.repeat(rng.uniform(0.0, 1.0, 60), 20) for _ in range(2))
    >>> force = 2.0 * v + 9.81 * load + rng.normal(0.0, 0.1, 1200)
    >>> others = {"noise": rng.normal(size=1200), "load": load}
    >>> names, share = telling(force, [v], others, 10, keeps=False)
    >>> names, share > 0.9
    (('load',), True)
    """
    n = len(answer) // max(rows, 1)
    if n < PIECES:
        return (), 0.0
    begins = answer[: n * rows : rows]
    right = np.append(np.diff(begins), np.nan) if keeps else _means(answer, rows)
    left = [np.ones(n), *([begins] if keeps else [])]
    for one in (_means(values, rows) for values in taken):
        left += [one, np.abs(one), np.sign(one), one * np.abs(one)]
    basis, names, share = np.column_stack(left), list[str](), 0.0
    means = ((name, _means(values, rows)) for name, values in others.items())
    columns = {name: one for name, one in means if not _goes_on(one)}
    while len(names) < SHOWN and columns.keys() - set(names):
        now = [columns[name] for name in names]
        gains = {
            name: _share(basis, np.column_stack([*now, one]), right)
            for name, one in columns.items() if name not in names
        }  # fmt: skip
        best = max(gains, key=lambda name: gains[name])
        if gains[best] < share + MORE:
            break
        names, share = [*names, best], gains[best]
    return (tuple(names), share) if share >= TELLS else ((), 0.0)


def _means(values: Vector, rows: int) -> Float64[np.ndarray, " pieces"]:
    whole = len(values) // rows * rows
    return np.asarray(values[:whole].reshape(-1, rows).mean(axis=1))


def _goes_on(values: Vector) -> bool:
    """Does a column go one way all the while? Whatever else does would be told by it."""
    known = np.flatnonzero(np.isfinite(values))
    varies = len(known) > 1 and np.ptp(values[known]) > 0.0
    return bool(varies and abs(np.corrcoef(known, values[known])[0, 1]) > ONE_WAY)


def _share(
    basis: Float64[np.ndarray, "n terms"], by: Float64[np.ndarray, "n columns"], right: Vector
) -> float:
    """The least share that they tell of a half by a fit to the other one; 0: it is not known."""
    known = np.isfinite(basis).all(axis=1) & np.isfinite(by).all(axis=1) & np.isfinite(right)
    basis, by, right = basis[known], by[known], right[known]
    first, second = slice(0, len(right) // 2), slice(len(right) // 2, None)
    varies = all((np.ptp(by[part], axis=0) > 0.0).all() for part in (first, second) if len(right))
    if len(right) < PIECES or not varies:
        return 0.0
    both = np.column_stack([basis, by])
    return min(_gain(basis, both, right, *sides) for sides in ((first, second), (second, first)))


def _gain(
    basis: Float64[np.ndarray, "n terms"], both: Float64[np.ndarray, "n more"], right: Vector,
    fitted: slice, asked: slice,
) -> float:  # fmt: skip
    left = []
    for columns in (basis, both):
        scale = np.linalg.norm(columns[fitted], axis=0) + 1e-300
        found = np.linalg.lstsq(columns[fitted] / scale, right[fitted], rcond=1e-9)[0] / scale
        left.append(float(np.square(right[asked] - columns[asked] @ found).sum()))
    return 1.0 - left[1] / left[0] if left[0] > 0.0 else 0.0
