"""A limit from few calm residuals keeps the false alarms that are allowed, as from many."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.anomaly import Calm, Residuals
from evertwin.anomaly.calibration import calibrate, innovations
from evertwin.anomaly.run_length import MONTH, alarms

INTERVAL = 50.0
SAMPLES = int(MONTH / INTERVAL)


def white(rng: np.random.Generator, n: int) -> np.ndarray:
    return rng.normal(size=n)


def outlying(rng: np.random.Generator, n: int) -> np.ndarray:
    return rng.standard_t(4, size=n)


def cyclic(rng: np.random.Generator, n: int) -> np.ndarray:
    phase = rng.uniform(0.0, 2.0 * np.pi)
    return rng.normal(size=n) + 0.7 * np.sin(2.0 * np.pi * np.arange(n) / 100.0 + phase)


@pytest.mark.parametrize("residual", [white, outlying, cyclic])
def test_a_month_has_no_more_false_alarms_than_are_allowed(residual: object) -> None:
    calm = Calm(least=300, independent=100.0, clip=4.0)
    counted = []
    for seed in range(60):
        rng = np.random.default_rng([seed, 3])
        r = residual(rng, 300 + SAMPLES)  # type: ignore[operator]
        known, reason = calibrate(Residuals.of(r[:300, None], INTERVAL), calm)
        if reason:
            continue
        z = (r[300:] - known.mean[-1, 0]) / known.scale[-1, 0]
        e = np.clip(innovations(z, known.ar[0]) / known.sigma[0], -calm.clip, calm.clip)
        count = np.zeros(1, dtype=np.int64)
        alarms(e, 0.5 * calm.shift, known.limit[:1].copy(), count)
        counted.append(int(count[0]))
    assert len(counted) >= 20 and np.mean(counted) <= 1.0, counted
