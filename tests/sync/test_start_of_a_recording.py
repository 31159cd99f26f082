"""What a model does wrong from its start on is no noise of the sensor, and no factor."""

from __future__ import annotations

import numpy as np

from evertwin import FunctionModel, Layout
from evertwin.fold import Event, make_block
from evertwin.models import Parameters
from evertwin.sync import Arbiter, Rule, Track

ROWS = 400


def tanks(x: list[float], u: list[float], dt: float, p: list[float]) -> tuple[list[float], ...]:
    upper = x[0] + dt * (p[0] * u[0] - 0.02 * x[0])
    lower = x[1] + dt * (0.02 * x[0] - 0.02 * x[1])
    return [upper, lower], [lower]


def recorded(seed: int, factor: float) -> list[np.ndarray]:
    """Two recordings: the second's upper level begins elsewhere, or what is measured of it is
    ``factor`` times as large from its first row on."""
    rng, found = np.random.default_rng(seed), list[np.ndarray]()
    for start in (0.1, 0.1 if factor != 1.0 else rng.uniform(0.3, 0.5)):
        x, u = [start, 0.1], np.repeat(rng.uniform(0.0, 1.0, ROWS // 40), 40)
        levels = []
        for k in range(ROWS):
            x, _ = tanks(x, [u[k]], 1.0, [0.01])
            levels.append(x[1])
        found += [u, np.array(levels) + rng.normal(0.0, 0.002, ROWS)]
    found[3] *= factor
    return found


def told(seed: int, factor: float, inflow: float) -> list[float]:
    """Factors that the arbiter names, with a model that takes so much for the ``inflow``."""
    model = FunctionModel(
        tanks, Layout.of(u="1"), Layout.of(y="m"), Layout.of(upper="m", y="m"),
        Parameters.of(inflow=(inflow, "m/s")), (0.1, 0.1),
    )  # fmt: skip
    stage = Track(model, Arbiter(Rule(use="blend")))
    u0, y0, u1, y1 = recorded(seed, factor)
    rows = make_block(
        t=np.arange(2 * ROWS) * 10**9, u=np.concatenate([u0, u1])[:, None],
        y=np.concatenate([y0, y1])[:, None], task=np.repeat([0, 1], ROWS),
    )  # fmt: skip
    events = [e for e in stage.step(stage.init(), rows)[1].records if isinstance(e, Event)]
    return [
        float(str(e.evidence["factor"]))
        for e in events
        if e.kind == "measurement_error" and e.evidence["cause"] == "factor"
    ]


def test_a_hidden_state_that_starts_elsewhere_is_no_factor() -> None:
    assert [told(seed, 1.0, inflow) for seed in range(20) for inflow in (0.003, 0.01)] == [[]] * 40


def test_a_factor_from_the_first_row_on_is_told() -> None:
    assert all(told(seed, 1000.0, 0.01)[:1] == [1000.0] for seed in range(5))
