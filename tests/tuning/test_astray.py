"""A model that runs away from its machine tells no number, however narrow its interval."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evertwin.fold import make_block
from evertwin.models import Parameters
from evertwin.models.functions.translated import Translated
from evertwin.signals import Layout
from evertwin.tuning import Fit, Problem, solve

STEP, ROWS = 0.02, 300


def pole(x: Any, u: Any, dt: float, p: Any) -> Any:
    """Falls faster the further it leans; what is measured is held upright by somebody."""
    ahead = x[0] + dt * (p[0] * x[0] + p[1] * u[0])
    return [ahead], [ahead]


LEAN = Layout.of(lean="1")


def fitted(horizon: float, k: float = 4.0) -> Fit:
    """From ``k`` on. By a push that balances it, on what was measured with a little noise."""
    rng = np.random.default_rng(0)
    x, u, y = 0.1, np.zeros(ROWS), np.zeros(ROWS)
    for i in range(ROWS):
        u[i] = -8.0 * y[i - 1] + rng.normal(0.0, 0.3)
        x += STEP * (5.0 * x + 1.2 * u[i])
        y[i] = x + rng.normal(0.0, 0.002)
    block = make_block(np.round(1e9 * STEP * np.arange(ROWS)), u[:, None], y[:, None])
    numbers = Parameters.of(k=(k, "1/s"), b=(1.0, "1/s"))
    model = Translated(pole, Layout.of(push="1"), LEAN, LEAN, numbers)
    return solve(Problem(model, (block,), horizon=horizon))


def test_numbers_are_told_where_the_model_follows() -> None:
    fit = fitted(0.2)
    assert fit.verdict == ("identifiable", "identifiable"), str(fit)
    assert fit.p == pytest.approx([5.0, 1.2], rel=0.2)


@pytest.mark.parametrize("k", [4.0, 6.0, 8.0])
def test_none_is_told_where_a_free_run_follows_by_chance_or_not_at_all(k: float) -> None:
    fit = fitted(np.inf, k)
    assert "identifiable" not in fit.verdict, str(fit)
    follows = fit.residuals[0].rms_after < 0.05
    assert follows or "goes astray" in fit.message or "runs away" in fit.message, str(fit)


def test_what_goes_astray_is_said() -> None:
    assert "goes astray" in fitted(np.inf, 6.0).message
