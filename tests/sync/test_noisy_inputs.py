"""A force by a speed that scatters about the limit of motion: what flickers is no motion."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.fold import fold, make_block
from evertwin.models import FunctionModel
from evertwin.signals import Layout
from evertwin.sync import Arbiter, Rule, Track

ROWS, AT = 1400, 1000


def told(seed: int, scale: float, *, frozen: bool) -> list[int]:
    """Rows at which a force of a hoist that drives and stands in turn is called frozen."""
    rng = np.random.default_rng([seed, 5])
    v = np.repeat(rng.normal(0.0, 1.0, ROWS // 50), 50)
    v[(np.arange(ROWS) % 300 > 100) & (np.arange(ROWS) < AT)] = 0.0
    y = scale * (10.0 + v + 0.3 * np.sign(v) + rng.normal(0.0, 0.03, ROWS))
    if frozen:
        y[AT:] = y[AT] + scale * rng.normal(0.0, 0.005, ROWS - AT)
    u = v + rng.normal(0.0, 0.01, ROWS)  # by a place that scatters
    model = FunctionModel(
        lambda x, u, dt, p: ([], [scale * (10.0 + u[0] + 0.3 * np.sign(u[0]))]),
        Layout.of(u="m/s"), Layout.of(y="N"), Layout(),
    )  # fmt: skip
    block = make_block(np.arange(ROWS) * 2 * 10**7, u[:, None], y[:, None])
    _, out = fold(Track(model, Arbiter(Rule(use="blend")), ((0, 0, 0.01),)), [block])
    return [r.row for r in out.records if r.evidence.get("cause") in ("frozen", "end")]


@pytest.mark.parametrize("scale", [0.5, 40.0])
def test_a_machine_that_stands_is_not_frozen_where_its_speed_scatters(scale: float) -> None:
    assert [seed for seed in range(3) if told(seed, scale, frozen=False)] == []


def test_what_answers_no_motion_is_frozen_all_the_same() -> None:
    found = [told(seed, 1.0, frozen=True) for seed in range(3)]
    assert sum(bool(rows) and rows[0] >= AT for rows in found) == 3, found
