"""Is it a machine that goes on changing, or a form that is wrong and driven otherwise each time?"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.fold import Windows, make_block
from evertwin.models import FunctionModel, Parameters
from evertwin.models.functions.translated import translated
from evertwin.refit.rows.newest import newest
from evertwin.signals import Layout
from evertwin.tuning import Fit, Problem, solve

ROWS, SEEDS = 480, 30


def line(x: Any, u: Any, dt: float, p: Any) -> Any:
    return x, [p[0] * u[0]]


LINE = translated(FunctionModel(
    line, Layout.of(u="V"), Layout.of(y="N"), parameters=Parameters.of(k=(1.0, "N/V")),
))  # fmt: skip


def posed(rows: Windows) -> Problem:
    return Problem(LINE, rows, ("k",))


def tuned(problem: Problem) -> tuple[Problem, Fit, dict[str, Any]]:
    return problem, solve(problem), {}


def goes_on(seed: int, *, changes: bool) -> bool:
    """Are rows left out, of a gain that grows, or of a cube driven harder or less from time to
    time?"""
    rng, at = np.random.default_rng(seed), np.arange(ROWS)
    hard = 1.0 if changes else np.repeat(rng.uniform(0.4, 1.4, 12), ROWS // 12)
    u = hard * rng.normal(0.0, 1.0, ROWS)
    y = (1.0 + 3.0 * at / ROWS) * u if changes else u**3
    y = y + rng.normal(0.0, 0.02, ROWS)
    rows = (make_block(t=at, u=u[:, None], y=y[:, None]),)
    problem = posed(rows)
    return newest(problem, solve(problem), posed, tuned)[0] is not problem


def test_a_machine_that_goes_on_changing_is_known_by_its_newest_rows() -> None:
    assert all(goes_on(seed, changes=True) for seed in range(SEEDS))


def test_a_wrong_form_that_is_driven_otherwise_is_no_machine_that_goes_on_changing() -> None:
    assert sum(goes_on(seed, changes=False) for seed in range(SEEDS)) <= SEEDS // 10
