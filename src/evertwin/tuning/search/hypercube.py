"""Points that are spread over a cube, one in each layer of each side (a Latin hypercube).

The same points as `scipy.stats.qmc.LatinHypercube` gives; to load SciPy's statistics takes longer
than most short fits.

>>> from scipy.stats.qmc import LatinHypercube
>>> own = layered(np.random.default_rng(3), 8, 2)
>>> bool((own == LatinHypercube(2, seed=3).random(8)).all())
True
"""

from __future__ import annotations

import numpy as np

from evertwin.types import Float64


def layered(rng: np.random.Generator, count: int, sides: int) -> Float64[np.ndarray, "count sides"]:
    """So many points of the unit cube, (count, sides)."""
    within = rng.uniform(size=(count, sides))
    layers = [rng.permutation(count) for _ in range(sides)]
    return np.asarray((np.stack(layers, axis=1) + 1 - within) / count)
