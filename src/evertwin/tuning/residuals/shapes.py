"""How a coefficient may change with an input: the shapes that a wrong form is asked by.

No shape is a law of its own. Together they span what one input can do to a coefficient: more or
less by the size of the input, another value on its other side, ups and downs along its range.

>>> u = np.linspace(-1.0, 1.0, 5)
>>> kinds, values = shapes(u)
>>> values.shape == (5, len(kinds)), values[:, kinds.index("side")].tolist()
(True, [-1.0, -1.0, 0.0, 1.0, 1.0])
"""

from __future__ import annotations

import numpy as np

from evertwin.types import Float64, Vector

FADING = (0.03, 0.06, 0.12, 0.25, 0.5)
"""Parts of the largest input over which an effect of small ones fades."""
TURNS = (1, 2, 3, 4, 6, 8, 12, 16)
"""Half ups and downs along the range."""
MOST = 0.99
"""Quantile of the size that counts as the largest."""
KINDS = (
    *("size",) * (3 + len(FADING)), "side", "side", *("place",) * (2 * len(TURNS)),
)  # fmt: skip
"""Of each shape: what it is like; those of one kind can stand for each other."""


def shapes(u: Vector) -> tuple[tuple[str, ...], Float64[np.ndarray, "n s"]]:
    """(kind of each shape, its values) at an input (n,); no shape of what does not change."""
    size = np.sort(np.abs(u))
    whole = float(np.interp(MOST * (len(u) - 1), np.arange(len(u)), size)) or float(size[-1])
    low, high = float(u.min()), float(u.max())
    if not high - low > 1e-9 * whole:
        return (), np.empty((len(u), 0))
    s = np.clip(u / whole, -1.0, 1.0)
    z = np.abs(s)
    turned = {1: np.exp(1j * np.pi * (u - low) / (high - low))}
    columns = [np.sqrt(z), z, z * z, *(np.exp(-z / part) for part in FADING), np.sign(s), s]
    for turns in TURNS:
        if turns not in turned:  # a product is cheaper than a cosine
            turned[turns] = turned[turns // 2] * turned[turns - turns // 2]
        columns += [turned[turns].real, turned[turns].imag]
    return KINDS, np.stack(columns, axis=1)
