"""The record of a tuning and the statistics in it."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from evertwin.fold import canonical, make_block
from evertwin.models import Parameters
from evertwin.signals import Layout
from evertwin.tuning import Problem, solve
from evertwin.tuning.residuals.autocorrelation import Correlation, effective
from evertwin.tuning.residuals.classes import Classes
from evertwin.tuning.residuals.classes_loop import classify
from evertwin.tuning.residuals.statistics import autocorrelation, dependences, ljung_box, spread
from evertwin.tuning.residuals.statistics_loop import (
    analysed,
    overlapped,
    propagated,
    remember,
    shifted,
    tally,
)

P = np.array([3.0, 2.0, 0.02])


def test_what_moved_though_nothing_tells_it_is_no_sure_number(axes: Any, measured: Any) -> None:
    rng = np.random.default_rng(0)
    model, u = axes(1), rng.normal(size=(100, 1))
    fit = solve(Problem(model, (measured(model, u, P, 0.1 * rng.normal(size=u.shape)),)))
    unsure = replace(fit, verdict=tuple("not" if n == "Bm0" else w for n, w in
                                        zip(fit.names, fit.verdict, strict=True)))  # fmt: skip
    assert "Bm0" in fit.moved
    assert set(unsure.moved) == {*fit.moved} - {"Bm0"} | {"Bm0 (weak)"}


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
    white, both = (Correlation.of(e[:, None]) for e in (rng.normal(size=1000), r))
    assert len(white.memory[0]) <= 3
    assert effective(1000.0, both.memory[0]) < 300
    assert autocorrelation(np.zeros(9), 2).tolist() == [1.0, 0.0, 0.0]
    long = rng.normal(size=20_000)  # summed in pieces
    long -= long.mean()
    direct = np.array([long[h:] @ long[: len(long) - h] for h in range(21)])
    direct /= len(long) - np.arange(21)
    np.testing.assert_allclose(autocorrelation(long, 20), direct / direct[0], atol=1e-12)
    np.testing.assert_allclose(
        autocorrelation(long, 21)[:21], autocorrelation(long, 20), atol=1e-12
    )


@pytest.mark.parametrize("length", [40, 400])
def test_memory_widens_the_spread_of_an_estimate(length: int) -> None:
    rng = np.random.default_rng(5)
    c = rng.normal(size=(3000, 2)).cumsum(axis=0)
    slow = np.convolve(rng.normal(size=3000), np.ones(length))[:3000]
    used = np.arange(3000) % 7 > 0
    rho = Correlation.of(np.where(used, slow, np.nan)[:, None]).memory[0]
    assert (len(rho) > 65) == (length == 400)
    seen = np.where(used[:, None], c, 0.0)
    gain = np.array([[1.0, 0.5], [0.0, 2.0]])
    direct = sum(
        2 * rho[h] * ((seen @ gain)[h:] * (seen @ gain)[:-h]).sum(axis=0)
        for h in range(1, len(rho))
    )
    np.testing.assert_allclose(spread(c, used, gain, rho), direct, rtol=1e-8)


def test_classes_are_quantiles_or_the_few_values_that_there_are() -> None:
    rng = np.random.default_rng(6)
    wide = np.exp(9 * rng.normal(size=5000))
    flat = np.where(rng.uniform(size=5000) < 0.7, 0.0, rng.normal(size=5000))
    few, holes = rng.integers(0, 3, 5000).astype(float), rng.normal(size=5000)
    holes[::9] = np.nan
    found = Classes.of(np.stack([wide, flat, few, holes, np.ones(5000)], axis=1))
    for j, values in enumerate((wide, flat, few, holes)):
        edges = np.unique(np.nanquantile(values, np.linspace(0, 1, 9)))[1:-1]
        if j == 2:
            edges = np.array([0.5, 1.5])
        known = np.isfinite(values)
        expected = np.searchsorted(edges, values, side="right")
        np.testing.assert_array_equal(found.number[j, known], expected[known])
    assert (found.count.max(axis=1) < 5000).tolist() == [True, True, True, True, False]
    assert found.count.sum(axis=1).tolist() == [5000.0] * 5


@pytest.mark.parametrize("holes", [False, True])
def test_loops_of_the_statistics_equal_their_plain_twins(holes: bool) -> None:
    rng = np.random.default_rng(7)
    r, y, u = rng.normal(size=(90, 9)), rng.normal(size=(90, 9)), rng.normal(size=(90, 3))
    u[5, 1], u[:, 2] = np.inf, np.round(u[:, 2])
    r[:, 0] = np.convolve(r[:, 0], np.ones(3))[:90]
    if holes:
        r[3, 4] = np.nan
    results = []
    for plain in (False, True):
        kernels = (tally, shifted, classify, remember, analysed, overlapped, propagated)
        count_up, shift, class_of, know, analyse, overlap, propagate = (
            kernel.plain if plain else kernel.compiled for kernel in kernels
        )
        out = np.zeros((2, 2))
        number, count = np.empty((3, 90), dtype=np.uint8), np.zeros((3, 8))
        moved = count_up(y, r, r > 0)
        shift(y[:, :2], r[:, 0] > 0, np.array([1.0, 0.5, 0.2]), out)
        class_of(u, number, count)
        memory = know(r)
        rows, rho, reach = memory.rows, memory.short, memory.reach
        shared = overlap(number, count, rho, reach)
        varying, analysis = analyse(number, count, memory, np.empty((0, 0)))
        assert varying == 3
        columns, blocks = np.stack([y, y * y], axis=2), np.stack([np.eye(3)] * 9)
        at = np.array([[0, 2]] * 8 + [[1, -1]])
        spectrum = np.ones(3), np.array([0.0, 1.0, 2.0]), np.eye(3)
        seen = columns, at, r == r, blocks
        inverse, variance, worth = propagate(spectrum, 1e-6, rows, seen, memory)
        assert inverse.tolist() == np.diag([0.0, 1.0, 0.5]).tolist()
        assert worth[0] == pytest.approx(effective(rows[0], rho[0, : reach[0] + 1]))
        results.append(
            (*moved, out, number, count, *memory, shared, varying, analysis, variance, worth)
        )
    for left, right in zip(*results, strict=True):
        assert np.array_equal(left, right, equal_nan=True)


def test_the_input_that_explains_most_is_found_among_all() -> None:
    # Most inputs are not even asked: those that another one beats in share, classes and rows.
    for seed in range(20):
        rng = np.random.default_rng(seed)
        u = np.concatenate([rng.normal(size=(200, 4)), rng.integers(0, 3, (200, 3))], axis=1)
        r = np.convolve(rng.normal(size=200), np.ones(1 + seed % 4))[:200] + 0.1 * u[:, seed % 7]
        found = dependences(r[:, None], u, ("y",), tuple("abcdefg"))[0]
        alone = [dependences(r[:, None], u[:, [j]], ("y",), ("x",))[0] for j in range(7)]
        best = min(range(7), key=lambda j: (alone[j].p, -alone[j].share))
        assert found.input == "abcdefg"[best]
        assert found.share == pytest.approx(alone[best].share, rel=1e-12)
        assert found.p == pytest.approx(min(1.0, 7 * alone[best].p), rel=1e-9)


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
