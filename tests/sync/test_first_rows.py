"""A sample that is wrong before anything is known of a sensor tells nothing of its noise."""

from __future__ import annotations

import numpy as np

from evertwin import Twin, TwinSpec
from evertwin.config.spec import AnomalySpec, ModelSpec, PredictionSpec
from planted.draws import first_of

CART = TwinSpec(
    "cart", ModelSpec("robot1d"), prediction=PredictionSpec(horizon=1.0),
    anomaly=AnomalySpec(requirement=0.01, relative=False),
)  # fmt: skip


@first_of("row", [1, 2, 3, 4])
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


@first_of("rows", [1, 5, 20])
def test_zeros_before_a_sensor_answers_are_no_pose(rows: int) -> None:
    """They were taken in another unit, or held against the machine by every fit."""
    fits, spec = 0, TwinSpec(
        "base", ModelSpec("differential"), prediction=PredictionSpec(horizon=1.0),
        anomaly=AnomalySpec(requirement=0.02, relative=False, outputs=("x", "y")),
    )  # fmt: skip
    for seed in range(8):
        rng, n, dt = np.random.default_rng(seed), 2000, 0.05
        v, w = (np.repeat(rng.uniform(a, 0.8, n // 40), 40) for a in (-0.3, -0.8))
        heading = rng.uniform(-3.0, 3.0) + 0.94 * dt * np.concatenate([[0.0], np.cumsum(w)[:-1]])
        x, y = (
            rng.uniform(2.0, 12.0) + 0.9 * dt * np.concatenate([[0.0], np.cumsum(v * way)[:-1]])
            for way in (np.cos(heading), np.sin(heading))
        )
        pose = np.stack([x, y, heading]) + rng.normal(0.0, 0.003, (3, n))
        pose[:, :rows] = 0.0
        data = {"t": dt * np.arange(n), "v": v, "w": w, "x": pose[0], "y": pose[1]}
        with Twin(spec) as twin:
            result = twin.run(data | {"heading": pose[2]})
            assert not result.of_kind("measurement_error", "gate_widened")
            fits += twin.champion.number > 0
    assert fits >= 7
