"""Modelica models: laws, agreement with the same equations written by hand, refusals."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from evertwin.errors import ModelError, UsageError
from evertwin.machines.catalog import machine
from evertwin.machines.thermal import ThermalBox
from evertwin.models import check_model
from evertwin.models.modelica import Limits, Modelica, equations

MACHINES = ("Axis", "StribeckAxis", "MotorAxis", "ThermalBox", "SixJoints")


@pytest.fixture(scope="module")
def built() -> dict[str, Modelica]:
    return {name: Modelica(f"Evertwin.{name}", tolerance=1e-11) for name in MACHINES}


def written(tmp_path: Path, text: str) -> str:
    file = tmp_path / "M.mo"
    file.write_text(text)
    return str(file)


def moved(slopes: Callable[[Any, Any], Any], x: Any, u: np.ndarray, dt: float) -> list[np.ndarray]:
    """Rows of an independent integration."""
    out = []
    for row in u:
        run = solve_ivp(
            lambda t, s, row=row: slopes(s, row), (0, dt), x, "LSODA", rtol=1e-11, atol=1e-12
        )
        x = run.y[:, -1]
        out.append(x)
    return out


@pytest.mark.parametrize("name", MACHINES)
def test_every_machine_of_the_library_keeps_the_laws(name: str) -> None:
    model = Modelica(f"Evertwin.{name}")
    u = np.random.default_rng(0).uniform(-3, 3, (12, len(model.inputs)))
    u += 293.0 * (np.array(model.inputs.names) == "room")
    check_model(model, u)


@pytest.mark.parametrize("name", ["Axis", "StribeckAxis"])
def test_an_axis_agrees_with_its_equation(built: dict[str, Modelica], name: str) -> None:
    model = built[name]
    p = model.parameters.with_values({"gearbox.offset": 0.4})
    peak = p["gearbox.Fs"].value if "gearbox.Fs" in p.names else 0.0

    def slopes(s: Any, u: Any) -> Any:
        v = s[1]
        rub = 2.0 * v + 0.4 + np.tanh(v / 0.02) * (6.0 + peak * np.exp(-((v / 0.2) ** 2)))
        return [v, (100.0 * u[0] - rub) / (2.0 + 100.0**2 * 1e-3)]

    u = np.random.default_rng(1).uniform(-0.4, 0.4, (60, 1))
    expected = moved(slopes, np.zeros(2), u, 0.05)
    _, y = model.simulate(np.zeros(2), u, np.full(60, 0.05), p.values)
    np.testing.assert_allclose(y, expected, atol=1e-7)


def test_an_elastic_axis_with_a_motor_agrees_with_its_equations(
    built: dict[str, Modelica],
) -> None:
    model = built["MotorAxis"]

    def slopes(s: Any, u: Any) -> Any:
        motor, v, q, w = s  # at the slow side
        current = u[0] - 0.1 * 100.0 * v
        spring = 1e4 * (motor - q) + 1.0 * (v - w)
        rub = 2.0 * v + 6.0 * np.tanh(v / 0.02)
        return [v, (10.0 * current - rub - spring) / 10.0, w, spring / 2.0]

    u = np.random.default_rng(2).uniform(-24, 24, (40, 1))
    expected = np.array(moved(slopes, np.zeros(4), u, 0.02))
    p = model.parameters.values
    _, y = model.simulate(model.initial(p), u, np.full(40, 0.02), p)
    assert model.outputs.names == ("q", "v", "current")
    np.testing.assert_allclose(y[:, :2], expected[:, 2:], atol=1e-7)
    np.testing.assert_allclose(y[:, 2], u[:, 0] - 10.0 * expected[:, 1], atol=1e-6)


def test_the_thermal_box_is_the_machine_of_that_name(built: dict[str, Modelica]) -> None:
    box, ours = built["ThermalBox"], ThermalBox()
    names = box.parameters.names
    assert set(names) == set(ours.parameters.names)
    assert box.initials == ours.initials
    rng = np.random.default_rng(3)
    u = np.column_stack([rng.uniform(0, 1, 200), rng.uniform(285, 300, 200)])
    p = ours.parameters.with_values({"heater_start": 310.0})
    q = box.parameters.with_values({n: p[n].value for n in names}).values
    _, y = box.simulate(box.initial(q), u, np.full(200, 3.0), q)
    _, z = ours.simulate(ours.initial(p.values), u, np.full(200, 3.0), p.values)
    # the machine takes fixed steps of the fourth order, at most half a time constant long
    assert np.abs(y - z).max() < 0.02
    fine = np.repeat(u, 100, axis=0)
    _, y = box.simulate(box.initial(q), fine, np.full(20_000, 0.03), q)
    _, z = ours.simulate(ours.initial(p.values), fine, np.full(20_000, 0.03), p.values)
    np.testing.assert_allclose(y, z, atol=1e-6)


def test_six_joints_are_an_array(built: dict[str, Modelica]) -> None:
    model = built["SixJoints"]
    assert model.inputs.names == tuple(f"torque{k}" for k in range(1, 7))
    assert model.parameters["joint4.Fc"].value == 3.0

    def slopes(s: Any, u: Any) -> Any:
        inertia = np.array([3.0, 3.0, 1.5, 0.4, 0.3, 0.1])
        viscous, coulomb = [9.0, 9.0, 5.0, 2.0, 2.0, 1.0], [12.0, 12.0, 8.0, 3.0, 3.0, 2.0]
        v = s[6:]
        rub = np.multiply(viscous, v) + np.multiply(coulomb, np.tanh(v / 0.02))
        return np.concatenate([v, (u - rub) / inertia])

    u = np.random.default_rng(4).uniform(-30, 30, (20, 6))
    expected = moved(slopes, np.zeros(12), u, 0.05)
    p = model.parameters.values
    _, y = model.simulate(model.initial(p), u, np.full(20, 0.05), p)
    np.testing.assert_allclose(y, expected, atol=1e-6)


def test_equal_steps_approach_the_adaptive_ones(built: dict[str, Modelica]) -> None:
    u = np.random.default_rng(1).uniform(-0.4, 0.4, (40, 1))
    model = built["Axis"]
    p, dt = model.parameters.values, np.full(40, 0.05)
    fine = model.simulate(np.zeros(2), u, dt, p)[1]
    errors = []
    for step in (4e-3, 2e-3):
        other = Modelica("Evertwin.Axis", step=step)
        errors.append(np.abs(other.simulate(np.zeros(2), u, dt, p)[1] - fine).max())
    assert errors[1] < errors[0] / 10
    assert errors[1] < 1e-4


def test_measured_outputs_that_are_states_are_adopted(built: dict[str, Modelica]) -> None:
    model = built["MotorAxis"]
    x = model.observe(np.zeros(4), np.array([0.3, np.nan, 7.0]))
    assert x.tolist() == [0.3, 0.0, 0.0, 0.0]


def test_a_model_of_ones_own_may_use_the_library(tmp_path: Path) -> None:
    file = written(
        tmp_path,
        """model Mine
  parameter Real turns(min = 1) = 2 "turns";
  input Real torque(unit = "N.m");
  output Real turned(unit = "rad", start = -0.5);
  Evertwin.TorqueSource source(torque = torque);
  Evertwin.Inertia load(J = 3);
