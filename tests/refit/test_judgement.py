"""What tuning leaves beyond the requirement is not normal, however much it explains."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.config.spec import AnomalySpec, ModelSpec, PredictionSpec, TwinSpec
from evertwin.twin import Twin


def cart(seed: int, dead: float, cap: float, gain: float) -> dict[str, np.ndarray]:
    """Commands in steps; below ``dead`` [m/s] it stands, above ``cap`` it goes no faster."""
    rng, n = np.random.default_rng(seed), 900
    v = np.repeat(rng.uniform(0.02, 0.35, 60) * rng.choice([-1, 1], 60), 15)[:n]
    goes = gain * np.sign(v) * np.clip(np.abs(v) - dead, 0.0, cap)
    x = np.r_[0.0, np.cumsum(0.05 * goes)[:-1]] + rng.normal(0.0, 4e-4, n)
    return {"t": 0.05 * np.arange(n), "v": v, "x": x}


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("dead", "cap", "gain"), [(0.05, 0.2, 1.0), (0.03, 0.25, 0.9), (0.0, 9.0, 0.8)]
)
def test_what_is_still_off_is_not_normal(seed: int, dead: float, cap: float, gain: float) -> None:
    spec = TwinSpec(
        "cart", ModelSpec("robot1d"), prediction=PredictionSpec(horizon=1.0),
        anomaly=AnomalySpec(requirement=0.006, relative=False),
    )  # fmt: skip
    with Twin(spec) as twin:
        events = twin.run(cart(seed, dead, cap, gain)).events
    said = [event for event in events if event.kind in ("normal", "abnormal")]
    assert said and {e.kind for e in said} == {"abnormal" if dead else "normal"}
    assert all("still off" not in e.reason for e in said if e.kind == "normal")
