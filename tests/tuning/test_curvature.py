"""A number that predictions bend with within its interval has none, and is not identifiable."""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin import FunctionModel, Layout, Parameters, Twin, TwinSpec
from evertwin.config import spec
from evertwin.tuning.intervals.curvature import WHY
from planted.draws import first_of

PLACE, STATES = Layout.of(z="m"), Layout.of(z="m", v="m/s")


def ball(x: Any, u: Any, dt: float, p: Any) -> Any:
    """On a plate that shakes: all numbers together times anything are the same ball."""
    z, v = x
    for _ in range(20):
        force = -p[0] * min(z - u[0], 0.0) - (p[1] * v if z < u[0] else 0.0)
        v += dt / 20 * (force / p[2] - 9.81)
        z += dt / 20 * v
    return [z, v], [z]


def fitted(seed: int, n: int, noise: float, shaken: float) -> Any:
    rng = np.random.default_rng(seed)
    true = np.array([3000.0, 4.0, 1.0]) * np.exp(rng.uniform(-0.5, 0.5, 3))
    start = true * 3.0 ** rng.choice([-1, 1], 3)
    parameters = Parameters.of(**{k: (v, "1") for k, v in zip("kcm", start.tolist(), strict=True)})
    model = FunctionModel(ball, Layout.of(plate="m"), PLACE, STATES, parameters)
    t = 0.01 * np.arange(n)
    plate = shaken * np.sin(2.0 * np.pi * rng.uniform(2.0, 5.0) * t)
    x, z = [0.2, 0.0], np.empty(n)
    for i, u in enumerate(plate):
        z[i] = x[0]
        x = ball(x, [u], 0.01, true)[0]
    z += noise * z.std() * rng.normal(size=n)
    twin = Twin(TwinSpec("ball", spec.ModelSpec("python")), model)
    return twin.fit({"t": t, "plate": plate, "z": z}).fit


@first_of("seed", range(4))
def test_a_ball_that_bounces_a_hundred_times_tells_no_number(seed: int) -> None:
    fit = fitted(seed, 1000, 0.01, 0.03)
    assert not {"k", "c", "m"} & set(fit.identifiable), str(fit)


def test_what_has_no_interval_says_why() -> None:
    fit = fitted(0, 1000, 0.01, 0.03)
    told = dict(zip(fit.names, zip(fit.reasons, fit.interval95.tolist(), strict=True), strict=True))
    bent = [interval for reason, interval in told.values() if WHY in reason]
    assert bent and all(interval == [-np.inf, np.inf] for interval in bent)
