"""A plain step as machine code gives what the interpreter gives, or it is not taken."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin.machines.catalog import machine
from evertwin.models import FunctionModel, Parameters
from evertwin.models.functions.translated import Translated, translated
from evertwin.signals import Layout

TABLE_X, TABLE_Y = np.array([0.0, 1.0, 2.0]), np.array([0.0, 3.0, 4.0])
COUNTS = {"steps": 0}
LIMIT = 2.0


def by_index(x: Any, u: Any, dt: float, p: Any) -> Any:
    level = max(x[0] + dt * (u[0] - p[1] * max(x[0], 0.0) ** 0.5) / p[0], 0.0)
    return [level, x[1]], [level]


def taken_apart(x: Any, u: Any, dt: float, p: Any) -> Any:
    (a, b), (k, tau), (v,) = x, p, u
    a += dt * (k * v - a) / tau
    if a > LIMIT:
        b = 1
    return [a, b], [a]


def with_arrays(x: Any, u: Any, dt: float, p: Any) -> Any:
    ahead = x + dt * (np.array([[-0.1, 0.2], [0.0, -0.3]]) @ x + u[0] * p)
    return ahead, [np.interp(ahead[0], TABLE_X, TABLE_Y)]


def helped(x: Any, u: Any, dt: float, p: Any) -> Any:
    total = 0.0
    for value in x:
        total += _squared(value)
    return [x[1], total % 1.0], [math.sqrt(total) + p[-1]]


def _squared(value: float) -> float:
    return value**2


def failing(x: Any, u: Any, dt: float, p: Any) -> Any:
    if u[0] > 0.5:
        raise ValueError("too much")
    return [x[0], x[1]], [1.0 / x[0] + math.log(p[0] - 10.0)]


def counting(x: Any, u: Any, dt: float, p: Any) -> Any:
    COUNTS["steps"] += 1
    return [x[0], x[1]], [x[0]]


def drawing(x: Any, u: Any, dt: float, p: Any) -> Any:
    return [x[0], x[1]], [x[0] + np.random.normal()]  # noqa: NPY002


def formatted(x: Any, u: Any, dt: float, p: Any) -> Any:
    return [x[0], x[1]], [float(f"{x[0]:.3f}")]


def of(step: Callable[..., Any]) -> FunctionModel:
    return FunctionModel(
        step, Layout.of(v="1"), Layout.of(y="1"), Layout.of(a="1", b="1"),
        Parameters.of(k=(1.5, "1"), tau=(4.0, "s")), start=(0.7, 0.3),
    )  # fmt: skip


@pytest.mark.parametrize("step", [by_index, taken_apart, with_arrays, helped])
def test_it_gives_the_same_rows(step: Callable[..., Any]) -> None:
    slow = of(step)
    fast = translated(slow)
    assert type(fast) is Translated
    u, dt = np.random.default_rng(1).uniform(0, 1, (300, 1)), np.full(300, 0.1)
    p = slow.parameters.values
    (x, y), (x_, y_) = (model.simulate(model.initial(p), u, dt, p) for model in (slow, fast))
    np.testing.assert_allclose(y_, y, rtol=1e-9)
    np.testing.assert_allclose(x_, x, rtol=1e-9)


def test_its_input_stays_as_it_is() -> None:
    def shifted(x: Any, u: Any, dt: float, p: Any) -> Any:
        x[0] += dt
        return x, [x[0]]

    fast = translated(of(shifted))
    assert type(fast) is Translated
    x, p = np.array([1.0, 2.0]), fast.parameters.values
    ahead, _ = fast.simulate(x, np.zeros((3, 1)), np.ones(3), p)
    assert x.tolist() == [1.0, 2.0] and ahead.tolist() == [4.0, 2.0]


def test_a_row_that_fails_is_none() -> None:
    fast = translated(of(failing))
    assert type(fast) is Translated
    p = np.array([20.0, 0.0])
    _, y = fast.simulate(np.array([1.0, 0.0]), np.array([[0.0], [1.0], [0.2]]), np.ones(3), p)
    assert np.isnan(y[:, 0]).tolist() == [False, True, False]
    _, y = fast.simulate(np.array([0.0, 0.0]), np.zeros((1, 1)), np.ones(1), p)
    assert np.isnan(y).all()
    _, y = fast.simulate(np.array([1.0, 0.0]), np.zeros((1, 1)), np.ones(1), np.zeros(2))
    assert np.isnan(y).all()


@pytest.mark.parametrize(
    ("step", "why"),
    [
        (counting, "it reads COUNTS, a dict"), (drawing, "it draws numbers"),
        (formatted, "cannot be compiled"), (lambda x, u, dt, p: ([*x], [x[0]]), "by def alone"),
        (abs, "no plain function"),
    ],
)  # fmt: skip
def test_what_keeps_or_draws_or_formats_runs_as_it_is(
    step: Callable[..., Any], why: str, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level("INFO", "evertwin"):
        model = of(step)
        assert translated(model) is model
    assert why in caplog.text


def test_the_file_of_a_twin_is_translated_and_follows_its_source(tmp_path: Path) -> None:
    text = (
        "from evertwin import FunctionModel, Layout, Parameters\nGAIN = {gain}\n"
        "def step(x, u, dt, p):\n    return [], [GAIN * p[0] * u[0]]\n"
        "model = FunctionModel(step, Layout.of(v='1'), Layout.of(y='1'), Layout(), "
        "Parameters.of(k=(2.0, '1')))\n"
    )
    file = tmp_path / "own.py"
    for gain in (3.0, 5.25):  # kept machine code of before is not taken
        file.write_text(text.format(gain=gain))
        model = machine("python", {"file": str(file)})
        assert type(model) is Translated
        _, y = model.simulate(np.zeros(0), np.ones((1, 1)), np.ones(1), np.array([2.0]))
        assert y.tolist() == [[2.0 * gain]]
