"""Of parameters that act alike one is kept, the simpler; the other is named."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from evertwin.fold import make_block
from evertwin.machines.drive import DriveForce
from evertwin.models import FunctionModel, Parameters
from evertwin.signals import Layout
from evertwin.tuning import Fit, Problem, solve, told_apart
from evertwin.types import ParameterVector, Vector
from planted.axes import drawn
from planted.draws import first_of
from planted.twins import opened

PLACED = "sign+position"
Step = tuple[list[float], list[float]]


def posed(effect: str, seed: int, way: float) -> tuple[Problem, float]:
    """An axis whose law has friction by place too, over a way of so many of its waves."""
    axis = drawn(effect, seed)
    columns = axis.columns
    place = columns["position"] / np.ptp(columns["position"]) * way * 2.0 * np.pi
    u = np.stack([columns["speed"], columns["acceleration"], place], axis=1)
    t = np.round(columns["t"] * 1e9).astype(np.int64)
    rows = make_block(t=t, u=u, y=columns["force"][:, None])
    names = ("mass", "Fv", "Fc", "offset", "Fqc", "Fqs")
    moving = 0.005 * axis.top
    problem = Problem(
        DriveForce(PLACED), (rows,), names, moving=lambda v: np.abs(v[:, :1]) > moving,
        only_moving=True,
    )  # fmt: skip
    return problem, axis.truth["Fc"]


def reason(fit: Fit, name: str) -> str:
    return fit.reasons[fit.names.index(name)]


def test_what_a_wrong_form_confuses_on_a_short_way_stays_and_is_named() -> None:
    off = []
    for seed in range(5):
        problem, truth = posed("creep", seed, 0.04)
        plain = solve(problem)
        told = told_apart(problem, plain)
        off.append((abs(plain["Fc"] / truth - 1.0), abs(told["Fc"] / truth - 1.0)))
        assert told.verdict[told.names.index("Fqc")] == "not" and told["Fqc"] == 0.0
        assert "collinear: on these rows Fc acts like it" in reason(told, "Fqc")
        assert "needs position over a" in reason(told, "Fqc")
        assert "told with Fqc = 0" in reason(told, "Fc")
    before, after = np.median(off, axis=0)
    assert after < 0.5 < before


def test_a_long_way_tells_them() -> None:
    problem, _ = posed("creep", 1, 2.0)
    fit = solve(problem)
    assert told_apart(problem, fit) is fit


def test_a_right_form_tells_them_by_the_part_that_differs() -> None:
    problem, truth = posed("plain", 1, 0.1)
    fit = solve(problem)
    told = told_apart(problem, fit)
    low, high = told.interval("Fc")
    assert told is fit or low <= truth <= high


def test_of_exactly_collinear_ones_the_first_is_kept() -> None:
    axis = DriveForce("sign")
    rng = np.random.default_rng(0)
    v = rng.uniform(0.1, 1.0, 400)  # one direction: a constant force acts like dry friction
    u = np.stack([v, rng.normal(size=400)], axis=1)
    y = 2.0 * u[:, 1] + 3.0 * v + 5.0 + 0.01 * rng.normal(size=400)
    problem = Problem(axis, (make_block(t=np.arange(400) * 10**7, u=u, y=y[:, None]),))
    plain = solve(problem)
    assert plain.verdict[2:] == ("not", "not")
    told = told_apart(problem, plain)
    assert told.names == plain.names
    assert told.verdict == ("identifiable", "identifiable", "identifiable", "not")
    assert told["Fc"] == pytest.approx(5.0 - told["offset"], abs=0.01)
    assert told.deviation_after[0] < 0.01 < plain.deviation_after[0]
    assert "needs speed in both directions" in reason(told, "offset")


@pytest.mark.data
def test_a_short_axis_keeps_its_dry_friction(data_dir: Path) -> None:
    names = ("mass", "Fv", "Fc", "offset", "Fqc", "Fqs")
    twin = opened("emps", model={"options": {"law": PLACED}}, tuning={"editable": names})
    fit = twin.fit([str(data_dir / "emps" / "DATA_EMPS.mat")]).fit
    assert fit["Fc"] == pytest.approx(20.4, abs=1.5) and fit["Fqc"] == 0.0
    assert fit.verdict[names.index("Fqc")] == "not"


@first_of("seed", range(4))
def test_each_number_that_leans_on_one_that_is_held_says_so(seed: int) -> None:
    """A motor of which only the voltage and the speed are known: its torque constant brakes as its
    damping does, and what is held of that bends inertia and friction, too."""

    def motor(x: Vector, u: Vector, dt: float, p: ParameterVector) -> Step:
        torque = p[1] * (u[0] - p[1] * x[0]) / 1.9
        w = x[0] + dt * (torque - p[3] * x[0] - p[2] * math.tanh(x[0] / 2.0)) / p[0]
        return [w], [w]

    rng, given = np.random.default_rng(seed), (1.5, 0.45, 0.5, 0.02)
    truth = np.array([2.0, 0.52, 0.8, 0.012])
    names = dict(zip(("J", "Kt", "Fc", "B"), ((one, "1") for one in given), strict=True))
    speed = Layout.of(w="rad/s")
    model = FunctionModel(motor, Layout.of(u="V"), speed, speed, Parameters.of(**names))
    u = np.repeat(rng.uniform(-30.0, 30.0, 40), 50)[:, None]
    dt = np.full(len(u), 0.1)
    y = model.simulate(np.zeros(1), u, dt, truth)[1] + rng.normal(0.0, 0.05, u.shape)
    rows = make_block(t=np.arange(len(u)) * 10**8, u=u, y=y)
    problem = Problem(model, (rows,), tuple(names), 10.0)
    told = told_apart(problem, solve(problem))
    assert told.verdict[told.names.index("B")] == "not"
    for name, value in zip(told.names, truth.tolist(), strict=True):
        if name != "B":
            low, high = told.interval(name)
            assert low <= value <= high
            assert "told with B = 0.02" in reason(told, name)
