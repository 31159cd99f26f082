"""The record of a tuning and the statistics in it."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from evertwin.fold import canonical, make_block
from evertwin.models import Parameters
from evertwin.signals import Layout
from evertwin.tuning import Problem, solve
from evertwin.tuning.statistics import (
    autocorrelation,
    dependences,
    effective,
    ljung_box,
    memory,
    spread,
)  # fmt: skip

P = np.array([3.0, 2.0, 0.02])


def test_a_fit_is_a_plain_record(axes: Any, measured: Any) -> None:
    rng = np.random.default_rng(0)
    model, u = axes(1), rng.normal(size=(100, 1))
    block = measured(model, u, P, 0.1 * rng.normal(size=u.shape))
    fit, again = (solve(Problem(model, (block,))) for _ in range(2))
    assert canonical(fit.to_dict(timing=False)) == canonical(again.to_dict(timing=False))
    content = json.loads(json.dumps(fit.to_dict()))
    assert content["parameters"]["Fc0"]["verdict"] == "identifiable"
    assert content["outputs"]["t0"]["rows"] == 100
    assert content["seconds"] > 0
    assert fit.identifiable == ("Fc0", "Bm0")
    assert fit.interval("Fc0")[0] < fit["Fc0"] < fit.interval("Fc0")[1]
    assert "Fc0" in str(fit)
    assert "identifiable" in str(fit)
    assert fit._repr_html_().count("<tr>") == 5
    assert fit.p[2] == 0.02


def test_infinities_become_null(friction: Any) -> None:
    u = np.full((50, 1), 0.4)
    block = make_block(t=np.arange(50), u=u, y=u * 30)
    fit = solve(Problem(friction["one"], (block,)))
    content = json.loads(json.dumps(fit.to_dict(), allow_nan=False))
    assert content["parameters"]["Fc"]["interval95"] == [None, None]
    assert "unknown" in str(fit)


def test_moving_rows_are_judged_apart(axes: Any, measured: Any) -> None:
    rng = np.random.default_rng(1)
    model = axes(1)
    u = np.where(np.arange(200) < 100, 0.0, rng.normal(size=200))[:, None]
    noise = np.where(np.arange(200) < 100, 3.0, 0.01)[:, None] * rng.normal(size=(200, 1))
    block = measured(model, u, P, noise)
    fit = solve(Problem(model, (block,), moving=lambda u: np.abs(u) > 0.05))
    assert fit.moving_after[0] < 0.05 < fit.deviation_after[0]


def test_the_residual_tells_a_wrong_form_from_moved_parameters(axes: Any, measured: Any) -> None:
    rng = np.random.default_rng(2)
    model, u = axes(1), rng.normal(size=(400, 1))
    noise = 0.1 * rng.normal(size=u.shape)
    right = solve(Problem(model, (measured(model, u, P, noise),))).residuals[0]
    wrong = solve(Problem(model, (measured(model, u, P, noise + 0.2 * u**2),))).residuals[0]
    assert right.white and right.independent
    assert not wrong.independent
    assert wrong.dependence is not None
    assert (wrong.dependence.input, wrong.dependence.output) == ("v0", "t0")
    assert wrong.dependence.share > 0.3


def test_false_alarms_of_both_tests_are_rare() -> None:
    white, dependent = 0, 0
    for seed in range(300):
        rng = np.random.default_rng(seed)
        r, u = rng.normal(size=(250, 1)), rng.normal(size=(250, 3))
        white += ljung_box(r[:, 0]) < 0.05
        dependent += dependences(r, u, ("y",), ("a", "b", "c"))[0].p < 0.05
    assert 4 <= white <= 28
    assert dependent <= 28


def test_slow_residuals_against_slow_inputs_are_not_called_dependent() -> None:
    found = 0
    for seed in range(150):
        rng = np.random.default_rng(seed)
        both = rng.normal(size=(2, 1000))
        for i in range(1, 1000):
            both[:, i] += 0.95 * both[:, i - 1]
        found += dependences(both[:1].T, both[1:].T, ("y",), ("u",))[0].p < 0.01
    assert found <= 12  # independent rows would call nearly all of them


def test_autocorrelation_by_sums_and_by_spectrum_agree() -> None:
    rng = np.random.default_rng(4)
    r = np.convolve(rng.normal(size=500), np.ones(5))[:500]
    r[40:60] = np.nan
    short, long = autocorrelation(r, 10), autocorrelation(r, 60)[:11]
    np.testing.assert_allclose(short, long, atol=1e-12)
    assert len(memory(rng.normal(size=1000))) <= 3
    assert effective(r) < 300
    assert autocorrelation(np.zeros(9), 2).tolist() == [1.0, 0.0, 0.0]
    c = rng.normal(size=(3000, 2)).cumsum(axis=0)
    slow = np.convolve(rng.normal(size=3000), np.ones(400))[:3000]
    lags = len(memory(slow))
    assert lags > 65
    rho = memory(slow)
    direct = (c**2).sum(axis=0) + sum(
        2 * rho[h] * (c[h:] * c[:-h]).sum(axis=0) for h in range(1, lags)
    )
    np.testing.assert_allclose(spread(c, slow), np.maximum(direct, (c**2).sum(axis=0)), rtol=1e-9)


def test_degenerate_residuals_are_harmless() -> None:
    r = np.full((6, 1), np.nan)
    assert ljung_box(r[:, 0]) == 1.0
    assert dependences(r, np.arange(6.0)[:, None], ("y",), ("u",))[0].p == 1.0
    assert dependences(r, np.zeros((6, 1)), ("y",), ("u",)) == ()


def test_a_fit_never_predicts_worse_than_its_start() -> None:
    # Viscous, Coulomb and root friction are nearly collinear, and these rows are few and noisy.
    law = Parameters.of(Fv=(8.0, "Nms/rad"), Fc=(6.0, "Nm"), Fr=(9.0, "N*m*s**0.5"))

    class Law:
        inputs, outputs, states = Layout.of(v="rad/s"), Layout.of(tau="Nm"), Layout()
        parameters, columns = law, np.array([[0, 1, 2]])

        def initial(self, p: Any) -> Any:
            return np.zeros(0)

        def observe(self, x: Any, y: Any) -> Any:
            return x

        def simulate(self, x: Any, u: Any, dt: Any, p: Any) -> Any:
            return x, (self.regressor(x, u, dt, p)[1] * p).sum(axis=2)

        def regressor(self, x: Any, u: Any, dt: Any, p: Any) -> Any:
            phi = np.stack([u, np.sign(u), np.sign(u) * np.sqrt(np.abs(u))], axis=2)
            return np.zeros_like(u), phi

    model, refused = Law(), 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        u = np.sign(rng.normal(size=(40, 1))) * rng.uniform(0.3, 1.0, (40, 1))
        y = model.simulate(np.zeros(0), u, None, law.values)[1] + rng.normal(0, 3.0, u.shape)
        fit = solve(Problem(model, (make_block(t=np.arange(40), u=u, y=y),)))
        refused += "not" in fit.verdict and set(fit.verdict) != {"not"}
        assert fit.deviation_after[0] <= fit.deviation_before[0] * (1 + 1e-9), seed
    assert refused > 5
