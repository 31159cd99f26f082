"""What a fit says of its numbers where the problem near it denies them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evertwin.fold import make_block
from evertwin.machines.drive import DriveForce
from evertwin.tuning import Fit, Problem, solve
from evertwin.tuning.intervals.fit import Amend
from evertwin.tuning.tangent import leaning, searched, told

INSIDE = (("width",),)


def solved(seed: int) -> tuple[Problem, Fit, Fit]:
    """An axis with dry and viscous friction: the problem, its fit, and that of the one near it."""
    rng, t = np.random.default_rng(seed), np.arange(4000) * 0.01
    v = np.sin(rng.uniform(0.5, 1.0) * t) * np.sin(0.13 * t)
    y = np.tanh(v / 0.02) * 5.0 + 2.0 * v + rng.normal(0.0, 0.2, 4000)
    rows = make_block(t=(t * 1e9).astype(np.int64), u=np.stack([v, 0.0 * v], axis=1), y=y[:, None])
    problem = searched(Problem(DriveForce("tanh"), (rows,), ("Fv", "Fc", "offset")), INSIDE)
    fit = solve(problem)
    return problem, fit, solve(leaning(problem, problem.full(fit.values), INSIDE))


@pytest.mark.parametrize("seed", [1, 2])
def test_a_number_that_both_tell_is_told(seed: int) -> None:
    problem, fit, near = solved(seed)
    both = told(fit, near, problem.parameters)
    assert both.verdict[both.names.index("Fc")] == "identifiable"
    assert both.interval("Fc")[0] < 5.0 < both.interval("Fc")[1]


@pytest.mark.parametrize("seed", [1, 2])
def test_a_number_that_the_other_denies_is_weak(seed: int) -> None:
    problem, fit, near = solved(seed)
    k = fit.names.index("Fv")
    other = replace(fit, values=np.where(np.arange(len(fit.names)) == k, 12.0, fit.values))
    both = told(other, near, problem.parameters)
    assert both.verdict[k] == "weak" and "may move too it is" in both.reasons[k]
    assert both.interval("Fv")[0] < 2.0 < 12.0 <= both.interval("Fv")[1]


@pytest.mark.parametrize("seed", [1, 2])
def test_a_number_that_stays_as_it_was_is_not_told_by_the_other(seed: int) -> None:
    problem, fit, near = solved(seed)
    k = fit.names.index("Fc")
    held = replace(fit, values=np.where(np.arange(len(fit.names)) == k, 0.0, fit.values))
    both = told(held.amended({k: Amend(None, "not", ("as it was",))}), near, problem.parameters)
    assert both.verdict[k] == "not" and np.isinf(both.interval95[k]).all()
