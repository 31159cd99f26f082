"""Where a base starts anew, elsewhere and looking anywhere, its sensor is not off by a factor."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin import Twin
from evertwin.config.spec import ClockSpec
from planted.twins import shipped


@pytest.mark.parametrize("heading", [-1.26, 1.26])
def test_behind_a_gap_a_base_may_look_anywhere(heading: float) -> None:
    """Of what it goes, x is as much as its heading says: a third, as feet would make it."""
    rng = np.random.default_rng(1)
    n, dt, anew = 500, 0.5, 400
    v = np.repeat(rng.choice([0.05, 0.1, 0.15], n // 10), 10)
    w = np.repeat(rng.uniform(-0.3, 0.3, n // 10), 10)
    v[anew : anew + 40], w[anew : anew + 40] = 0.05, 0.0
    turn = np.concatenate([[0.0], np.cumsum(w[:-1] * dt)])
    turn[anew:] += heading - turn[anew]
    middle = turn[:-1] + 0.5 * w[:-1] * dt
    steps = v[:-1] * dt * np.array([np.cos(middle), np.sin(middle)])
    x, y = (np.concatenate([[0.0], np.cumsum(one)]) for one in steps)
    t = np.arange(n) * dt + 60.0 * (np.arange(n) >= anew)
    x[anew:], y[anew:] = x[anew:] - x[anew] + 3.0, y[anew:] - y[anew] + 3.0
    noise = rng.normal(0.0, 0.003, (2, n))
    columns = {"t": t, "v": v, "w": w, "x": x + noise[0], "y": y + noise[1],
               "heading": turn + rng.normal(0.0, 0.0005, n)}  # fmt: skip
    with Twin(shipped("robot_live", clock=ClockSpec(gap=5.0))) as twin:
        result = twin.run(columns)
    assert not [e for e in result.events if e.kind in ("measurement_error", "overruled")]
    residual = result.trace["residual"][anew:, :2]
    assert np.nanmax(np.abs(residual)) < 0.05
