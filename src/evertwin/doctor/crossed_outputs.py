"""Two outputs of a static map in each other's column, as crossed cables or headings make them.

Whatever numbers a map has, they are tuned to the columns first; two that fit nothing are tuned
again in each other's place.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from evertwin.doctor.check_numbers import changed, tuned
from evertwin.doctor.examination import View
from evertwin.doctor.finding import Finding
from evertwin.fold import Block

MISSED = 0.3
"""Mismatch of an output, once numbers are tuned, from which its column is doubted."""
BETTER = 0.5
"""Share of it at most that is left of either output in the other's place."""
PAIRS = 6
"""Pairs that are tried, those that miss most first."""


def look_crossed(view: View, window: Block) -> Iterator[Finding]:
    """The pair of outputs that fits in each other's column."""
    outputs = view.model.outputs
    if not view.setup.static or len(outputs) < 2:
        return
    missed = changed(view, tuned(view, lambda one: one), window).mismatch
    doubted = [k for k in np.argsort(-missed).tolist() if missed[k] > MISSED]
    pairs = [(a, b) for a, b in combinations(doubted, 2) if outputs.units[a] == outputs.units[b]]
    found = list[tuple[float, int, int, np.ndarray]]()
    for a, b in pairs[:PAIRS]:

        def swapped(one: Block, a: int = a, b: int = b) -> Block:
            y = one.y.copy()
            y[:, [a, b]] = one.y[:, [b, a]]
            return one._replace(y=y)

        after = changed(view, tuned(view, swapped), swapped(window)).mismatch
        if (after[[a, b]] <= BETTER * missed[[a, b]]).all():
            found.append((float(after[[a, b]].sum()), a, b, after))
    if not found:
        return
    _, a, b, after = min(found, key=lambda one: one[0])
    pair = sorted((a, b))
    names = [outputs.names[k] for k in pair]
    shown = ", ".join(f"{outputs.names[k]} {missed[k]:.2f} -> {after[k]:.2f}" for k in pair)
    yield Finding(
        "exchanged", names[0],
        f"{names[0]} and {names[1]} look exchanged: so they fit the model, once tuned: mismatch "
        f"{shown}", "[source.channels]",
        f"exchange the columns of {names[0]} and {names[1]}, if that is confirmed",
        {"hypotheses": [names], "before": missed, "after": after},
    )  # fmt: skip
