"""A number that was tuned alone holds what it would be with its companions, as few rows tell."""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.config.spec import AnomalySpec, ModelSpec, TwinSpec
from evertwin.fold import make_block
from evertwin.models import FunctionModel, Parameters
from evertwin.refit.numbers.companions import beside
from evertwin.refit.numbers.fewest import fewest
from evertwin.setup.setup import Setup
from evertwin.signals import Layout
from evertwin.tuning import Fit, Problem, solve

SEEDS = range(21)
DRY, VISCOUS = 45.0, 125.0
AXIS = FunctionModel(
    lambda x, u, dt, p: ([], [p[0] * np.sign(u[0]) + p[1] * u[0]]),
    Layout.of(speed="m/s"), Layout.of(force="N"),
    parameters=Parameters.of(Fc=(DRY, "N"), Fv=(VISCOUS, "N*s/m")),
)  # fmt: skip
SETUP = Setup(TwinSpec("axis", ModelSpec("python"), anomaly=AnomalySpec(0.1)), AXIS)


def tuned(problem: Problem) -> tuple[Problem, Fit, dict[str, Any]]:
    return problem, solve(problem), {}


def learned(seed: int, rows: int, spread: float, dry: float, viscous: float) -> Fit:
    """What a change by shares of both is told to be, on some rows about one speed."""
    rng = np.random.default_rng(seed)
    speed = rng.choice([-1.0, 1.0], rows) * (0.25 + rng.uniform(-spread, spread, rows))
    force = DRY * (1.0 + dry) * np.sign(speed) + VISCOUS * (1.0 + viscous) * speed
    y = force + rng.normal(0.0, 3.0, rows)
    problem = Problem(AXIS, (make_block(t=np.arange(rows), u=speed[:, None], y=y[:, None]),))
    return fewest(SETUP, problem, solve(problem), tuned)[1]


def holds(fit: Fit, name: str, true: float) -> bool:
    low, high = fit.interval(name)
    return low <= true <= high


def test_intervals_hold_what_changed_whichever_of_both_did() -> None:
    kinds, kept, told = ((0.25, 0.0), (0.0, 0.25), (0.25, 0.25)), 0, 0
    for seed in SEEDS:
        dry, viscous = kinds[seed % 3]
        fit = learned(seed, 180, 0.06, dry, viscous)
        true = {"Fc": DRY * (1.0 + dry), "Fv": VISCOUS * (1.0 + viscous)}
        found = [holds(fit, name, true[name]) for name in fit.names]
        kept, told = kept + sum(found), told + len(found)
    assert kept >= 0.9 * told


def test_many_speeds_tell_one_number_from_the_other() -> None:
    """The interval is not much wider than that of the fit of both."""
    for seed in range(5):
        fit = learned(seed, 1500, 0.2, 0.25, 0.0)
        half = np.diff(fit.interval95[fit.names.index("Fc")])[0] / 2.0
        assert half < 0.02 * DRY * 1.25


def test_it_is_said_what_a_number_would_be() -> None:
    told = 0
    for seed in SEEDS:
        fit = learned(seed, 180, 0.06, 0.25, 0.25)
        if len(fit.names) == 1:
            told += 1
            assert fit.verdict == ("weak",) and "changed too" in fit.reasons[0]
    assert told > len(SEEDS) / 2


def test_without_companions_nothing_is_said() -> None:
    rows = make_block(t=np.arange(50), u=np.linspace(-1, 1, 50)[:, None], y=np.ones((50, 1)))
    problem = Problem(AXIS, (rows,), ("Fc",))
    fit = solve(problem)
    assert beside(problem, fit, (), lambda names: solve(problem.tuning(names))) is fit
