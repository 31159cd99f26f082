"""Friction terms of another package: one file each, and every machine has them."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin.ahead.path_error import components_of, names_of
from evertwin.config.spec import ModelSpec, TwinSpec
from evertwin.engineering.verify_arm import verify_arm
from evertwin.errors import LawBroken, UsageError
from evertwin.fold import make_block
from evertwin.machines.arm import Arm
from evertwin.machines.assembly import assembly
from evertwin.machines.catalog import machine
from evertwin.machines.drive import Drive, DriveForce
from evertwin.machines.friction import Law, registry
from evertwin.machines.friction.check import check_friction
from evertwin.models import Model, check_model
from evertwin.tuning import Problem, solve
from evertwin.tuning.terms import climb_terms
from evertwin.twin import Twin

pytestmark = pytest.mark.usefixtures("own_terms")
LAW = "tanh+stribeck+power"
TWIN = """
schema = 1
name = "axis"
[model]
kind = "drive_force"
[model.options]
law = "sign+power"
[tuning]
ladder = ["power"]
[[source]]
name = "axis"
time = { column = "t", unit = "s" }
[source.channels]
speed = { column = "v", unit = "m/s" }
acceleration = { column = "a", unit = "m/s^2" }
force = { column = "F", unit = "N" }
"""


def filled(model: Any) -> Any:
    """The model with every coefficient of friction at a value of its own."""
    values = {name: 0.4 + 0.1 * k for k, name in enumerate(model.rubbing)}
    return replace(model, parameters=model.parameters.with_values(values))


def test_they_keep_the_laws_of_the_contract() -> None:
    for name in ("power", "cogging"):
        check_friction(registry.term(name))


def test_every_form_of_machine_takes_them() -> None:
    laws = [LAW, "sign+cogging", "sign", LAW, "sign+power+load", "sign+load"]
    check_model(filled(Arm.of("ur5_like", law=laws)))
    check_model(DriveForce(LAW))
    for law in (LAW, "tanh+cogging", "sign+power+cogging"):
        check_model(Drive(law))
    lines = [
        {"name": "motor", "kind": "motor", "axis": 1, "J": 1e-3},
        {"name": "gear", "kind": "gearbox", "axis": 1, "friction": "tanh+power+cogging", "Fp": 2.0,
         "cog_sin": 0.3, "n": 0.5},
        {"name": "body", "kind": "inertia", "axis": 1},
    ]  # fmt: skip
    for reading in ("inverse", "forward"):
        model = assembly(lines, reading)
        assert model.parameters["gear.n"].value == 0.5 and model.parameters["gear.Fp"].value == 2.0
        check_model(model)


def test_an_arm_and_components_say_the_same() -> None:
    arm = filled(Arm.of("ur5_like", law="tanh+power+cogging"))
    p, names = arm.parameters.values, names_of(arm)
    model = machine("assembly", {"components": components_of(arm, {"urdf": "ur5_like"})})
    given = {names[name]: value for name, value in zip(arm.parameters.names, p)}
    values = {name: v for name, v in given.items() if name in model.parameters.names}
    assert sum(".Fp" in name for name in values) == sum(".n" in name for name in values) == 6
    u = np.random.default_rng(0).uniform(-1.0, 1.0, (20, 18))
    rest, dt = np.zeros(0), np.ones(20)
    own = model.simulate(rest, u, dt, model.parameters.with_values(values).values)[1]
    np.testing.assert_allclose(own, arm.simulate(rest, u, dt, p)[1], atol=1e-9)


def test_the_force_is_what_the_formula_says() -> None:
    axis = DriveForce("sign+power")
    p = axis.parameters.with_values({"Fp": 2.0, "n": 0.5}).values
    _, force = axis.simulate(np.zeros(0), np.array([[0.25, 0.0], [-4.0, 0.0]]), np.ones(2), p)
    assert force[:, 0].tolist() == [1.0, -4.0]


def test_friction_of_other_packages_is_confused_as_it_says() -> None:
    resists = {item.name: item.resists for item in Law.parse("sign+power").parameters()}
    assert resists == {"Fv": False, "Fc": False, "offset": False, "Fp": True, "n": False}


def rows(model: Model, p: np.ndarray, seed: int = 0) -> Any:
    """Rows of an axis that moves at many speeds."""
    rng = np.random.default_rng(seed)
    u = np.stack([rng.uniform(-2.0, 2.0, 400), rng.uniform(-3.0, 3.0, 400)], axis=1)
    y = model.simulate(np.zeros(0), u, np.ones(400), p)[1] + rng.normal(0.0, 0.02, (400, 1))
    return make_block(t=np.arange(400) * 10**7, u=u, y=y)


def test_tuning_finds_the_coefficient_and_the_ladder_the_term() -> None:
    axis = DriveForce("sign+stribeck+power")
    truth = {"mass": 3.0, "Fv": 1.0, "Fc": 2.0, "Fp": 4.0}
    p = axis.parameters.with_values(truth).values
    windows = tuple(rows(axis, p, seed) for seed in range(4))
    names = ("mass", "Fv", "Fc", "offset", "Fp", "Fs")
    power, *others = reversed(axis.rungs())
    ascent = climb_terms(Problem(axis, windows, names), (power, *others))
    assert axis.law_name(0, ascent.taken[0]) == "sign+power"
    found = solve(Problem(axis, windows, ascent.names))
    assert found.values[found.names.index("Fp")] == pytest.approx(4.0, abs=0.2)


def test_verification_and_work_count_it() -> None:
    arm = filled(Arm.of("ur5_like", law=LAW))
    u = np.random.default_rng(0).uniform(-1.0, 1.0, (100, 18))
    good = {check.name: check for check in verify_arm(arm, u, arm.parameters.values)}
    assert good["friction takes power out"].passed and good["torques against MuJoCo"].passed
    p = arm.parameters.with_values({"Fp3": -9.0}).values
    bad = {check.name: check for check in verify_arm(arm, u, p)}
    assert not bad["friction takes power out"].passed


def test_a_twin_file_names_it(tmp_path: Path) -> None:
    """From the file to the fit, the doctor and what is written."""
    axis = DriveForce("sign+power")
    p = axis.parameters.with_values({"mass": 3.0, "Fv": 1.0, "Fc": 2.0, "Fp": 4.0}).values
    (tmp_path / "axis.toml").write_text(TWIN)
    for run in range(3):
        block = rows(axis, p, run)
        table = np.column_stack([np.arange(400) * 0.01, block.u, block.y])
        np.savetxt(tmp_path / f"{run}.csv", table, "%.9g", ",", header="t,v,a,F", comments="")
    files = [str(tmp_path / f"{run}.csv") for run in range(3)]
    with Twin.open(tmp_path / "axis.toml") as twin:
        found = twin.fit(files)
        assert found.laws == {"force": "sign+power"}
        assert found.parameters["Fp"].value == pytest.approx(4.0, abs=0.2)
        assert twin.doctor(files).figures["parameters"]["Fp"]["verdict"] == "identifiable"
        twin.export(tmp_path / "axis.json", "json")
    written = json.loads((tmp_path / "axis.json").read_text())
    assert written["parameters"]["Fp"]["unit"] == "N"


def test_a_urdf_keeps_it(tmp_path: Path) -> None:
    spec = TwinSpec("arm", ModelSpec("arm", {"urdf": "ur5_like", "law": LAW}))
    Twin(spec).export(tmp_path / "arm.urdf", "urdf")
    assert '<parameter name="Fp6" value="0.0" unit="Nm"' in (tmp_path / "arm.urdf").read_text()


@pytest.mark.parametrize(
    ("build", "match"),
    [
        (lambda: DriveForce("sign+load"), "the load that the drive transmits"),
        (lambda: Law.parse("sign+broken"), "expected a FrictionTerm"),
        (lambda: Law.parse("sign+wind"), "no term 'wind'.*cogging"),
    ],
)
def test_what_does_not_fit_is_refused(build: Any, match: str) -> None:
    with pytest.raises(UsageError, match=match):
        build()
    term = import_module("own_terms.broken").TAKEN
    with pytest.raises(UsageError, match="the name 'Fc' is taken"):
        registry.checked(term, "broken", "own_terms.broken:TAKEN")


@pytest.mark.parametrize(
    ("name", "error", "match"),
    [
        ("STEEP", LawBroken, "slope: a rises by 3"),
        ("SILENT", LawBroken, "say in reads"),
        ("WORDS", UsageError, "cannot be compiled"),
    ],
)
def test_the_checker_names_the_law_that_is_broken(
    name: str, error: type[Exception], match: str
) -> None:
    with pytest.raises(error, match=match):
        check_friction(getattr(import_module("own_terms.broken"), name))
