"""Sobol and Morris against values that are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.engineering.sensitivity import morris, sobol
from evertwin.errors import ModelError
from evertwin.fold import make_block
from evertwin.models import FunctionModel, Parameters
from evertwin.signals import Layout
from evertwin.tuning import Problem

pytestmark = pytest.mark.usefixtures("few_samples")
U = np.linspace(-1.0, 2.0, 8)[:, None]


@pytest.fixture
def few_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """A Python function with its types checked is slow; the errors below allow for it."""
    monkeypatch.setattr("evertwin.engineering.sensitivity.MOST", 256)


def problem(function: object, **parameters: tuple[float, str]) -> Problem:
    model = FunctionModel(
        lambda x, u, dt, p: ([], [function(u[0], p)]),  # type: ignore[operator]
        Layout.of(u="1"), Layout.of(y="1"), parameters=Parameters.of(**parameters),
    )  # fmt: skip
    y = np.array([[function(u, [v for v, _ in parameters.values()])] for u in U[:, 0]])  # type: ignore[operator]
    return Problem(model, (make_block(t=np.arange(len(U)), u=U, y=y),))


def test_shares_of_a_sum_are_its_variances() -> None:
    asked = problem(lambda u, p: p[0] * u + p[1] * u**2, a=(2.0, "1"), b=(1.0, "1"))
    found = sobol(asked, np.array([1.0, 0.5]), seed=3)
    own = np.array([1.0**2 * np.sum(U**2), 0.5**2 * np.sum(U**4)])
    assert found.share[0] == pytest.approx(own / own.sum(), abs=0.05)
    assert found.alone[0] == pytest.approx(own / own.sum(), abs=0.05)
    rms = np.sqrt(np.mean(np.square(2 * U + U**2)))
    made = np.sqrt(own / 3 / len(U)) / rms
    assert found.effect[0] == pytest.approx(made, rel=0.05)


def test_a_product_interacts() -> None:
    asked = problem(lambda u, p: p[0] * p[1] * u, a=(1.0, "1"), b=(1.0, "1"))
    found = sobol(asked, np.array([0.5, 0.5]), seed=3)
    s = 0.25 / 3
    total = (s + s**2) / (2 * s + s**2)
    assert found.share[0] == pytest.approx([total, total], abs=0.06)
    assert found.alone[0] == pytest.approx([s / (2 * s + s**2)] * 2, abs=0.06)
    screened = morris(asked, np.array([0.5, 0.5]), seed=3)
    assert (screened.spread > 0.02).all()


def test_morris_of_a_sum_is_its_range() -> None:
    asked = problem(lambda u, p: p[0] * u + p[1], a=(2.0, "1"), b=(1.0, "1"))
    found = morris(asked, np.array([1.0, 0.5]), seed=3)
    rms = np.sqrt(np.mean(np.square(2 * U + 1)))
    assert found.mu[0] == pytest.approx([2 * np.sqrt(np.mean(U**2)) / rms, 1.0 / rms], rel=1e-3)
    assert found.spread[0] == pytest.approx([0.0, 0.0], abs=1e-9)


def test_the_same_seed_gives_the_same_figures() -> None:
    asked = problem(lambda u, p: p[0] * u + p[1], a=(2.0, "1"), b=(1.0, "1"))
    first, again = (morris(asked, np.array([1.0, 0.5]), seed=3) for _ in range(2))
    assert first.mu.tolist() == again.mu.tolist()


def test_a_diverging_range_is_told() -> None:
    asked = problem(lambda u, p: u / (p[0] - 1.5) if p[0] < 1.5 else np.inf, a=(1.0, "1"))
    with pytest.raises(ModelError, match="diverged with a = "):
        sobol(asked, np.array([0.9]), seed=3)