equation
  connect(source.b, load.a);
  turned = -turns * load.a.phi;
end Mine;
""",
    )
    model = machine("modelica", {"file": file})
    p = model.parameters.values
    assert model.parameters["turns"].source == "turns"
    assert model.parameters["turns"].low == 1.0
    assert model.initial(p).tolist() == [-0.5, 0.0]
    _, y = model.simulate(model.initial(p), np.full((2, 1), 3.0), np.ones(2), p)
    np.testing.assert_allclose(y.ravel(), [-1.5, -4.5])


GROUPS = """model Groups
  input Real u;
  parameter Real a = 2;
  Real x(start = 1, fixed = true);
  Real i1; Real i2; Real z(start = 1);
  output Real y;
equation
  a * i1 + i2 * a * 0.5 = u + x;
  a * i1 * 0.25 - a * i2 = x;
  z + z ^ 3 = 2 + x;
  der(x) = i1 - i2 - z;
  y = z + i2;
end Groups;
"""


def test_groups_of_equations_are_solved_while_stepping(tmp_path: Path) -> None:
    model = Modelica(file=written(tmp_path, GROUPS), tolerance=1e-11)
    check_model(model)

    def inner(x: float, u: float) -> tuple[np.ndarray, float]:
        i = np.linalg.solve([[2.0, 1.0], [0.5, -2.0]], [u + x, x])
        roots = np.roots([1.0, 0.0, 1.0, -2.0 - x])
        return i, float(roots[np.abs(roots.imag) < 1e-9].real[0])

    def slopes(s: Any, u: Any) -> Any:
        i, z = inner(s[0], u[0])
        return [i[0] - i[1] - z]

    u = np.random.default_rng(5).uniform(-2, 2, (20, 1))
    states = moved(slopes, np.ones(1), u, 0.1)
    expected = []
    for x, row in zip(states, u, strict=True):
        i, z = inner(x[0], row[0])
        expected.append(z + i[1])
    p = model.parameters.values
    _, y = model.simulate(model.initial(p), u, np.full(20, 0.1), p)
    np.testing.assert_allclose(y.ravel(), expected, atol=1e-8)


ARRAYS = """package P
function grown
  input Real x;
  input Real k[2];
  output Real y;
protected
  Real t;
algorithm
  t := 0.0;
  for i in 1:2 loop
    t := t + x ^ i * k[i];
  end for;
  if t > 1 then
    y := t;
  else
    y := 2 * t;
  end if;
end grown;
model Arrays
  parameter Integer n = 3;
  parameter Real c[n](each unit = "1/s") = {1, 2, 3};
  parameter Real M[2, 2] = [1, 2; 3, 4];
  final parameter Real k = 0.5;
  parameter Real twice = 2 * c[1];
  input Real u[n];
  Real x[n](each start = 0.1);
  output Real o[2];
  output Real s;
