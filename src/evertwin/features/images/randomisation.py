"""What the simulation should draw more widely: its settings against what reality shows.

Domain randomisation (Tobin et al., IROS 2017) draws what the simulation does not know, such as
light, noise or distance, anew each time. It is wide enough where the middle 95 % of what it drew
hold 95 % of what was measured: that is its stop rule, asked of each setting by the share of the
measured values inside. How much wider than reality it is beyond that is what it costs.

A confusion of which the sides differ comes at some settings more than at others. Which, is asked
within the simulated rows, by the ranks of the setting where it was taken for the label against the
other rows of the truth (Mann, Whitney), corrected by Holm; where rows hang together, by the rank
correlation over groups of the setting's mean with how often it was taken so (Spearman).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from evertwin.features.images.confusions import Cell, design_effect, wilson
from evertwin.features.images.labelled import Labelled
from evertwin.types import Bools, Float64, Int64, Vector

SHARE = 0.95
"""Of what is measured that a setting should hold, and of what was drawn that holds it."""
FEWEST = 20
"""Rows that a range can be told from."""


class Coverage(NamedTuple):
    """One setting, drawn and measured.

    >>> Coverage("light", 0.9, 0.8, 0.95, 1.2, (0.0, 1.0), (0.1, 1.2), "higher").wide
    True
    """

    setting: str
    share: float
    """Of the measured values inside the middle 95 % of what was drawn."""
    low: float
    """95 % interval."""
    high: float
    width: float
    """Middle 95 % of what was drawn, in widths of what was measured: above 1 is wider."""
    drawn: tuple[float, float]
    measured: tuple[float, float]
    toward: str
    """Where the measured values outside lie: ``lower``, ``higher``, ``both``; empty: none does."""

    @property
    def wide(self) -> bool:
        """Nothing says that it is too narrow."""
        return self.high >= SHARE


class Lead(NamedTuple):
    """A setting that a confusion comes with.

    >>> Lead("light", 0.1, 0.001).setting
    'light'
    """

    setting: str
    rank: float
    """Probability that a row with the confusion has the higher value."""
    p: float


def coverage(rows: Labelled) -> tuple[Coverage, ...]:
    """Each setting that both sides have."""
    found = []
    for name, values in (rows.settings or {}).items():
        known = np.isfinite(values)
        drawn, measured = values[known & rows.simulated], values[known & ~rows.simulated]
        if min(len(drawn), len(measured)) >= FEWEST:
            group = None if rows.group is None else rows.group[known & ~rows.simulated]
            found.append(_coverage(name, drawn, measured, group))
    return tuple(found)


def _coverage(
    name: str,
    drawn: Vector,
    measured: Float64[np.ndarray, " m"],
    group: Int64[np.ndarray, " m"] | None,
) -> Coverage:
    ends = (1 - SHARE) / 2, (1 + SHARE) / 2
    (a, b), (c, d) = (np.quantile(side, ends) for side in (drawn, measured))
    below, above = measured < a, measured > b
    inside = ~(below | above)
    share, independent = float(inside.mean()), float(len(measured))
    if group is not None and 0 < share < 1:
        independent /= max(design_effect(inside, group), 1.0)
    low, high = wilson(share, independent)
    toward = "both" if below.any() and above.any() else "lower" if below.any() else "higher"
    return Coverage(
        name, share, low, high, float((b - a) / (d - c)) if d > c else np.inf,
        (float(a), float(b)), (float(c), float(d)), toward if share < 1 else "",
    )  # fmt: skip


def leads(rows: Labelled, cells: Sequence[Cell], level: float) -> tuple[tuple[Lead, ...], ...]:
    """For each confusion the settings that it comes with, within the simulated rows."""
    tried: list[tuple[int, Lead]] = []
    for k, cell in enumerate(cells):
        mine = rows.simulated & (rows.truth == rows.classes.index(cell.truth))
        hit = rows.label == rows.classes.index(cell.label)
        for name, values in (rows.settings or {}).items():
            known = mine & np.isfinite(values)
            one, other = values[known & hit], values[known & ~hit]
            if len(one) and len(other) and np.ptp(values[known]) > 0:
                test = scipy.stats.mannwhitneyu(one, other)
                rank, p = float(test.statistic) / (len(one) * len(other)), float(test.pvalue)
                if rows.group is not None:
                    p = _over_groups(rows.group[known], values[known], hit[known])
                tried.append((k, Lead(name, rank, p)))
    tried.sort(key=lambda one: one[1].p)
    found: list[list[Lead]] = [[] for _ in cells]
    for place, (k, lead) in enumerate(tried):
        p = lead.p * (len(tried) - place)
        if p > level:
            break
        found[k].append(lead._replace(p=p))
    return tuple(tuple(sorted(one, key=lambda lead: -abs(lead.rank - 0.5))) for one in found)


def _over_groups(group: Int64[np.ndarray, " n"], values: Vector, hit: Bools) -> float:
    """p of no relation between a setting and hits, each group counting once."""
    _, number = np.unique(group, return_inverse=True)
    n = np.bincount(number)
    means = np.bincount(number, values) / n
    if len(n) < FEWEST or not np.ptp(means) > 0:
        return 1.0
    p = float(scipy.stats.spearmanr(means, np.bincount(number, hit) / n).pvalue)
    return p if np.isfinite(p) else 1.0
