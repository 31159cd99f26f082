"""Models of one's own with a state that nothing measures: valleys, starts, recordings."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from evertwin.fold import Block, make_block
from evertwin.models import FunctionModel, Parameters
from evertwin.models.functions.translated import Translated
from evertwin.signals import Layout
from evertwin.tuning import Problem, own_names, solve, started

NOISE = 0.01


def tanks(x: Any, u: Any, dt: float, p: Any) -> tuple[list[float], list[float]]:
    """Two tanks, of which the lower is measured. Of the upper only outlet²/area acts."""
    upper, lower = x
    through, out = p[2] * max(upper, 0.0) ** 0.5, p[3] * max(lower, 0.0) ** 0.5
    upper, lower = upper + dt * (u[0] - through) / p[0], lower + dt * (through - out) / p[1]
    return [max(upper, 0.0), max(lower, 0.0)], [max(lower, 0.0)]


MODEL = Translated(
    tanks, Layout.of(inflow="m^3/s"), Layout.of(lower="m"), Layout.of(upper="m", lower="m"),
    Parameters.of(upper_area=(0.9, "m^2"), area=(0.5, "m^2"), upper_outlet=(0.02, "m^2.5/s"),
                  outlet=(0.006, "m^2.5/s"), upper_start=(0.5, "m")),
    start=("upper_start", 0.5),
)  # fmt: skip
TRUTH = np.array([0.6, 1.4, 0.012, 0.015, 0.0])


def recorded(seed: int, upper: float, lower: float, n: int = 160) -> Block:
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(0.0, 0.025, n // 20), 20)[:, None]
    dt = np.r_[0.0, np.full(n - 1, 4.0)]
    _, y = MODEL.simulate(np.array([upper, lower]), u, dt, TRUTH)
    t = np.arange(n) * 4 * 10**9
    return make_block(t=t, u=u, y=y + rng.normal(0.0, NOISE, y.shape))


def test_what_a_valley_leaves_open_does_not_spoil_the_fit() -> None:
    items = tuple(replace(item, low=0.0) for item in MODEL.parameters)
    problem = Problem(replace(MODEL, parameters=Parameters(items)), (recorded(0, 1.0, 0.4),))
    fit = solve(problem)
    assert fit.residuals[0].rms_after == pytest.approx(NOISE, rel=0.15)
    named = dict(zip(fit.names, fit.verdict, strict=True))
    assert named["upper_area"] == named["upper_outlet"] == "not"
    assert fit["upper_outlet"] ** 2 / fit["upper_area"] == pytest.approx(0.012**2 / 0.6, rel=0.2)
    assert "upper_area" in fit.reasons[fit.names.index("upper_outlet")]
    assert "a valley: other values of upper_area, upper_outlet" in fit.message
    assert fit.converged
    assert fit.evaluations < 200  # along a valley nothing is gained


def test_intervals_know_that_the_measured_start_is_noisy() -> None:
    """Errors in units of what the interval says of them; without the start 1.6 and 1.4."""
    prior = MODEL.parameters.with_values(np.r_[TRUTH[:4], 1.0])
    off = []
    for seed in range(10):
        fit = solve(
            Problem(MODEL, (recorded(seed, 1.0, 0.4, 60),), ("outlet", "area"), prior=prior)
        )
        off.append((fit.values - TRUTH[[3, 1]]) / fit.sigma)
    assert (np.sqrt(np.mean(np.square(off), axis=0)) < 1.2).all()


def test_each_recording_has_its_own_hidden_start() -> None:
    starts = (1.0, 0.2)
    windows = tuple(recorded(k, upper, 0.4 + 0.3 * k, 80) for k, upper in enumerate(starts))
    names = own_names(MODEL, ("outlet", "upper_start"), len(windows))
    assert names == ("outlet", "upper_start", "upper_start of recording 2")
    prior = MODEL.parameters.with_values(np.r_[TRUTH[:4], 0.5])
    fit = solve(Problem(MODEL, windows, names, prior=prior))
    assert fit.residuals[0].rms_after == pytest.approx(NOISE, rel=0.15)
    assert len(fit.p) == len(MODEL.parameters)
    for k, upper in enumerate(starts):
        own = started(MODEL, fit.p, (fit.names, fit.values), k)
        assert own[4] == pytest.approx(upper, abs=0.05)


def test_what_hangs_on_a_bent_valley_is_not_identifiable() -> None:
    """Of a and b only the sum is told; where they are equal no small step moves the loss."""

    def step(x: Any, u: Any, dt: float, p: Any) -> tuple[list[float], list[float]]:
        level = x[0] + dt * ((p[0] + p[1]) * u[0] - p[2] / (p[0] * p[1]) * x[0])
        return [level], [level]

    layouts = Layout.of(u="1"), Layout.of(y="1"), Layout.of(y="1")
    model = FunctionModel(step, *layouts, Parameters.of(a=(1.0, "1"), b=(1.0, "1"), k=(0.4, "1")))
    rng = np.random.default_rng(0)
    u, dt = rng.uniform(-1.0, 1.0, (150, 1)), np.r_[0.0, np.full(149, 1.0)]
    _, y = model.simulate(np.zeros(1), u, dt, np.array([0.5, 1.5, 0.15]))
    rows = make_block(t=np.arange(150) * 10**9, u=u, y=y + rng.normal(0.0, NOISE, y.shape))
    fit = solve(Problem(model, (rows,)))
    assert fit["k"] / (fit["a"] * fit["b"]) == pytest.approx(0.2, rel=0.05)
    low, high = fit.interval("k")
    assert low < 0.15 < high
    assert "identifiable" not in fit.verdict


def test_a_recording_on_which_nothing_tells_its_start_is_fitted_all_the_same() -> None:
    windows = (
        recorded(0, 1.0, 0.4, 80),
        recorded(1, 0.2, 0.7, 80)._replace(u=np.full((80, 1), np.nan)),
    )
    names = own_names(MODEL, ("outlet", "upper_start"), len(windows))
    prior = MODEL.parameters.with_values(np.r_[TRUTH[:4], 0.5])
    fit = solve(Problem(MODEL, windows, names, prior=prior))
    assert fit["upper_start"] == pytest.approx(1.0, abs=0.05)
    assert fit.verdict[2] == "not"
    assert fit["upper_start of recording 2"] == 0.5


def cell(x: Any, u: Any, dt: float, p: Any) -> tuple[list[float], list[float]]:
    """The voltage that a current takes from a cell: at once, and after a while."""
    late = x[0] + dt * (p[1] * u[0] - x[0]) / p[2]
    return [late], [-p[0] * u[0] - late]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("wrong", [0.0, 0.004])
def test_transients_tell_numbers_unless_the_form_is_wrong_in_them(seed: int, wrong: float) -> None:
    rng = np.random.default_rng(seed)
    model = Translated(
        cell, Layout.of(current="A"), Layout.of(voltage="V"), Layout.of(late="V"),
        Parameters.of(R0=(0.03, "ohm"), R1=(0.01, "ohm"), t1=(9.0, "s")),
    )  # fmt: skip
    truth, n = np.array([0.02, 0.015, 12.0]), 7200
    u = np.repeat(rng.uniform(-4.0, 5.0, n // 240), 240)[:, None]
    _, y = model.simulate(np.zeros(1), u, np.ones(n), truth)
    since = np.arange(n) % 240
    y[:, 0] += np.where(since < 12, wrong * rng.normal(0.0, 1.0, n), 0.0)  # unlike the model
    y += rng.normal(0.0, 1e-3, y.shape)
    rows = make_block(t=np.arange(n) * 10**9, u=u, y=y)
    fit = solve(Problem(model, (rows,), ("R0", "R1", "t1")))
    if wrong:
        assert "not" in fit.verdict
    else:
        assert set(fit.verdict) == {"identifiable"}
        assert fit.values == pytest.approx(truth, rel=0.03)
