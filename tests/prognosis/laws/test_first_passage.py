"""The closed forms against simulation, against each other, and compiled code against plain."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.stats import invgauss

from evertwin.prognosis.laws.series import scaled
from evertwin.prognosis.laws.series.life import LEVELS, Life
from evertwin.prognosis.laws.wear import bank, passage
from evertwin.prognosis.laws.wear.bank import Posterior, evaluate, without_growth
from evertwin.prognosis.laws.wear.clocks import Clocks, Form
from evertwin.prognosis.laws.wear.hypotheses import LAWS, families
from planted.metrics import crps, dummy, horizon, relative_accuracy, within


def certain(now: float, growth: float, s2: float, cov: tuple[float, float, float]) -> Posterior:
    """A posterior of one hypothesis with a known variance."""
    dof = 1e6
    one = np.ones(1)
    return Posterior(
        0.0 * one, 0.0 * one, now * one, growth * one, np.array([cov]), s2 * dof * one, dof
    )


R = np.linspace(0.0, 3.0, 31)
STRAIGHT = Clocks("linear", np.zeros(1))


def test_a_known_drift_gives_the_inverse_gaussian() -> None:
    drift, sigma2, left = 1.0, 0.04, 0.7
    found = passage.process(
        certain(0.3, drift, sigma2, (0.0, 0.0, 0.0)), np.ones(1), 1.0, R[None, :]
    )[0]
    mean, shape = left / drift, left**2 / sigma2
    assert np.allclose(found, invgauss.cdf(R, mean / shape, scale=shape), atol=1e-4)


@pytest.mark.parametrize("cov", [(0.0, 0.0, 4.0), (1.0, 0.5, 2.0), (0.3, 0.0, 0.5)])
def test_an_uncertain_start_and_drift_agree_with_simulation(
    cov: tuple[float, float, float],
) -> None:
    rng = np.random.default_rng(0)
    s2, q = 0.01, 4.0
    found = passage.process(certain(0.2, 1.0, s2, cov), np.array([q]), 1.0, R[None, :])[0]
    spread = s2 * np.array([[cov[0], cov[1]], [cov[1], cov[2]]])
    now, drift = rng.multivariate_normal([0.2, 1.0], spread, 40_000).T
    step, lives = 0.01, np.where(now >= 1.0, 0.0, np.inf)
    for k in range(1, 301):
        new = now + drift * step + np.sqrt(s2 * q * step) * rng.standard_normal(len(now))
        # Between two levels below the limit a Brownian path passes it with this probability.
        room = np.maximum(1.0 - now, 0.0) * np.maximum(1.0 - new, 0.0)
        passed = rng.random(len(now)) < np.exp(-2.0 * room / (s2 * q * step))
        lives, now = np.where(np.isinf(lives) & passed, (k - 0.5) * step, lives), new
    counted = np.searchsorted(np.sort(lives), R, side="right") / len(lives)
    assert np.abs(found - counted)[1:].max() < 0.012


def test_a_path_is_passed_when_its_level_lies_above() -> None:
    spread = (0.5, 0.1, 0.3)
    known = certain(0.2, 1.0, 0.01, spread)
    found = passage.path(known, 1.0, R[None, :])[0]
    rng = np.random.default_rng(1)
    cov = 0.01 * np.array([[0.5, 0.1], [0.1, 0.3]])
    now, growth = rng.multivariate_normal([0.2, 1.0], cov, 100_000).T
    counted = [(now + growth * r >= 1.0).mean() for r in R]
    assert np.abs(found - counted).max() < 0.006


def test_evidence_is_the_product_of_predictions() -> None:
    """log p(y₁…yₙ) grows by the Student density of the next value."""
    from scipy.stats import t as student

    rng = np.random.default_rng(2)
    s = np.linspace(0.1, 1.0, 12)
    y = s + 0.1 * rng.standard_normal(12)
    omega, fixed, clock, q = np.ones(12), np.ones((12, 1)), STRAIGHT.at(s), np.zeros(1)
    base = np.ones(1)

    def of(n: int) -> Posterior:
        return evaluate(y[:n], omega[:n], fixed[:n], clock[:, :n], q, base)

    x = np.column_stack([fixed[:, 0], s])
    a = x[:11].T @ x[:11]
    theta = np.linalg.solve(a, x[:11].T @ y[:11])
    before = of(11)
    scale = np.sqrt(before.square[0] / before.dof * (1.0 + x[11] @ np.linalg.solve(a, x[11])))
    told = student.logpdf(y[11], before.dof, loc=x[11] @ theta, scale=scale)
    assert of(12).evidence[0] - before.evidence[0] == pytest.approx(told, abs=1e-6)


def test_a_level_without_growth_is_preferred_where_there_is_none() -> None:
    rng = np.random.default_rng(3)
    s, fixed = np.linspace(0.0, 1.0, 60), np.ones((60, 1))
    for growth, preferred in ((0.0, True), (0.5, False)):
        y = growth * s + 0.1 * rng.standard_normal(60)
        args = y, np.ones(60), fixed
        grown = evaluate(*args, STRAIGHT.at(s), np.zeros(1), np.ones(1)).evidence[0]
        assert (without_growth(*args) > grown) == preferred


@pytest.mark.parametrize("form", ["linear", "power", "exponential"])
def test_clocks_are_one_now_and_their_slope_is_right(form: Form) -> None:
    c = np.array([0.5, 1.0, 3.0])
    clocks = Clocks(form, 0.0 * c if form == "linear" else c)
    assert np.allclose(clocks.at(np.ones(1)), 1.0)
    s, d = np.array([0.7, 1.0, 2.0]), 1e-6
    assert np.allclose(clocks.slope(s), (clocks.at(s + d) - clocks.at(s - d)) / (2 * d), rtol=1e-5)


def test_every_law_has_its_families() -> None:
    assert {family.law for family in families()} == set(LAWS)
    for family in families():
        clocks, q = family.hypotheses()
        assert clocks.at(np.linspace(0, 1, 4)).shape == (len(q), 4)
        weight = np.exp(family.prior()) * len(q)
        # Exponents over the observed part of the life reach lower than those over all of it.
        assert 0.2 < weight < 4.5


def test_the_filter_whitens_as_the_covariance_says() -> None:
    rng = np.random.default_rng(7)
    y, fixed, omega = rng.standard_normal(40), np.ones((40, 2)), rng.uniform(0.5, 2.0, 40)
    fixed[:, 1] = rng.standard_normal(40)
    clock, q = np.sort(rng.random((3, 40)), axis=1), np.array([0.0, 1.0, 50.0])
    found = bank.filtered(y, omega, fixed, clock, q)
    for k in range(3):
        since = clock[k] - clock[k, 0]
        whole = q[k] * np.minimum(since[:, None], since) + np.diag(omega)
        x = np.column_stack([fixed, clock[k], y])
        assert np.allclose(found.gram[k], x.T @ np.linalg.solve(whole, x), rtol=1e-9)
        assert np.isclose(found.logs[k], np.linalg.slogdet(whole)[1])
        weight = np.linalg.solve(whole, q[k] * since)  # W now, given the values
        assert np.allclose(found.carried[k], weight @ x, rtol=1e-9)
        assert np.isclose(found.left[k], q[k] * since[-1] - weight @ (q[k] * since), atol=1e-12)
    quiet = bank.sums(y, omega, fixed, clock)
    assert np.allclose(quiet.gram[0], found.gram[0]) and np.isclose(quiet.logs[0], found.logs[0])


def test_compiled_code_does_what_plain_code_does() -> None:
    def run(function: Any) -> np.ndarray:
        found = np.zeros((3, len(R)))
        cov = np.array([[0.1, 0.05, 0.2], [1e-6, 0.0, 0.1], [2.0, 1.0, 2.0]])
        told = (np.array([0.5, 0.4, -0.1]), np.ones(3), cov, np.full(3, 0.4),
                np.array([1.0, 5.0, 2.0]))  # fmt: skip
        nodes = passage.NODES, passage.SHARES
        function(told, np.array([0.02, 0.03]), np.tile(R, (3, 1)), nodes, found)
        return found

    both = run(passage.drifting.compiled), run(passage.drifting.plain)
    assert np.allclose(*both, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("n", [2, 5, 7, 40])
def test_a_value_is_compared_with_its_neighbours_one_by_one(n: int) -> None:
    y = np.random.default_rng(7).standard_normal(n)
    for i, rest in enumerate(scaled.neighbours(y, 3)):
        first = max(0, min(i - 3, n - 7))
        near = np.arange(first, min(first + 7, n))
        step = np.median(np.diff(y[near]))
        others = near[near != i]
        assert rest == y[i] - np.median(y[others] - step * (others - i))


def test_metrics_tell_good_from_bad() -> None:
    sharp, wide = (Life.of("h", LEVELS, 50.0 + w * (LEVELS - 0.5)) for w in (4.0, 60.0))
    assert crps(sharp, 50.0) < crps(wide, 50.0) < crps(sharp, 80.0)
    assert within(sharp, 55.0) and not within(sharp, 70.0) and not within(np.inf, 70.0)
    assert relative_accuracy(np.inf, 10.0) == -np.inf and relative_accuracy(10.0, 10.0) == 1.0
    assert horizon([10.0, 50.0], [np.inf, np.inf], 100.0) == 0.0
    assert horizon([10.0, 50.0], [85.0, 45.0], 100.0) == 90.0
    assert dummy(100.0, 40.0) == 60.0
    assert crps(Life("h", np.full(len(LEVELS), np.inf)), 1.0) == np.inf
