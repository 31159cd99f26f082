"""A model that runs away from its machine tells no number, however narrow its interval."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evertwin.fold import make_block
from evertwin.models import Parameters
from evertwin.models.translated import Translated
from evertwin.signals import Layout
from evertwin.tuning import Fit, Problem, solve

STEP, ROWS = 0.02, 300


def pole(x: Any, u: Any, dt: float, p: Any) -> Any:
    """Falls faster the further it leans; what is measured is held upright by somebody."""
    ahead = x[0] + dt * (p[0] * x[0] + p[1] * u[0])
    return [ahead], [ahead]


LEAN = Layout.of(lean="1")
NUMBERS = Parameters.of(k=(4.0, "1/s"), b=(1.0, "1/s"))
MODEL = Translated(pole, Layout.of(push="1"), LEAN, LEAN, NUMBERS)


def fitted(horizon: float) -> Fit:
    """By a push that balances it, on what was measured with a little noise."""
    rng = np.random.default_rng(0)
    x, u, y = 0.1, np.zeros(ROWS), np.zeros(ROWS)
    for i in range(ROWS):
        u[i] = -8.0 * y[i - 1] + rng.normal(0.0, 0.3)
        x += STEP * (5.0 * x + 1.2 * u[i])
        y[i] = x + rng.normal(0.0, 0.002)
    block = make_block(np.round(1e9 * STEP * np.arange(ROWS)), u[:, None], y[:, None])
    return solve(Problem(MODEL, (block,), horizon=horizon))


@pytest.mark.parametrize("horizon", [np.inf, 0.2])
def test_numbers_are_told_only_where_the_model_follows(horizon: float) -> None:
    fit = fitted(horizon)
    if np.isinf(horizon):
        assert "identifiable" not in fit.verdict and "goes astray" in fit.message, str(fit)
    else:
        assert fit.verdict == ("identifiable", "identifiable"), str(fit)
        assert fit.p == pytest.approx([5.0, 1.2], rel=0.2)
