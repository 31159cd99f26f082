"""A sample that is wrong before anything is known of a sensor tells nothing of its noise."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config.spec import AnomalySpec, ModelSpec, PredictionSpec

CART = TwinSpec(
    "cart", ModelSpec("robot1d"), prediction=PredictionSpec(horizon=1.0),
    anomaly=AnomalySpec(requirement=0.01, relative=False),
)  # fmt: skip


@pytest.mark.parametrize("row", [1, 2, 3, 4])
def test_one_wrong_sample_among_the_first_blinds_nobody(row: int) -> None:
    left_out = []
    for seed in range(25):
        rng, n = np.random.default_rng(seed), 1500
        v = np.repeat(rng.uniform(-0.3, 0.3, n // 25), 25)
        x = np.concatenate([[0.0], np.cumsum(0.1 * v)[:-1]])
        x += 10.0 ** rng.uniform(-4, -2.5) * rng.normal(size=n)
        x[row] += rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(0, 2)
        with Twin(CART) as twin:
            found = twin.run({"t": 0.1 * np.arange(n), "v": v, "x": x}).of_kind("measurement_error")
        left_out += [event for event in found if event.evidence.get("cause") == "frozen"]
    assert not left_out
