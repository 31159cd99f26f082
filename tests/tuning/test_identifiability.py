"""The gate: what the rows determine, what not, and what would help."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evertwin.fold import make_block
from evertwin.models import FunctionModel, Parameters
from evertwin.signals import Layout
from evertwin.tuning import Problem, advise, gate, solve
from evertwin.tuning.linear.sensitivity import Sensitivity


def speeds(n: int = 4000) -> Any:
    """A stroke to and fro with pauses of nothing: a trapezoid in speed."""
    phase = np.linspace(0, 8 * np.pi, n)
    return np.clip(1.5 * np.sin(phase), -1, 1) * 0.3


def columns(v: Any, width: float, law: str) -> Any:
    s = np.sign(v) if width == 0 else np.tanh(v / width)
    a = np.gradient(v)
    parts = {
        "one": [a, v, s, np.ones_like(v)],
        "two": [a, v, np.maximum(s, 0), np.minimum(s, 0), np.ones_like(v)],
        "two without offset": [a, v, np.maximum(s, 0), np.minimum(s, 0)],
    }[law]
    return np.stack(parts, axis=1)


@pytest.mark.parametrize("width", [0.0, 1e-3, 5e-3, 2e-2])
def test_the_offset_trap_is_refused_by_the_general_rule(width: float) -> None:
    for law, expected in [
        ("one", (False,) * 4),
        ("two", (False, False, True, True, True)),
        ("two without offset", (False,) * 4),
    ]:
        j = columns(speeds(), width, law) * 30
        names = ("M", "Fv", "Fp", "Fm", "offset")[: j.shape[1]]
        acting = Sensitivity.dense(j[:, None], np.ones((len(j), 1), dtype=np.bool_))
        found = gate(acting, np.ones(1), names, np.full(j.shape[1], 10.0))
        assert found.undetermined == expected, (law, width)


def block(u: Any, seed: int = 0) -> Any:
    rng = np.random.default_rng(seed)
    y = 12 * np.sign(u) + 5 * u + 2 + 0.1 * rng.normal(size=u.shape)
    return make_block(t=np.arange(len(u)) * 10**7, u=u[:, None], y=y[:, None])


def test_constant_motion_keeps_every_parameter_and_says_what_would_help(friction: Any) -> None:
    fit = solve(Problem(friction["one"], (block(np.full(500, 0.4)),)))
    assert fit.verdict == ("not",) * 3
    assert fit.values.tolist() == [9.0, 4.0, 1.0]
    assert np.isinf(fit.sigma).all()
    assert np.isinf(fit.interval95).all()
    assert "speed at several values in both directions" in fit.reasons[0]


def test_one_direction_of_motion_keeps_friction_and_offset(friction: Any) -> None:
    fit = solve(Problem(friction["one"], (block(np.linspace(0.1, 1.0, 500)),)))
    assert fit.verdict == ("not", "identifiable", "not")
    assert fit["Bm"] == pytest.approx(5.0, abs=0.1)
    assert "speed in both directions (here 0.1 to 1 rad/s)" in fit.reasons[0]


def test_both_directions_determine_all(friction: Any) -> None:
    fit = solve(Problem(friction["one"], (block(np.linspace(-1.0, 1.0, 500)),)))
    assert fit.verdict == ("identifiable",) * 3
    assert np.abs(fit.values - [12, 5, 2]).max() < 0.1


def test_the_trap_through_the_nonlinear_solver(friction: Any) -> None:
    fit = solve(Problem(friction["two"], (block(speeds(800)),)))
    named = dict(zip(fit.names, fit.verdict, strict=True))
    assert named == {"Fc": "not", "Bm": "identifiable", "offset": "not", "Fm": "not"}
    assert (fit["Fc"], fit["offset"], fit["Fm"]) == (9.0, 1.0, 9.0)
    assert "no motion tells them apart: fix one of Fc, offset, Fm" in fit.reasons[0]


def test_noise_alone_makes_a_parameter_weak(friction: Any) -> None:
    rng = np.random.default_rng(0)
    u = np.linspace(-1, 1, 60)
    y = 12 * np.sign(u) + 5 * u + 2 + 40 * rng.normal(size=u.shape)
    rows = make_block(t=np.arange(60), u=u[:, None], y=y[:, None])
    fit = solve(Problem(friction["one"], (rows,)))
    assert fit.verdict[0] in ("weak", "not")
    assert "% of its size" in fit.reasons[1]


def test_nothing_is_ever_claimed_of_what_is_not_there(friction: Any) -> None:
    # k1·k2 acts only as a product: no value of either can be known.
    rng = np.random.default_rng(1)
    for _ in range(10):
        u = rng.normal(size=(100, 1))
        y = 6 * u + 0.1 * rng.normal(size=u.shape)
        fit = solve(Problem(friction["product"], (make_block(t=np.arange(100), u=u, y=y),)))
        assert fit.verdict == ("not", "not")


def test_advice_is_empty_where_nothing_is_missing_or_nothing_helps(friction: Any) -> None:
    rows = np.linspace(-1, 1, 50)[:, None], np.ones(50)
    assert advise(friction["one"], ("Fc", "Bm"), *rows) == ()
    assert advise(friction["two"], ("Fc", "offset", "Fm"), *rows) == ()


def test_advice_is_of_the_time_that_rows_take_and_none_where_the_model_runs_away() -> None:
    """A fast store that nothing enters: at its own rate an input that changes tells its numbers; at
    a twentieth of it the model leaves all numbers, which says nothing."""
    tank = FunctionModel(
        lambda x, u, dt, p: ([x[0] + dt * (p[0] * u[0] - p[1] * x[0])], [x[0]]),
        Layout.of(u="1"), Layout.of(y="1"), Layout.of(y="1"),
        Parameters.of(gain=(80.0, "1/s"), leak=(100.0, "1/s")),
    )  # fmt: skip
    u = np.zeros((500, 1))
    assert advise(tank, ("gain", "leak"), u, np.full(500, 0.05)) == ()
    (said,) = advise(tank, ("gain", "leak"), u, np.full(500, 0.002))
    assert "a changing u" in said
