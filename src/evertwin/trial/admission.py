"""Admission: what a candidate must show before it may run in shadow at all.

Its parameters are finite and inside their bounds, and repeated fits of it scatter no more than
their own intervals say: a fit whose interval is too narrow would promise what it cannot keep.

>>> good = np.array([[1.00], [1.02], [0.99]])
>>> admit(good[0], np.array([0.5]), np.array([1.5]), good, np.array([0.03]))[1].passed
True
>>> [check.name for check in admit(np.array([1.6]), np.array([0.5]), np.array([1.5])) if
...     not check.passed]
['bounds']
"""

from __future__ import annotations

import numpy as np

from evertwin.trial.gate import Check
from evertwin.types import Float64, ParameterVector

SPREAD = 3.0
"""Standard deviations of its own that a repeated fit may lie from the candidate."""


def admit(
    p: ParameterVector,
    low: ParameterVector,
    high: ParameterVector,
    repeats: Float64[np.ndarray, "repeats np"] | None = None,
    sigma: ParameterVector | None = None,
) -> tuple[Check, ...]:
    """The checks ``bounds`` and, if there are repeated fits, ``spread``.

    Args:
        p: the candidate's parameters, (np,).
        low: lower bounds, (np,).
        high: upper bounds, (np,).
        repeats: parameters of fits repeated on other data, (repeats, np).
        sigma: standard deviation of one fit, (np,); infinite where not identifiable.
    """
    outside = int(np.count_nonzero(~((p >= low) & (p <= high) & np.isfinite(p))))
    checks = [Check("bounds", outside == 0, float(outside), 0.0)]
    if repeats is not None and sigma is not None and len(repeats):
        known = np.isfinite(sigma) & (sigma > 0)
        distance = np.abs(repeats - p)[:, known] / sigma[known]
        worst = float(np.max(distance, initial=0.0))
        checks.append(Check("spread", worst <= SPREAD, worst, SPREAD))
    return tuple(checks)
