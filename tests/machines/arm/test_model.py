"""The arm as a Model: its laws, recovery of planted truth, payload, delay, currents."""

from __future__ import annotations

import copy
import itertools
import re
from collections.abc import Callable
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evertwin.errors import UsageError
from evertwin.fold import make_block
from evertwin.machines.arm import Arm, kernel
from evertwin.machines.arm.inertia import point
from evertwin.models import Parameters, check_model
from evertwin.tuning import Problem, solve

FULL = "tanh+direction+stribeck+root+load"
OPTIONS: dict[str, dict[str, Any]] = {
    "sign": {},
    "mixed laws": {"law": ["sign", "tanh", "sign+load", FULL, "tanh+root", "sign+stribeck"]},
    "base": {"law": "sign+load", "base": True},
    "payload": {"law": "sign+load", "payload": True},
    "no rotor": {"rotor": False},
    "delayed": {"law": FULL, "delay": True},
    "all": {
        "law": FULL, "base": True, "payload": True, "delay": True,
        "motor": (10.0, 11.0, 12.0, 13.0, 14.0, 15.0),
    },
}  # fmt: skip


def planted(arm: Arm, seed: int = 0) -> Arm:
    """The arm with random true values for everything linear, and a delay where there is one."""
    rng = np.random.default_rng(seed)
    p = arm.parameters.values
    linear = np.unique(arm.columns[arm.columns >= 0])
    p[linear] += rng.normal(size=len(linear))
    if arm.delay:
        p[arm.parameters.index("delay")] = 0.01
    return replace(arm, parameters=arm.parameters.with_values(p))


def motion(rows: int, n: int = 6, seed: int = 3) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-2, 2, (rows, 3 * n))


@pytest.mark.parametrize("case", OPTIONS)
def test_the_laws_of_a_model_hold(case: str) -> None:
    arm = planted(Arm.of("ur5_like", **OPTIONS[case]))
    check_model(arm, motion(60), np.full(60, 0.01))


@pytest.mark.parametrize("case", OPTIONS)
def test_planted_truth_is_recovered(case: str) -> None:
    arm = Arm.of("ur5_like", **OPTIONS[case])
    true = planted(arm)
    u, dt = motion(400), np.full(400, 0.01)
    y = true.simulate(np.zeros(0), u, dt, true.parameters.values)[1]
    # What acts only in sums with others cannot come back; predictions must.
    y0, phi = arm.regressor(np.zeros(0), u, dt, true.parameters.values)
    rows = np.zeros((400, 6, len(arm.parameters)))
    for k, row in enumerate(arm.columns.tolist()):
        for place, column in zip(row, phi[:, k].T, strict=True):
            if place >= 0:
                rows[:, k, place] += column
    found, *_ = np.linalg.lstsq(rows.reshape(2400, -1), (y - y0).ravel(), rcond=None)
    np.testing.assert_allclose(rows @ found + y0, y, atol=1e-7)
    if case not in ("all", "payload"):
        linear = np.unique(arm.columns[arm.columns >= 0])
        np.testing.assert_allclose(found[linear], true.parameters.values[linear], atol=1e-6)


@pytest.mark.parametrize("case", OPTIONS)
def test_the_kernel_and_its_plain_twin_agree(case: str, run_as: Callable[[str], None]) -> None:
    run_as("machine code")
    arm = planted(Arm.of("ur5_like", **OPTIONS[case]))
    u, p = motion(4), arm.parameters.values
    _, compiled = arm.simulate(np.zeros(0), u, np.zeros(4), p)
    for row, y in zip(u, compiled, strict=True):
        plain = np.zeros(6)
        code = kernel.step.plain(arm.kernel().context, np.zeros(0), row, 0.0, p, np.zeros(0), plain)
        assert code == 0
        np.testing.assert_allclose(plain, y, rtol=1e-15, atol=1e-15)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(1, 29), max_size=5))
