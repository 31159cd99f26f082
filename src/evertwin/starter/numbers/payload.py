"""Which numbers of what an arm carries act on its motors at all.

>>> from evertwin.machines.arm import Arm
>>> acting(Arm.of("ur5_like", payload=True))
('m', 'mx', 'my', 'mz')
"""

from __future__ import annotations

import numpy as np

from evertwin.models import Model
from evertwin.models.batch import mapped

NUMBERS = ("m", "mx", "my", "mz")
ROWS = 32
"""Postures and motions that are tried: an effect that is in none of them is in no recording."""


def acting(model: Model) -> tuple[str, ...]:
    """Those of `NUMBERS` that change an output: a moment along an axis that stays upright, as of a
    SCARA's slide, changes none."""
    p = model.parameters.values
    u = np.random.default_rng(0).uniform(-1.0, 1.0, (ROWS, len(model.inputs)))
    dt, effect = np.ones(ROWS), dict[str, np.ndarray]()
    for name in NUMBERS:
        changed = p.copy()
        changed[model.parameters.names.index(f"payload.{name}")] += 1.0
        effect[name] = mapped(model, u, dt, changed) - mapped(model, u, dt, p)
    most = max(float(np.abs(one).max()) for one in effect.values())
    return tuple(name for name, one in effect.items() if np.abs(one).max() > 1e-9 * most)
