"""The branch: counted over seeds on planted deviations, causes named by what explains them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from evertwin.anomaly import Rule, branch, explained
from evertwin.fold import make_block
from evertwin.machines.drive import DriveForce
from evertwin.machines.mobile import Robot1D
from evertwin.models import FunctionModel, Parameter, Parameters
from evertwin.signals import Layout
from evertwin.tuning import Problem, solve
from planted.score import score

N, DT = 1500, 0.05
GAIN = Parameters((Parameter("gain", 1.0, "1", 0.5, 1.5),))
ROBOT = Robot1D()
AXIS = DriveForce()
START = AXIS.parameters.with_values({"mass": 90.0, "Fv": 200.0, "Fc": 20.0})


def commands(rng: np.random.Generator) -> np.ndarray:
    return np.repeat(rng.uniform(0.0, 0.2, N // 50), 50)


def drive(kind: str, seed: int) -> str:
    """The verdict on a robot whose real speed follows its command as ``kind`` says."""
    rng = np.random.default_rng(seed)
    v = commands(rng)
    real = {
        "gain": 1.1 * v,
        "true": v,
        "dead zone": np.where(v < 0.06, 0.0, v),
        "clamp": np.clip(v, 0.06, 0.16),
        "lag": np.convolve(v, np.ones(8) / 8)[:N],
        "within a row": 0.4 * v + 0.6 * np.append(v[1:], v[-1]),
    }[kind]
    x = np.cumsum(real * DT) + rng.normal(0, 0.001, N)
    block = make_block(
        t=np.arange(N) * round(DT * 1e9), u=v[:, None], y=x[:, None]
    )  # the first row is adopted
    problem = Problem(ROBOT, (block,), horizon=1.0, prior=GAIN)
    return branch(solve(problem), problem).kind


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "expected"),
    [("gain", "normal"), ("true", "normal"), ("dead zone", "abnormal"), ("clamp", "abnormal"),
     ("lag", "abnormal"), ("within a row", "normal")],
)  # fmt: skip
def test_the_verdict_is_right_in_nearly_all_runs(kind: str, expected: str) -> None:
    verdicts = [drive(kind, seed) for seed in range(20)]
    assert verdicts.count(expected) >= 19, verdicts


def axis(kind: str, seed: int) -> tuple[Problem, dict[str, Problem]]:
    rng = np.random.default_rng(seed)
    t = np.arange(690) * 0.01
    v = 0.1 * np.cos(3 * t) + 0.05 * np.sin(7 * t)
    u = np.column_stack([v, np.gradient(v, 0.01)])
    truth = START.values
    if kind == "friction":
        truth[1:3] *= 1.5
    if kind == "load":
        truth[0] += 30.0
    _, y = AXIS.simulate(np.zeros(0), u, np.full(690, 0.01), truth)
    block = make_block(t=np.arange(690) * 10**7, u=u, y=y + rng.normal(0, 1.0, y.shape))

    def of(*names: str) -> Problem:
        return Problem(AXIS, (block,), names, prior=START)

    return of("Fc", "Fv"), {"friction": of("Fc", "Fv"), "payload": of("mass")}


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_the_cause_is_what_explains_the_deviation(seed: int) -> None:
    for kind, cause, verdict in (
        ("friction", "friction", "normal"), ("load", "payload", "abnormal"), ("none", "", "normal"),
    ):  # fmt: skip
        problem, competing = axis(kind, seed)
        refits = {name: solve(other) for name, other in competing.items()}
        found = branch(solve(problem), problem, refits)
        assert (found.cause, found.kind) == (cause, verdict), found
        if cause:
            assert found.shares[cause] > 0.8
            assert min(found.shares.values()) < 0.4
            assert cause in found.reason


def test_a_load_that_may_be_tuned_is_normal() -> None:
    problem, competing = axis("load", 0)
    everything = Problem(AXIS, problem.windows, ("Fc", "Fv", "mass"), prior=START)
    refits = {name: solve(other) for name, other in competing.items()}
    fit = solve(everything)
    found = branch(fit, everything, refits)
    assert (found.kind, found.cause) == ("normal", "payload")
    assert fit["mass"] == pytest.approx(120.0, abs=1.0)
    assert branch(fit, everything, refits, frozenset({"Fc"})).kind == "abnormal"


def test_without_refits_the_residual_decides() -> None:
    problem, _ = axis("load", 1)
    found = branch(solve(problem), problem)
    assert (found.kind, found.cause) == ("abnormal", "")
    assert "acceleration" in found.reason
    assert found.evidence["part"] > 0.05
    lenient = branch(solve(problem), problem, rule=Rule(part=2.0))
    assert lenient.kind == "normal"


def test_a_bound_that_is_hit_is_abnormal() -> None:
    rng = np.random.default_rng(0)
    v = commands(rng)
    x = np.cumsum(2.0 * v * DT) + rng.normal(0, 0.001, N)
    block = make_block(t=np.arange(N) * round(DT * 1e9), u=v[:, None], y=x[:, None])
    problem = Problem(ROBOT, (block,), horizon=1.0, prior=GAIN)
    found = branch(solve(problem), problem)
    assert found.kind == "abnormal"
    assert "gain" in found.reason and "bound" in found.reason


def test_a_perfect_model_leaves_nothing_to_explain() -> None:
    rng = np.random.default_rng(0)
    u = rng.uniform(-1, 1, (50, 2))
    _, y = AXIS.simulate(np.zeros(0), u, np.full(50, 0.1), START.values)
    block = make_block(t=np.arange(50), u=u, y=y)
    problem = Problem(AXIS, (block,), ("Fc",), prior=START)
    fit = solve(problem)
    assert explained(fit, fit.noise) == 0.0
    assert branch(fit, problem).kind == "normal"


def test_a_detector_is_scored() -> None:
    t = np.arange(100, dtype=np.int64) * 10**9
    onsets, ends = t[[20, 60]], t[[25, 65]]
    calm = [(int(t[0]), int(t[20])), (int(t[70]), int(t[99]))]
    good = score(t[[22, 61, 80]], onsets, ends, calm)
    assert (good.found, good.false_alarms, good.delays) == (2, 1, (2.0, 1.0))
    assert good.per_month == pytest.approx(1 / 49 * 30 * 86400)
    assert score(t, onsets, ends, calm).false_alarms == 49
    none = score(t[:0], onsets, ends, [])
    assert none.found == 0 and np.isnan(none.per_month)


def test_no_parameters_found_is_abnormal_and_says_why() -> None:
    problem, _ = axis("friction", 2)
    fit = replace(solve(problem), converged=False, message="diverged at row 3")
    found = branch(fit, problem)
    assert found.kind == "abnormal"
    assert "diverged at row 3" in found.reason


def test_a_cause_that_does_not_lead_has_no_name() -> None:
    problem, _ = axis("friction", 3)
    fit = solve(problem)
    assert branch(fit, problem, {"one": fit, "same": fit}).cause == ""


def test_an_output_that_stands_at_zero_has_no_weight() -> None:
    """Its noise is too small a number to divide by; the other output decides."""

    def step(x: Any, u: Any, dt: float, p: Any) -> Any:
        return [], [p[0] * u[0], 0.0]

    both = Layout.of(y="1", still="1")
    model = FunctionModel(step, Layout.of(u="1"), both, parameters=Parameters.of(gain=(1.0, "1")))
    rng = np.random.default_rng(2)
    u = rng.normal(size=(200, 1))
    y = np.column_stack([1.2 * u[:, 0] + rng.normal(0, 0.01, 200), np.zeros(200)])
    problem = Problem(model, (make_block(t=np.arange(200), u=u, y=y),))
    fit = solve(problem)
    assert explained(fit, fit.noise) > 0.99
    assert branch(fit, problem).kind == "normal"
