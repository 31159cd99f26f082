"""What validation refuses never goes live: friction that gives power out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin import FunctionModel, Layout, TwinSpec
from evertwin.errors import UsageError
from evertwin.fold import Block, make_block
from evertwin.machines.arm import Arm
from evertwin.machines.drive import Drive, DriveForce
from evertwin.machines.friction.resisting import not_physical
from evertwin.models import Parameters
from evertwin.models.spec import ModelSpec
from evertwin.refit.numbers.physical import embodied, passive, physically
from evertwin.refit.work import Work
from evertwin.setup.setup import Setup
from evertwin.setup.task import Task
from evertwin.tuning import Fit, Problem, solve
from evertwin.twin import Twin

SHIPPED = Path(__file__).parents[2] / "twins" / "arm.toml"
N, RATE = 690, 10.0


def motion(rng: np.random.Generator) -> np.ndarray:
    """Six joints that swing, but for the first, which only moves forwards."""
    t = np.arange(N)[:, None] / RATE
    w, a = rng.uniform(0.3, 0.8, 6), rng.uniform(0.3, 0.9, 6)
    q, v, b = a * np.sin(w * t), a * w * np.cos(w * t), -a * w * w * np.sin(w * t)
    q[:, 0], v[:, 0] = 0.5 * t[:, 0] - 0.5 * np.sin(t[:, 0]), 0.5 - 0.5 * np.cos(t[:, 0])
    b[:, 0] = 0.5 * np.sin(t[:, 0])
    return np.concatenate([q, v, b], axis=1)


def measured(law: str, truth: dict[str, float], seed: int = 1) -> Block:
    """What an arm of this law would measure."""
    rng, arm = np.random.default_rng(seed), Arm.of("ur5_like", law)
    u = motion(rng)
    own = {f"{name}{k}": value for name, value in truth.items() for k in range(1, 7)}
    p = arm.parameters.with_values({n: v for n, v in own.items() if n in arm.parameters.names})
    tau = arm.simulate(np.zeros(0), u, np.zeros(N), p.values)[1] + rng.normal(0, 0.05, (N, 6))
    return make_block(t=np.arange(N) * 10**8, u=u, y=tau)


def opened(folder: Path, tuned: str, fixed: dict[str, str] | None = None) -> Twin:
    """The shipped twin, its friction free of bounds."""
    text = SHIPPED.read_text(encoding="utf-8").replace("low = 0, high = 100, ", "")
    text = text.replace('editable = ["Fc*"]', f"editable = {tuned}")
    for old, new in (fixed or {}).items():
        assert old in text
        text = text.replace(old, new)
    file = folder / "arm.toml"
    file.write_text(text, encoding="utf-8")
    return Twin.open(file)


def work(twin: Twin) -> Work:
    return Work(Setup(twin.spec, twin.model), twin._versions)


def slow_grip() -> Block:
    """What sticks at rest slides with less: a joint that never turns back trades Fc for offset."""
    truth = {"Fc": 3.0, "Fs": 5.0, "vs": 0.02, "width": 1e-4, "Fv": 2.0}
    return measured("tanh+stribeck", truth)


def test_a_fit_that_would_push_is_held_where_friction_resists(tmp_path: Path) -> None:
    with opened(tmp_path, '["Fc*", "Fv*", "offset*"]') as twin:
        rows = slow_grip()
        made = work(twin)
        problem = made.problem(twin._versions[0], (rows,), made.editable(twin._versions[0]))
        free, (_, held, _) = solve(problem), made.tune(problem)
        assert free["Fc1"] < -0.5 < 0 < free["offset1"]
        assert "joint 1 gives power out" in not_physical(problem.model, free.p, (rows,))
        assert held["Fc1"] == 0.0 and not not_physical(problem.model, held.p, (rows,))
        k = held.names.index("Fc1")
        assert held.verdict[k] == "weak" and "held at 0" in held.reasons[k]
        assert "Fc1 held at 0" in str(held)
        # the other joints tell dry friction from an offset, and keep what they had
        assert held["Fc3"] == pytest.approx(free["Fc3"], rel=1e-6)


def test_a_term_that_a_fit_turns_round_stays_out() -> None:
    rng, axis = np.random.default_rng(0), DriveForce("sign+stribeck")
    v = rng.uniform(-1.0, 1.0, (600, 1))
    u, truth = np.concatenate([v, 0.0 * v], axis=1), {"Fc": 8.0, "Fv": 5.0, "Fs": -3.0}
    p = axis.parameters.with_values(truth).values
    y = axis.simulate(np.zeros(0), u, np.zeros(600), p)[1] + rng.normal(0, 0.05, v.shape)
    rows = make_block(t=np.arange(600) * 10**8, u=u, y=y)
    problem = Problem(axis, (rows,), ("Fv", "Fc", "Fs"))
    fit, _ = physically(problem, lambda one: (solve(one), {}))
    assert solve(problem)["Fs"] < -2.5 and fit["Fs"] == 0.0 and not fit.at_bound
    k = fit.names.index("Fs")
    assert fit.verdict[k] == "weak" and "stribeck is no such effect" in fit.reasons[k]


def test_what_cannot_be_held_is_refused_with_its_reason(tmp_path: Path) -> None:
    fixed = {'value = "{10, 10, 8, 2, 2, 2}"': 'value = "{-18.4, 10, 8, 2, 2, 2}"'}
    with opened(tmp_path, '["Fc*"]', fixed) as twin:
        rows, version = measured("tanh", {"Fc": 5.0, "Fv": 4.0}), twin._versions[0]
        content: Any = work(twin).content(Task("fit", version, (rows,), 0))
        assert content.get("candidate") is None
        said = [event["reason"] for event in content["events"]]
        assert any("joint 1 gives power out" in one and "Fv1 = -18.4" in one for one in said)


def test_a_push_is_neither_promoted_nor_pinned_by_hand(tmp_path: Path) -> None:
    with opened(tmp_path, '["Fc*", "Fv*"]') as twin:
        form = twin._versions[0].form
        bad = twin._ledger.keep(form, {"Fv1": -18.4, "Fc1": -4.9}, "by hand").number
        good = twin._ledger.keep(form, {"Fv1": 8.0, "Fc1": 4.9}, "by hand").number
        for make_live in (twin.promote, twin.pin):
            with pytest.raises(UsageError, match=r"not physical: joint 1 .* Fv1 = -18.4"):
                make_live(bad)
        assert twin.champion.number == 0
        twin.promote(good)
        assert twin.champion.number == good


def test_physical_machines_are_not_refused() -> None:
    rng = np.random.default_rng(7)
    arm = Arm.of("ur5_like", "tanh")
    names = tuple(n for n in arm.parameters.names if n[:2] in ("Fc", "Fv"))
    u = motion(rng)[::5]
    bounded = 0

    def tune(problem: Problem) -> tuple[Fit, dict[str, Any]]:
        return solve(problem), {}

    for _ in range(100):
        truth = dict(zip(names, rng.uniform(0.0, 12.0, len(names)).tolist(), strict=True))
        p = arm.parameters.with_values(truth).values
        _, tau = arm.simulate(np.zeros(0), u, np.zeros(len(u)), p)
        y = tau + rng.normal(0, 0.1, tau.shape)
        rows = make_block(t=np.arange(len(u)) * 10**8, u=u, y=y)
        fit, _ = physically(Problem(arm, (rows,), names), tune)
        assert not not_physical(arm, fit.p, (rows,)), fit.message
        assert not fit.at_bound
        bounded += "held" in fit.message
        for name in names:
            assert abs(fit[name] - truth[name]) < 0.5
    assert bounded <= 5


@pytest.mark.parametrize("machine", [DriveForce(), Drive()])
def test_a_drive_says_at_which_speeds(machine: DriveForce | Drive) -> None:
    v = np.linspace(-1.0, 1.0, 21)
    u = np.stack([v, np.zeros(21)], axis=1)[:, : len(machine.inputs)]
    y = np.stack([np.zeros(21), v], axis=1)[:, : len(machine.outputs)]
    rows = make_block(t=np.arange(21) * 10**8, u=u, y=y)
    p = machine.parameters.with_values({"Fv": -10.0, "Fc": 5.0, "offset": 50.0}).values
    said = not_physical(machine, p, (rows,))
    assert "from 0.6 to 1 m/s" in said and "Fv = -10" in said


def test_a_product_of_inertia_may_be_below_zero() -> None:
    arm = Arm.of("ur5_like", base=True)
    names = [name for name in arm.parameters.names if name.endswith(".Ixz")]
    p = arm.parameters.with_values(dict.fromkeys(names, -0.2)).values
    assert names and not passive(arm, p, dict.fromkeys(names, 0.1))
    (moment, *_) = (name for name in arm.parameters.names if name.endswith(".Izz"))
    p = arm.parameters.with_values({moment: -0.2}).values
    assert moment in passive(arm, p, {moment: 0.1})


def test_a_body_below_zero_is_held_and_friction_is_adopted() -> None:
    """Rows that hardly tell a moment: noise would put it below zero and the friction with it."""
    rng, t = np.random.default_rng(3), np.arange(4000) * 0.01
    arm = Arm.of("ur5_like", base=True)
    q = 0.5 * np.sin(np.outer(t, np.linspace(0.7, 1.9, 6)))
    v = np.gradient(q, t, axis=0)
    u = np.concatenate([q, v, np.gradient(v, t, axis=0)], axis=1)
    moment = [n for n in arm.parameters.names if n.endswith(".Izz")][-1]
    grown = {f"Fc{j}": 6.0 for j in range(1, 7)}
    p = arm.parameters.with_values(grown | {moment: -0.02}).values
    y = arm.simulate(np.zeros(0), u, np.full(4000, 0.01), p)[1] + rng.normal(0, 0.01, (4000, 6))
    rows = make_block(t=(t * 1e9).astype(np.int64), u=u, y=y)
    spec = TwinSpec("arm", ModelSpec("arm", {"urdf": "ur5_like", "base": True}))
    with Twin(spec) as twin:
        work = Work(Setup(twin.spec, twin.model), twin._versions)
        names = (*grown, *(f"Fv{j}" for j in range(1, 7)), moment)
        start = work.problem(twin.champion, (rows,), names)
        problem, fit, _ = embodied(start, work.tune)
    assert start.parameters[moment].value > 0
    assert moment not in fit.names and "below zero is no body" in fit.message
    assert [fit[name] for name in grown] == pytest.approx([6.0] * 6, abs=0.2)
    assert not passive(problem.model, fit.p, {moment: start.parameters[moment].value})


def test_no_machine_has_a_mass_below_zero() -> None:
    """Whatever the bounds of a model of one's own let a fit do with crossed columns."""
    parameters = Parameters.of(J=(2e-4, "kg*m^2"), offset=(0.5, "N*m"), R=(1.3, "ohm"))
    model = FunctionModel(
        lambda x, u, dt, p: (x, u), Layout.of(u="V"), Layout.of(i="A"), parameters=parameters
    )
    before = {"J": 2e-4, "offset": 0.5, "R": -1.0}  # what was below zero may stay there
    assert passive(model, np.array([-1e-4, -0.5, -1.3]), before) == "J -0.0001 kg*m^2"
    assert not passive(model, np.array([1e-4, -0.5, -1.3]), before)


