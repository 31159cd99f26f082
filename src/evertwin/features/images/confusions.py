"""What a detector takes for what: simulated and real, and whether the two differ.

A *confusion* is a cell of the table truth × label off its diagonal; its rate is the share of the
rows of that truth. The most frequent ones of each side say how simulation and reality look to a
detector (Müller, Jazdi, Weyrich, "Self-improving Models for the Intelligent Digital Twin", section
3: the 5 to 10 most relevant misclassifications are compared).

Whether they differ is asked of each cell by Fisher's exact test, and of all cells together by
permutation: under "no difference" the sides of the rows of one truth may be exchanged. The smallest
p of all cells in each exchange is what the smallest p found is held against (Westfall, Young,
"Resampling-Based Multiple Testing", 1993, step-down), so that many cells raise no alarm by
themselves, and cells that depend on each other cost nothing twice. Where rows hang together (images
of one scene) whole groups are exchanged: a hundred images of one table are not a hundred tables.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy

from evertwin.features.images.labelled import Labelled
from evertwin.types import Bool, Bools, Float64, Int64, Json, Vector

EXCHANGES = 9_999
"""Exchanges of the sides: p is told to 0.0001."""
BLOCK = 10_000_000
"""Numbers that are held at once."""
POWER = 0.8
SAME = 1e-7
"""Relative difference below which two probabilities of a table are the same."""


class Rate(NamedTuple):
    """How often a truth is taken for a label on one side.

    >>> Rate(3, 10, 0.3, 0.1, 0.6, 0.9).share
    0.3
    """

    hits: int
    of: int
    """Rows of the truth."""
    share: float
    low: float
    """95 % interval (Wilson); with groups for as many independent rows as their scatter leaves."""
    high: float
    probability: float
    """Mean of what the detector gave; NaN if it gave none."""


@dataclass(frozen=True)
class Cell:
    """A confusion.

    >>> rate = Rate(1, 10, 0.1, 0.0, 0.4, 0.5)
    >>> Cell("table", "shelf", rate, rate, 1.0, False).differs
    False
    """

    truth: str
    label: str
    simulated: Rate
    real: Rate
    p: float
    """Of no difference, corrected for all cells; NaN: not compared."""
    differs: bool

    def to_dict(self) -> dict[str, Json]:
        """Plain content."""
        sides = {"simulated": self.simulated._asdict(), "real": self.real._asdict()}
        return {"truth": self.truth, "label": self.label, **sides, "p": self.p,
                "differs": self.differs}  # fmt: skip


@dataclass(frozen=True)
class Confusions:
    """All confusions of two sides.

    >>> said, sides = ["a", "b"] * 20 + ["a"] * 40, [True] * 40 + [False] * 40
    >>> found = confusions(Labelled.of(["a"] * 80, said, sides))
    >>> found.differ, [(cell.truth, cell.label) for cell in found.cells if cell.differs]
    (True, [('a', 'b')])
    """

    cells: tuple[Cell, ...]
    """That were seen on a side, those that differ most first."""
    differ: bool
    """Any?"""
    p: float
    """Of no difference at all; NaN: nothing could be compared."""
    level: float
    smallest: float
    """p that these counts could reach at best: above the level no difference can be told."""
    detectable: float
    """Difference of the most frequent confusion that is told with 80 %; NaN: none was seen."""
    alone: tuple[str, ...]
    """Classes that one side alone has: not compared."""
    groups: tuple[int, int] | None
    """Groups of the simulated and of the real side."""

    def most(self, simulated: bool, count: int) -> tuple[Cell, ...]:
        """The most frequent confusions of a side."""

        def size(cell: Cell) -> int:
            return (cell.simulated if simulated else cell.real).hits

        return tuple(sorted((c for c in self.cells if size(c)), key=size, reverse=True)[:count])


def confusions(rows: Labelled, level: float = 0.01) -> Confusions:
    """Compares the confusions of both sides.

    Args:
        rows: of both sides.
        level: probability of calling them different though they are alike.
    """
    k, sim = len(rows.classes), rows.simulated
    tables = np.stack([_table(rows, sim), _table(rows, ~sim)])
    seen = np.argwhere((tables.sum(axis=0) > 0) & ~np.eye(k, dtype=np.bool_))
    of = tables.sum(axis=2)
    compared = np.array([of[0, i] > 0 and of[1, i] > 0 for i, _ in seen], dtype=np.bool_)
    p, smallest = np.full(len(seen), np.nan), np.nan
    if compared.any():
        test = _by_rows if rows.group is None else _by_groups
        p[compared], smallest = test(rows, tables, seen[compared])
    cells = [
        Cell(rows.classes[i], rows.classes[j], _rate(rows, sim, i, j), _rate(rows, ~sim, i, j),
             float(one), bool(one <= level))
        for (i, j), one in zip(seen.tolist(), p, strict=True)
    ]  # fmt: skip
    cells.sort(key=lambda c: (np.nan_to_num(c.p, nan=2.0), -c.simulated.hits - c.real.hits))
    alone = tuple(rows.classes[i] for i in range(k) if (of[0, i] > 0) != (of[1, i] > 0))
    groups = None
    if rows.group is not None:
        groups = len(np.unique(rows.group[sim])), len(np.unique(rows.group[~sim]))
    known = p[np.isfinite(p)]
    detectable = _detectable(rows, tables, seen[compared], level)
    return Confusions(
        tuple(cells), bool((known <= level).any()), float(known.min()) if len(known) else np.nan,
        level, smallest, detectable, alone, groups,
    )  # fmt: skip


def _table(rows: Labelled, chosen: Bools) -> Int64[np.ndarray, "c c"]:
    """Counts of truth × label."""
    k = len(rows.classes)
    flat = np.bincount(rows.truth[chosen] * k + rows.label[chosen], minlength=k * k)
    return flat.reshape(k, k).astype(np.int64)


def _rate(rows: Labelled, side: Bools, i: int, j: int) -> Rate:
    """How often truth ``i`` is taken for ``j`` on a side."""
    mine = side & (rows.truth == i)
    hit = rows.label[mine] == j
    n, count = int(mine.sum()), int(hit.sum())
    if not n:
        return Rate(0, 0, np.nan, np.nan, np.nan, np.nan)
    share, independent = count / n, float(n)
    if rows.group is not None and 0 < count < n:
        independent = n / max(design_effect(hit, rows.group[mine]), 1.0)
    low, high = wilson(share, independent)
    told = rows.probability[mine][hit]
    known = told[np.isfinite(told)]
    return Rate(count, n, share, low, high, float(known.mean()) if len(known) else np.nan)


def design_effect(hit: Bools, group: Int64[np.ndarray, " n"]) -> float:
    """Times by which the variance of a share is larger than of rows that stand for themselves.

    That of a ratio over groups (Cochran, "Sampling Techniques", section 9.8).

    >>> design_effect(np.repeat([True, False], 10), np.repeat(np.arange(4), 5)).__round__(1)
    6.7
    """
    _, number = np.unique(group, return_inverse=True)
    n, hits = np.bincount(number), np.bincount(number, weights=hit)
    g, share = len(n), float(hit.mean())
    if g < 2:
        return float(len(hit))
    off = hits - share * n
    variance = g / (g - 1) * float(off @ off) / len(hit) ** 2
    return variance / (share * (1 - share) / len(hit))


def wilson(share: float, n: float) -> tuple[float, float]:
    """95 % interval of a share of ``n`` rows.

    >>> [round(end, 3) for end in wilson(0.0, 10)]
    [0.0, 0.278]
    """
    z2 = 1.96 * 1.96
    middle = (share + z2 / (2 * n)) / (1 + z2 / n)
    half = 1.96 / (1 + z2 / n) * np.sqrt(share * (1 - share) / n + z2 / (4 * n * n))
    return max(float(middle - half), 0.0), min(float(middle + half), 1.0)


def _exact(total: int, marked: int, drawn: int) -> Vector:
    """Fisher's two-sided p for each count of ``marked`` rows among ``drawn`` of ``total``.

    Counts from 0 to ``marked``; those that cannot be have p 1.
    """
    chance = scipy.stats.hypergeom.pmf(np.arange(marked + 1), total, marked, drawn)
    order = np.argsort(chance)
    below = np.cumsum(chance[order])
    last = np.searchsorted(chance[order], chance * (1 + SAME), side="right") - 1
    return np.where(chance > 0, np.minimum(below[last], 1.0), 1.0)


def _by_rows(
    rows: Labelled, tables: Int64[np.ndarray, "2 c c"], cells: Int64[np.ndarray, "m 2"]
) -> tuple[Vector, float]:
    """p of each cell by exchanging rows of the same truth, and the smallest p there could be."""
    rng = np.random.default_rng(0)
    both, drawn = tables.sum(axis=0), tables[0].sum(axis=1)
    exact = [_exact(int(both[i].sum()), int(both[i, j]), int(drawn[i])) for i, j in cells]
    found = np.array([one[tables[0, i, j]] for one, (i, j) in zip(exact, cells, strict=True)])
    order, passed = np.argsort(found), np.zeros(len(cells))
    size = max(BLOCK // max(len(cells), both.shape[1]), 1)
    for start in range(0, EXCHANGES, size):
        count = min(size, EXCHANGES - start)
        p = np.empty((count, len(cells)))
        for i in np.unique(cells[:, 0]):
            counts = rng.multivariate_hypergeometric(both[i], drawn[i], count, method="marginals")
            for m in np.flatnonzero(cells[:, 0] == i):
                p[:, m] = exact[m][counts[:, cells[m, 1]]]
        best = np.minimum.accumulate(p[:, order[::-1]], axis=1)[:, ::-1]
        passed += (best <= found[order] * (1 + SAME)).sum(axis=0)
    smallest = min(float(one.min()) for one in exact)
    return _stepped_down(passed, order), max(smallest, 1 / (EXCHANGES + 1))


def _by_groups(
    rows: Labelled, tables: Int64[np.ndarray, "2 c c"], cells: Int64[np.ndarray, "m 2"]
) -> tuple[Vector, float]:
    """The same by exchanging whole groups: differences of rates over their own scatter."""
    assert rows.group is not None
    rng = np.random.default_rng(0)
    first, number = np.unique(rows.group, return_index=True)[1], rows.group
    groups, k = len(first), tables.shape[1]
    side = rows.simulated[first]
    truths = np.zeros((groups, k))
    np.add.at(truths, (number, rows.truth), 1.0)
    hits = np.stack([np.bincount(number, weights=(rows.truth == i) & (rows.label == j),
                                 minlength=groups) for i, j in cells], axis=1)  # fmt: skip

    def off_by(sides: Bool[np.ndarray, "b g"]) -> Float64[np.ndarray, "b m"]:
        rates = []
        for chosen in (sides.astype(np.float64), (~sides).astype(np.float64)):
            of = (chosen @ truths)[:, cells[:, 0]]
            rates.append(np.divide(chosen @ hits, of, out=np.zeros_like(of), where=of > 0))
        return np.asarray(np.abs(rates[0] - rates[1]))

    size = max(BLOCK // groups, 1)
    blocks = [min(size, EXCHANGES - start) for start in range(0, EXCHANGES, size)]
    exchanged = (rng.permuted(np.tile(side, (count, 1)), axis=1) for count in blocks)
    off = np.concatenate([off_by(side[None]), *(off_by(one) for one in exchanged)])
    spread = np.sqrt(np.mean(off * off, axis=0))
    off = off / np.where(spread > 0, spread, 1.0)
    order = np.argsort(-off[0])
    best = np.maximum.accumulate(off[1:, order[::-1]], axis=1)[:, ::-1]
    passed = (best >= off[0, order] * (1 - SAME)).sum(axis=0)
    ways = math.comb(groups, int(side.sum()))
    return _stepped_down(passed, order), max(1 / ways, 1 / (EXCHANGES + 1))


def _stepped_down(passed: Any, order: Int64[np.ndarray, " m"]) -> Vector:
    """p of each cell from how many exchanges came as far; no p below that of a cell before."""
    p = np.empty(len(order))
    p[order] = np.maximum.accumulate((1 + passed) / (EXCHANGES + 1))
    return p


def _detectable(
    rows: Labelled, tables: Int64[np.ndarray, "2 c c"], cells: Int64[np.ndarray, "m 2"],
    level: float,
) -> float:  # fmt: skip
    """Difference of the most frequent confusion that is told with `POWER`, by the bell curve."""
    if not len(cells):
        return np.nan
    i, j = max(cells.tolist(), key=lambda one: int(tables[:, one[0], one[1]].sum()))
    n = tables[:, i].sum(axis=1)
    share = tables[:, i, j].sum() / n.sum()
    if rows.group is not None:
        mine = rows.truth == i
        n = n / max(design_effect(rows.label[mine] == j, rows.group[mine]), 1.0)
    z = scipy.stats.norm.isf(level / (2 * len(cells))) + scipy.stats.norm.isf(1 - POWER)
    return float(z * np.sqrt(share * (1 - share) * (1 / n[0] + 1 / n[1])))
