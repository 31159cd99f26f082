"""Verification finds planted mistakes, passes sound models, and says what it could not look at."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from evertwin.engineering import verify_arm as arm_checks
from evertwin.engineering import verify_machines as machine_checks
from evertwin.engineering.validation import verify
from evertwin.engineering.verification import Check, VerificationReport
from evertwin.engineering.verify_arm import verify_arm
from evertwin.errors import MissingExtra
from evertwin.machines.arm import Arm
from evertwin.machines.arm.inertia import of_body
from evertwin.machines.catalog import machine
from evertwin.models import FunctionModel, Parameters
from evertwin.models.configured import configured
from evertwin.signals import Layout

WRIST = np.eye(6)
WRIST[4, 3], WRIST[5, 4] = -0.02, -1.0
ARMS: dict[str, dict[str, Any]] = {
    "bare": {},
    "everything": {
        "law": "tanh+stribeck+load", "base": True, "payload": True, "delay": True,
        "motor": (10.0,) * 6,
    },
    "coupled": {"coupling": WRIST.tolist(), "motion": "motor", "payload": True},
    "coupled, measured at the joints": {"coupling": WRIST.tolist(), "base": True},
}  # fmt: skip
MUJOCO = """<mujoco><worldbody><body><joint name="j" axis="0 1 0" damping=".1"/>
  <geom type="capsule" size=".02" fromto="0 0 0 0 0 -.5"/></body></worldbody></mujoco>"""


def motion(rows: int = 300) -> np.ndarray:
    return np.random.default_rng(0).uniform(-1, 1, (rows, 18))


def set_up(**options: Any) -> tuple[Arm, np.ndarray]:
    arm = Arm.of("ur5_like", **options)
    names, p = arm.parameters.names, arm.parameters.values
    for j in range(6):
        for name, value in (("Ia", 0.5), ("Fc", 3.0), ("Fv", 2.0), ("offset", 0.3)):
            p[names.index(f"{name}{j + 1}")] = value
    if "payload.m" in names:
        first = names.index("payload.m")
        p[first : first + 10] = of_body(3.0, np.array([0.02, 0.0, 0.1]), 0.01 * np.eye(3))
    return arm, p


def named(checks: tuple[Check, ...]) -> dict[str, Check]:
    return {check.name: check for check in checks}


@pytest.mark.parametrize("case", ARMS)
def test_an_arm_agrees_with_mujoco_and_with_the_laws(case: str) -> None:
    arm, p = set_up(**ARMS[case])
    found = named(verify_arm(arm, motion(), p))
    assert all(check.passed for check in found.values()), "\n".join(map(str, found.values()))
    assert found["torques against MuJoCo"].figure < 1e-11
    assert found["mass matrix against MuJoCo"].limit == 1e-12
    assert found["gravity against MuJoCo"].figure < 1e-12


def test_a_wrong_inertia_in_the_kernel_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    arm, p = set_up()
    wrong = replace(arm.chain, inertia=arm.chain.inertia * (1.0 + 1e-6))
    whole = arm_checks.mjcf_of
    monkeypatch.setattr(arm_checks, "mjcf_of", lambda chain, on=True: whole(wrong, on))
    found = named(verify_arm(arm, motion(), p))
    for name in ("torques against MuJoCo", "mass matrix against MuJoCo", "gravity against MuJoCo"):
        assert not found[name].passed


def test_friction_that_gives_power_out_is_found_with_its_joint() -> None:
    arm, p = set_up()
    p[arm.parameters.index("Fv4")] = -9.0
    check = named(verify_arm(arm, motion(), p))["friction takes power out"]
    assert not check.passed and "joint 4 gives power out" in check.said


def test_a_point_on_the_axis_of_the_last_joint_is_told_and_stops_nothing() -> None:
    rows = [
        {"a": 0.3, "mass": 2.0, "com": [-0.1, 0, 0], "inertia": [0.01, 0.02, 0.02]},
        {"d": 0.1, "mass": 0.2, "com": [0, 0, 0.04]},
    ]
    arm = Arm.of(dh=rows)
    u = np.random.default_rng(0).uniform(-1, 1, (300, 6))
    found = named(verify_arm(arm, u, arm.parameters.values))
    assert "turns no inertia" in found["energy of a free motion"].said
    assert found["power balance"].passed and not found["energy of a free motion"].ran


def test_base_parameters_that_no_body_has_are_told() -> None:
    arm, p = set_up(base=True)
    k = next(k for k, name in enumerate(arm.parameters.names) if name.endswith(".Izz"))
    p[k] = -5.0
    found = named(verify_arm(arm, motion(), p))
    assert "those of no body" in found["torques against MuJoCo"].said
    assert found["torques against MuJoCo"].passed


def test_energy_that_is_not_kept_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    arm, p = set_up()
    right = arm_checks.Rigid.energy

    def off(self: Any, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        return right(self, q, v) * np.array([1.01, 1.0])

    monkeypatch.setattr(arm_checks.Rigid, "energy", off)
    found = named(verify_arm(arm, motion(), p))
    assert not found["power balance"].passed and not found["energy of a free motion"].passed


def test_without_mujoco_the_rest_is_checked_and_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(*_: Any) -> Any:
        raise MissingExtra.of("mujoco", "mujoco")

    monkeypatch.setattr(arm_checks, "machine", absent)
    arm, p = set_up()
    report = VerificationReport("arm", verify_arm(arm, motion(), p))
    assert report.passed and len(report.not_run) == 3
    assert "pip install 'evertwin[mujoco]'" in str(report)


SOUND: dict[str, tuple[str, dict[str, Any]]] = {
    "robot": ("differential", {}),
    "wheels": ("differential", {"wheels": True}),
    "line": ("robot1d", {}),
    "omni": ("omni", {}),
    "odometer": ("odometer", {}),
    "box": ("thermal", {}),
    "box with a wall": ("thermal", {"wall": True}),
    "axis": ("drive", {"law": "sign+direction"}),
    "axis, smooth": ("drive", {"law": "tanh+stribeck"}),
    "axis, force": ("drive_force", {}),
    "MuJoCo": ("mujoco", {"text": MUJOCO}),
}


@pytest.mark.parametrize("case", SOUND)
def test_sound_machines_pass_and_the_missing_engine_is_named(case: str) -> None:
    kind, options = SOUND[case]
    model = machine(kind, options)
    p = model.parameters.values
    for name in ("Fc", "Fv"):
        if name in model.parameters.names:
            p[model.parameters.index(name)] = 0.3
    low = np.clip([c.low for c in model.inputs], -1.0, None)
    u = np.random.default_rng(0).uniform(low, low + 1.0, (200, len(low)))
    report = verify(model, u, np.full(200, 0.01), p)
    assert report.passed, str(report)
    assert "independent engine" in [check.name for check in report.not_run]
    assert json.loads(json.dumps(report.to_dict(), allow_nan=False))["passed"] is True


def test_a_drive_whose_two_readings_differ_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    class Stronger(machine_checks.DriveForce):
        def simulate(self, *rows: Any) -> Any:
            x, force = super().simulate(*rows)
            return x, 1.1 * force

    monkeypatch.setattr(machine_checks, "DriveForce", Stronger)
    axis = machine("drive", {})
    found = named(verify(axis, np.zeros((20, 1)), np.full(20, 0.01)).checks)
    assert not found["forward and inverse agree"].passed


def test_heat_that_comes_from_nowhere_is_found() -> None:
    box = machine("thermal", {"wall": True})
    items = tuple(
        replace(item, low=-1e9) if item.name == "wall_capacity" else item for item in box.parameters
    )
    free = configured(box, parameters=Parameters(items))
    p = free.parameters.with_values({"wall_capacity": -300.0, "wall_start": 300.0}).values
    found = named(verify(free, np.tile([0.0, 290.0], (50, 1)), np.full(50, 3.0), p).checks)
    assert not found["heat flows from warm to cold"].passed


def test_steps_that_are_too_long_are_found() -> None:
    euler = FunctionModel(
        lambda x, u, dt, p: ([x[0] - dt * 30.0 * (x[0] - u[0])],) * 2,
        Layout.of(u="1"), Layout.of(y="1"), Layout.of(y="1"), start=(1.0,),
    )  # fmt: skip
    u = np.random.default_rng(0).normal(size=(100, 1))
    fine = named(verify(euler, u, np.full(100, 1e-4)).checks)["half the step"]
    coarse = named(verify(euler, u, np.full(100, 0.05)).checks)["half the step"]
    assert fine.passed and not coarse.passed


def test_a_model_that_runs_away_at_rest_is_found() -> None:
    wild = FunctionModel(
        lambda x, u, dt, p: ([x[0] + dt * (x[0] + u[0])],) * 2,
        Layout.of(u="1"), Layout.of(y="1"), Layout.of(y="1"), start=(1e-3,),
    )  # fmt: skip
    found = named(verify(wild, np.zeros((20, 1)), np.full(20, 0.01)).checks)
    assert not found["rest"].passed


def test_a_broken_contract_is_a_finding_and_no_exception() -> None:
    rng = np.random.default_rng(0)
    noisy = FunctionModel(
        lambda x, u, dt, p: ([], [u[0] + rng.normal()]), Layout.of(u="1"), Layout.of(y="1")
    )
    report = verify(noisy, np.zeros((20, 1)), np.full(20, 0.01))
    assert not report.passed and "purity" in str(report)


def test_a_figure_that_is_no_number_is_not_passed() -> None:
    assert not Check("x", "law", float("nan"), 1.0).passed
    assert not Check("x", "law", float("inf"), 1.0).passed