@pytest.mark.parametrize("root", [28.0, -28.0])
def test_of_friction_only_the_sum_has_to_resist(root: float) -> None:
    """v^0.6 is told by a root with a viscous term below zero, and resists at every speed."""
    axis, v = DriveForce("sign+root"), np.linspace(-1.0, 1.0, 21)
    p = axis.parameters.with_values({"Fv": -5.7, "Fc": 5.5, "Fr": root}).values
    u = np.stack([v, np.zeros(21)], axis=1)
    rows = make_block(t=np.arange(21) * 10**8, u=u, y=np.zeros((21, 1)))
    assert not passive(axis, p, {"Fv": 11.8, "Fc": 13.5})
    assert bool(not_physical(axis, p, (rows,))) == (root < 0)


@pytest.mark.parametrize("joint", [1, 3, 5])
def test_a_joint_of_which_no_row_tells_leaves_the_others_tuned(joint: int) -> None:
    """As one that stands all the while, where rows count that move."""
    arm, rows = Arm.of("ur5_like", "tanh", base=True), measured("tanh", {"Fc": 5.0, "Fv": 4.0})
    rows.y[:, joint] = np.nan
    fit = solve(Problem(arm, (rows,), arm.parameters.editable))
    assert np.isfinite(fit.values).all() and fit.converged
    others = [k for k in range(1, 6) if k != joint]
    assert [fit[f"Fv{k + 1}"] for k in others] == pytest.approx([4.0] * 4, rel=0.1)
    assert fit.verdict[fit.names.index(f"Fc{joint + 1}")] == "not"