def test_where_rows_are_cut_does_not_matter(cuts: list[int]) -> None:
    arm = planted(Arm.of("ur5_like", law=FULL, payload=True))
    u, dt, p = motion(30), np.full(30, 0.1), arm.parameters.values
    whole = arm.simulate(np.zeros(0), u, dt, p)[1]
    edges = [0, *sorted(set(cuts)), 30]
    parts = [arm.simulate(np.zeros(0), u[a:b], dt[a:b], p)[1] for a, b in itertools.pairwise(edges)]
    assert np.concatenate(parts).tobytes() == whole.tobytes()


def test_a_payload_is_a_heavier_tool(tmp_path: Path) -> None:
    arm = Arm.of("ur5_like", payload=True)
    p = arm.parameters.values
    first = arm.parameters.index("payload.m")
    p[first : first + 10] = point(3.0, np.array([0.02, 0.0, 0.1]))
    weight = '<link name="tool"><inertial><origin xyz="0.02 0 0.1"/><mass value="3"/>'
    weight += '<inertia ixx="1e-9" iyy="1e-9" izz="1e-9"/></inertial></link>'
    text = files("evertwin.machines").joinpath("data", "ur5_like.urdf").read_text("utf-8")
    path = tmp_path / "heavy.urdf"
    path.write_text(text.replace('<link name="tool"/>', weight), encoding="utf-8")
    heavy = Arm.of(path)
    u, dt = motion(50), np.zeros(50)
    _, with_payload = arm.simulate(np.zeros(0), u, dt, p)
    _, with_tool = heavy.simulate(np.zeros(0), u, dt, heavy.parameters.values)
    np.testing.assert_allclose(with_payload, with_tool, atol=1e-6)


def test_a_delay_looks_back_along_the_motion() -> None:
    arm = Arm.of("ur5_like", law="tanh", delay=True)
    p = arm.parameters.values
    p[arm.parameters.index("Fc1")] = 5.0
    t = np.arange(0, 2, 0.01)[:, None]
    f = np.linspace(0.5, 1.0, 6)

    def at(t: Any) -> Any:
        return np.concatenate([np.sin(f * t), f * np.cos(f * t), -f * f * np.sin(f * t)], axis=1)

    late = arm.simulate(np.zeros(0), at(t - 0.01), np.zeros(200), p)[1]
    p[arm.parameters.index("delay")] = 0.01
    guessed = arm.simulate(np.zeros(0), at(t), np.zeros(200), p)[1]
    p[arm.parameters.index("delay")] = 0.0
    ignored = arm.simulate(np.zeros(0), at(t), np.zeros(200), p)[1]
    assert np.abs(guessed - late).max() < 0.2 * np.abs(ignored - late).max()


def test_currents_are_torques_over_the_constant() -> None:
    k = (10.0, 11.0, 12.0, 13.0, 14.0, 15.0)
    arm, motors = Arm.of("ur5_like"), Arm.of("ur5_like", motor=k)
    u = motion(5)
    _, tau = arm.simulate(np.zeros(0), u, np.zeros(5), arm.parameters.values)
    _, i = motors.simulate(np.zeros(0), u, np.zeros(5), motors.parameters.values)
    np.testing.assert_allclose(i * k, tau, rtol=1e-12)
    assert motors.outputs.units == ("A",) * 6


def test_an_arm_survives_the_way_into_another_process() -> None:
    arm = planted(Arm.of("ur5_like", law=FULL))
    u, p = motion(3), arm.parameters.values
    before = arm.simulate(np.zeros(0), u, np.zeros(3), p)[1]
    again = copy.deepcopy(arm)
    assert "_kernel" not in again.__dict__
    np.testing.assert_array_equal(again.simulate(np.zeros(0), u, np.zeros(3), p)[1], before)


def test_moving_is_judged_joint_by_joint() -> None:
    u = np.zeros((2, 18))
    u[1, 6] = 0.2
    assert Arm.of("ur5_like").moving(0.05)(u).tolist()[1] == [True] + [False] * 5


