"""Two outputs of a static map in each other's column, as crossed cables or headings make them.

Whatever numbers a map has, they are tuned to the columns first; two that miss are tuned again in
each other's place.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import numpy as np

from evertwin.doctor.check_numbers import changed, tuned
from evertwin.doctor.examination import View
from evertwin.doctor.finding import Finding
from evertwin.fold import Block
from evertwin.rows.channels import size_recorded

MISSED = 0.1
"""Mismatch of an output, once numbers are tuned, from which its column is doubted."""
BETTER = 0.5
"""Share of it at most that is left of either output in the other's place."""
PAIRS = 6
"""Pairs that are tried, those that miss most first."""


class _Swap(NamedTuple):
    """Two outputs, and what each is times the other's."""

    pair: tuple[int, int]
    factor: float
    """Of the first from the second; the second is by its inverse. 1: values change places."""
    kept: bool
    """Does each channel keep its unit and scale?"""

    def of(self, one: Block) -> Block:
        """The rows, read so."""
        y, (a, b) = one.y.copy(), self.pair
        y[:, a], y[:, b] = one.y[:, b] * self.factor, one.y[:, a] / self.factor
        return one._replace(y=y)


def look_crossed(view: View, window: Block) -> Iterator[Finding]:
    """The pair of outputs that fits in each other's column."""
    outputs = view.model.outputs
    if not view.setup.static or len(outputs) < 2:
        return
    missed = changed(view, tuned(view, lambda one: one), window).mismatch
    doubted = [k for k in np.argsort(-missed).tolist() if missed[k] > MISSED]
    pairs = [(a, b) for a, b in combinations(doubted, 2) if outputs.units[a] == outputs.units[b]]
    found = list[tuple[float, _Swap, np.ndarray]]()
    for swap in (swap for pair in pairs[:PAIRS] for swap in _swaps(view, pair)):
        pair = list(swap.pair)
        after = changed(view, tuned(view, swap.of), swap.of(window)).mismatch
        if (after[pair] <= BETTER * missed[pair]).all():
            found.append((float(after[pair].sum()), swap, after))
    if not found:
        return
    _, best, after = min(found, key=lambda one: one[0])
    pair = sorted(best.pair)
    names = [outputs.names[k] for k in pair]
    shown = ", ".join(f"{outputs.names[k]} {missed[k]:.2f} -> {after[k]:.2f}" for k in pair)
    what = "columns" if best.kept else "columns, with their units and scales,"
    yield Finding(
        "exchanged", names[0],
        f"{names[0]} and {names[1]} look exchanged: so they fit the model, once tuned: mismatch "
        f"{shown}", "[source.channels]",
        f"exchange the {what} of {names[0]} and {names[1]}, if that is confirmed",
        {"hypotheses": [names], "before": missed, "after": after},
    )  # fmt: skip


def _swaps(view: View, pair: tuple[int, int]) -> Iterator[_Swap]:
    """Columns in each other's place, each read as the other was; and values that somebody else has
    converted before, where units or scales are unlike."""
    sizes = [size_recorded(view.setup.spec, view.model.outputs.names[k]) for k in pair]
    yield _Swap(pair, sizes[0] / sizes[1], True)
    if sizes[0] != sizes[1]:
        yield _Swap(pair, 1.0, False)