equation
  der(x) = -c .* x + u * k;
  o = M * {x[1], grown(x[2], {c[1], twice})};
  s = sum(c[i] * x[i] for i in 1:n) + max(x) + (if noEvent(u[1] > 0) then x[1] else -x[1])
    + cross({1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}) * x + identity(2) * {x[1], x[2]} * {1.0, 1.0}
    + sum(x[2:3]);
end Arrays;
end P;
"""


def test_arrays_loops_and_functions_are_spelled_out(tmp_path: Path) -> None:
    model = Modelica("P.Arrays", written(tmp_path, ARRAYS), tolerance=1e-11)
    assert model.parameters.names == ("c1", "c2", "c3", "M1_1", "M1_2", "M2_1", "M2_2")
    assert model.outputs.names == ("o1", "o2", "s")
    check_model(model)
    c, m, x = np.array([1.5, 2.0, 3.0]), np.array([[1.0, 2.0], [3.0, 4.0]]), np.full(3, 0.1)
    p = model.parameters.with_values({"c1": 1.5}).values
    rows = np.random.default_rng(6).uniform(-2, 2, (20, 3))
    x = moved(lambda s, u: -c * s + 0.5 * u, x, rows, 0.2)[-1]
    _, y = model.simulate(model.initial(p), rows, np.full(20, 0.2), p)
    t = x[1] * 1.5 + x[1] ** 2 * 3.0
    grown = t if t > 1 else 2 * t
    s = c @ x + x.max() + (x[0] if rows[-1, 0] > 0 else -x[0]) + x[2] + x[0] + x[1] + x[1] + x[2]
    np.testing.assert_allclose(y[-1], [*(m @ [x[0], grown]), s], atol=1e-8)


REFUSED = {
    "der(x) = = 1;": (":5: .*unexpected",),
    "der(x) = nowhere;": (":5: unresolved component reference: 'nowhere'",),
    "der(x) = 1 + time;": (":5: depends on time.*as an input",),
    "der(x) = -x; when x > 2 then reinit(x, 0); end when;": (":5: .*event.*smoothly",),
    "der(x) = delay(u, 0.1);": (":5: delay.*OpenModelica",),
    "der(x) = der(u);": (":5: ",),
    "der(x) = 1; der(x) = u;": ("unbalanced|:5: ",),
    "x = u; y = der(x);": (":5: .*derivative of the input u",),
}


@pytest.mark.parametrize("body", REFUSED)
def test_what_is_refused_is_told_with_its_line(tmp_path: Path, body: str) -> None:
    output = "" if "y =" in body else "y = x;"
    text = (
        f"model M\n  input Real u;\n  Real x; output Real y;\nequation\n  {body}{output}\nend M;\n"
    )
    with pytest.raises(ModelError, match=REFUSED[body][0]) as told:
        Modelica(file=written(tmp_path, text))
    assert "M.mo:" in str(told.value)


def test_units_that_are_not_si_are_refused(tmp_path: Path) -> None:
    text = (
        'model M\n  input Real u(unit="deg");\n  output Real y;\nequation\n  der(y) = u;\nend M;\n'
    )
    with pytest.raises(ModelError, match=r"M\.mo:2: expected an SI unit.*'rad'"):
        Modelica(file=written(tmp_path, text))


def test_misuse_is_told(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="there is none"):
        Modelica(file=str(tmp_path / "none.mo"))
    with pytest.raises(UsageError, match="above 0"):
        Modelica("Evertwin.Axis", step=0.0)
    text = "model M\n  Real x;\nequation\n  der(x) = 1;\nend M;\n"
    with pytest.raises(UsageError, match="at least one output"):
        Modelica(file=written(tmp_path, text))


def test_the_compiler_is_ended_after_its_time(tmp_path: Path) -> None:
    file = Path(written(tmp_path, "model M\n  output Real y;\nequation\n  der(y) = 1;\nend M;\n"))
    with pytest.raises(ModelError, match=r"M\.mo:1: .*longer than 0.001 s"):
        equations(file, "M", limits=Limits(seconds=0.001))


def test_a_compiler_without_memory_is_a_refusal(tmp_path: Path) -> None:
    file = Path(written(tmp_path, "model M\n  output Real y;\nequation\n  der(y) = 1;\nend M;\n"))
    with pytest.raises(ModelError, match="ended with code"):
        equations(file, "M", limits=Limits(memory=50 << 20))


def test_a_row_that_cannot_be_stepped_is_an_error(tmp_path: Path) -> None:
    text = (
        "model M\n  input Real u;\n  output Real y(start=1);\nequation\n  der(y) = y^2*u;\nend M;\n"
    )
    model = Modelica(file=written(tmp_path, text))
    _, y = model.simulate(np.ones(1), np.array([[0.5], [9.0], [0.0]]), np.ones(3), np.zeros(0))
    assert y[0, 0] == pytest.approx(2.0)
    assert np.isnan(y[1, 0])