def test_wrong_options_are_named() -> None:
    with pytest.raises(UsageError, match="arm: no option 'wdth', did you mean 'width'"):
        Arm.of("ur5_like", wdth=0.1)
    with pytest.raises(UsageError, match="expected 6 friction laws"):
        Arm.of("ur5_like", law=["sign"])
    with pytest.raises(UsageError, match="no term 'grease'"):
        Arm.of("ur5_like", law="sign+grease")


def test_sliding_joints_speak_of_forces(tmp_path: Path) -> None:
    path = tmp_path / "slide.urdf"
    path.write_text(
        '<robot name="s"><link name="a"/><link name="b"><inertial><mass value="2"/>'
        '<inertia ixx="1" iyy="1" izz="1"/></inertial></link><joint name="j" type="prismatic">'
        '<parent link="a"/><child link="b"/><axis xyz="0 0 1"/><limit lower="0" upper="1" '
        'velocity="1"/></joint></robot>',
        encoding="utf-8",
    )
    arm = Arm.of(path, motor=(2.0,))
    assert arm.inputs.units == ("m", "m/s", "m/s**2")
    assert {i.name: i.unit for i in arm.parameters} == {
        "Ia1": "kg", "Fv1": "Ns/m", "Fc1": "N", "offset1": "N", "K1": "N/A"
    }  # fmt: skip
    y = arm.simulate(np.zeros(0), np.zeros((1, 3)), np.zeros(1), arm.parameters.values)[1]
    assert y[0, 0] == pytest.approx(9.81)
    assert isinstance(arm.parameters, Parameters)


def test_a_body_that_slow_rows_do_not_excite_stays_as_described() -> None:
    """Friction that no law here has would else be told by inertias of tons."""
    arm = Arm.of("ur5_like", "tanh", base=True)
    t = np.arange(600) * 0.1
    phase = np.outer(t, 0.1 + 0.02 * np.arange(6)) + np.arange(6)
    u = np.concatenate([0.3 * np.sin(phase), 0.03 * np.cos(phase), -3e-3 * np.sin(phase)], axis=1)
    _, tau = arm.simulate(np.zeros(0), u, np.full(600, 0.1), arm.parameters.values)
    dry = 5.0 * np.sign(u[:, 6:12]) * np.minimum(np.abs(u[:, 6:12]) / 0.01, 1.0)
    seen = tau + dry + np.random.default_rng(0).normal(0.0, 0.02, tau.shape)
    fit = solve(Problem(arm, (make_block(t=(t * 1e9).astype(np.int64), u=u, y=seen),)))
    described = arm.parameters.with_values(dict(zip(fit.names, fit.values.tolist(), strict=True)))
    for name in (name for name in fit.names if ".I" in name):
        moved = abs(described[name].value - arm.parameters[name].value)
        assert moved <= 2.0 * arm.parameters[name].sigma


def test_unknown_bodies_are_found_from_rows(tmp_path: Path) -> None:
    """A description without masses gives a geometry, from which torques are found as with them."""
    text = files("evertwin.machines").joinpath("data", "ur5_like.urdf").read_text("utf-8")
    path = tmp_path / "bare.urdf"
    path.write_text(re.sub("<inertial>.*?</inertial>", "", text, flags=re.S), "utf-8")
    with pytest.raises(UsageError, match=r"without a mass, so unknown: .*base = true"):
        Arm.of(path, law="sign")
    bare, true = Arm.of(path, law="sign", base=True), planted(Arm.of("ur5_like", law="sign"))
    assert all(np.isinf(one.sigma) for one in bare.parameters if one.name.startswith("Ia"))
    u, dt = motion(400), np.full(400, 0.01)
    y = true.simulate(np.zeros(0), u, dt, true.parameters.values)[1]
    times = np.arange(400, dtype=np.int64) * 10_000_000
    names = tuple(one.name for one in bare.parameters if one.editable)
    fit = solve(Problem(bare, (make_block(t=times, u=u, y=y),), names))
    assert max(one.rms_after for one in fit.residuals) < 1e-6 * np.abs(y).max()
