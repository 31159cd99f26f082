"""The inverse reading: equal to `Arm` and `DriveForce`, electrical side, temperature, sensors."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from evertwin.errors import UsageError
from evertwin.fold import make_block
from evertwin.machines.arm import Arm
from evertwin.machines.assembly import Inverse, StaticInverse, assembly, backward, sensors_of
from evertwin.machines.catalog import machine
from evertwin.machines.drive import DriveForce
from evertwin.models import LinearModel, check_model
from evertwin.models.configured import configured
from evertwin.tuning import Problem, held_out

AXIS: list[dict[str, Any]] = [
    {"name": "motor", "kind": "motor", "axis": 1, "k": 0.5, "R": 2.0, "J": 1e-4},
    {"name": "screw", "kind": "ballscrew", "axis": 1, "lead": 0.01, "Fc": 12.0, "Fv": 40.0},
    {"name": "guide", "kind": "guide", "axis": 1, "friction": "sign", "Fc": 5.0, "Fv": 3.0},
    {"name": "table", "kind": "mass", "axis": 1, "mass": 80.0},
    {"name": "part", "kind": "payload", "axis": 1, "mass": 7.0},
]


def arm(**gearbox: Any) -> list[dict[str, Any]]:
    lines: list[dict[str, Any]] = [
        {"name": "arm", "kind": "arm", "urdf": "ur5_like"},
        {"name": "tool", "kind": "payload", "m": 2.0, "mz": 0.1},
    ]
    for j in range(1, 7):
        box = {"name": f"gearbox{j}", "kind": "gearbox", "axis": j, "ratio": 100.0}
        lines.append({"name": f"motor{j}", "kind": "motor", "axis": j, "J": 1e-4 * j, "k": 0.1})
        lines.append({**box, "Fc": 5.0 + j, "Fv": 2.0 * j, **gearbox})
    return lines


def rows(model: Inverse, n: int = 60) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    return rng.uniform(-1.5, 1.5, (n, len(model.inputs))), rng.uniform(0.001, 0.02, n)


@pytest.mark.parametrize("law", ["sign", "tanh+stribeck+load", "tanh+direction+root"])
def test_an_assembly_of_an_arm_is_the_arm(law: str) -> None:
    extra = {"Fs": 3.0, "Fl": 0.05, "Fr": 1.0, "Fv_back": 0.7, "offset": 0.3}
    reference = Arm.of("ur5_like", law=law, payload=True)
    said = {
        name: value for name, value in extra.items() if f"{name}1" in reference.parameters.names
    }
    model = assembly(arm(friction=law, **said))
    values = {"payload.m": 2.0, "payload.mz": 0.1}
    for j in range(1, 7):
        values |= {f"Fc{j}": 5.0 + j, f"Fv{j}": 2.0 * j, f"Ia{j}": 1e4 * 1e-4 * j}
        values |= {f"{name}{j}": value for name, value in said.items()}
    u, dt = rows(model)
    _, tau = model.simulate(np.zeros(0), u, dt, model.parameters.values)
    p = reference.parameters.with_values(values).values
    _, expected = reference.simulate(np.zeros(0), u, dt, p)
    assert np.abs(tau - expected).max() < 1e-10
    assert model.outputs.names == reference.outputs.names
    assert model.inputs == reference.inputs


def test_an_assembly_of_one_axis_is_the_drive() -> None:
    law = "sign+direction"
    lines = [
        {"name": "guide", "kind": "guide", "axis": 1, "friction": law, "Fc": 20.0, "Fv": 200.0,
         "Fv_back": 30.0, "offset": -3.0, "standstill": 0.01},
        {"name": "table", "kind": "mass", "axis": 1, "mass": 95.0},
    ]  # fmt: skip
    model, reference = assembly(lines), DriveForce(law, standstill=0.01)
    said = {"mass": 95.0, "Fv": 200.0, "Fv_back": 30.0, "Fc": 20.0, "offset": -3.0}
    u, dt = rows(model)
    expected = reference.simulate(np.zeros(0), u, dt, reference.parameters.with_values(said).values)
    found = model.simulate(np.zeros(0), u, dt, model.parameters.values)
    assert np.abs(found[1] - expected[1]).max() < 1e-10


@pytest.mark.parametrize("measure", ["effort", "torque", "current", "voltage"])
def test_the_laws_of_a_model_hold(measure: str) -> None:
    sensors = ("motor.current", "guide.friction", "table.load", "screw.friction")
    model = assembly(AXIS, measure=measure, sensors=sensors)
    assert isinstance(model, LinearModel)
    check_model(model)
    whole = assembly([{**arm()[0], "base": True}, *arm(temperature="input")[1:]], measure=measure)
    assert isinstance(whole, StaticInverse)
    check_model(configured(whole, parameters=whole.parameters.with_values({"gearbox2.Fc_T": 0.2})))


def test_the_electrical_side_is_ohm_and_back_emf() -> None:
    """i = τ / k, U = R·i + k·ω, losses R·i², power U·i = mechanical power + losses."""
    names = ["motor.torque", "motor.current", "motor.voltage", "motor.speed", "motor.loss",
             "motor.power", "table.effort"]  # fmt: skip
    model = assembly(AXIS, sensors=names)
    assert not isinstance(model, LinearModel)  # losses are not linear in friction
    u, dt = rows(model)
    _, y = model.simulate(np.zeros(0), u, dt, model.parameters.values)
    effort, torque, current, voltage, speed, loss, power, again = y.T
    assert (effort == again).all()
    assert torque == pytest.approx(effort * 0.01 / (2 * np.pi), rel=1e-12)
    assert current == pytest.approx(torque / 0.5, rel=1e-12)
    assert speed == pytest.approx(u[:, 0] * 2 * np.pi / 0.01, rel=1e-12)
    assert voltage == pytest.approx(2.0 * current + 0.5 * speed, rel=1e-12)
    assert power == pytest.approx(effort * u[:, 0] + loss, rel=1e-9)
    assert loss == pytest.approx(2.0 * current**2, rel=1e-12)


def test_friction_follows_a_measured_temperature() -> None:
    guide = {"name": "guide", "kind": "guide", "axis": 1, "temperature": "input", "Fc": 20.0,
             "Fv": 200.0, "Fc_T": -0.3, "Fv_T": -2.0, "width": 1e-4}  # fmt: skip
    model = assembly([guide, AXIS[3]])
    assert model.inputs.names == ("qd1", "qdd1", "guide.T")
    u = np.array([[0.1, 0.0, 293.15], [0.1, 0.0, 313.15], [-0.1, 0.0, 283.15]])
    _, y = model.simulate(np.zeros(0), u, np.ones(3), model.parameters.values)
    assert y[:, 0] == pytest.approx([40.0, 14.0 + 0.1 * 160.0, -(23.0 + 0.1 * 220.0)])
    check_model(model)


def test_friction_warms_itself_up() -> None:
    guide = {"name": "guide", "kind": "guide", "axis": 1, "temperature": "state", "Fc": 100.0,
             "capacity": 500.0, "conductance": 2.0, "Fc_T": -1.0, "width": 1e-4}  # fmt: skip
    model = assembly([guide, AXIS[3]], sensors=["guide.temperature", "guide.heat"])
    assert not isinstance(model, LinearModel) and model.states.names == ("guide.T",)
    p = model.parameters.values
    u = np.tile([0.5, 0.0], (4000, 1))
    x, y = model.simulate(model.initial(p), u, np.ones(4000), p)
    # settles where heat goes out as fast as it comes in: (100 − ΔT)·0.5 = 2·ΔT
    assert x[0] == pytest.approx(293.15 + 20.0, abs=1e-6)
    assert y[-1] == pytest.approx([80.0, 313.15, 40.0], abs=1e-5)
    assert y[1, 1] - y[0, 1] == pytest.approx(50.0 / 500.0, rel=5e-3)
    check_model(model)


def test_an_arm_may_come_from_its_dh_table() -> None:
    rows = [{"a": 0.4, "mass": 3.0, "com": [-0.2, 0.0, 0.0], "inertia": [0.1] * 3},
            {"a": 0.3, "mass": 2.0, "com": [-0.1, 0.0, 0.0], "inertia": [0.1] * 3}]  # fmt: skip
    arm = {"name": "arm", "kind": "arm", "dh": rows, "gravity": [0.0, -9.81, 0.0]}
    model = assembly([arm])
    assert model.outputs.names == ("tau1", "tau2")
    _, tau = model.simulate(np.zeros(0), np.zeros((1, 6)), np.ones(1), np.zeros(0))
    assert tau[0] == pytest.approx([9.81 * (3 * 0.2 + 2 * 0.6), 9.81 * 2 * 0.2])


def test_one_line_replaces_a_gearbox() -> None:
    for kind, new in (
        ("stribeck_gearbox", {"gearbox3.Fs", "gearbox3.vs"}),
        ("elastic_gearbox", {"gearbox3.stiffness", "gearbox3.damping"}),
    ):
        lines = arm()
        at = next(i for i, line in enumerate(lines) if line["name"] == "gearbox3")
        lines[at] = {**lines[at], "kind": kind}
        names = set(assembly(lines).parameters.names)
        assert names - set(assembly(arm()).parameters.names) == new
        check_model(assembly(lines))


def test_a_black_box_takes_the_place_of_a_gearbox(tmp_path: Any) -> None:
    """Friction from a Python function instead of a law: the same force, also in the kernel."""
    code = """
from evertwin import FunctionModel, Layout, Parameters
import math
def step(x, u, dt, p):
    return [], [p[0] * u[0] + p[1] * math.tanh(u[0] / 0.02)]
model = FunctionModel(step, Layout.of(v="m/s"), Layout.of(drag="N"),
                      parameters=Parameters.of(Fv=(40.0, "Ns/m"), Fc=(12.0, "N")))
"""
    (tmp_path / "drag.py").write_text(code, encoding="utf-8")
    box = {"name": "screw", "kind": "black_box", "axis": 1, "inputs": {"v": "speed"},
           "model": {"kind": "python", "options": {"file": str(tmp_path / "drag.py")}}}  # fmt: skip
    law = {"name": "screw", "kind": "guide", "axis": 1, "Fv": 40.0, "Fc": 12.0}
    model, reference = assembly([box, AXIS[3]]), assembly([law, AXIS[3]])
    assert model.parameters.names == ("screw.Fv", "screw.Fc", "table.mass")
    u, dt = rows(model)
    _, y = model.simulate(np.zeros(0), u, dt, model.parameters.values)
    _, expected = reference.simulate(np.zeros(0), u, dt, reference.parameters.values)
    assert y == pytest.approx(expected, abs=1e-12)
    assert isinstance(model, LinearModel) and model.columns.tolist() == [[2]]
    check_model(model)


def test_a_black_box_may_have_states_and_a_channel_of_its_own() -> None:
    reads = {"heater": "input", "room": "input"}
    box = {"name": "heater", "kind": "black_box", "axis": 1, "model": {"kind": "thermal"}}
    box |= {"output": "box", "inputs": reads}
    model = assembly([box, AXIS[3]])
    assert model.inputs.names == ("qd1", "qdd1", "heater.heater", "heater.room")
    assert model.states.names == ("heater.heater", "heater.box")
    u = np.column_stack([np.zeros((9, 2)), np.ones(9), np.full(9, 293.15)])
    inner = machine("thermal", {})
    p = inner.parameters.values
    _, expected = inner.simulate(inner.initial(p), u[:, 2:], np.ones(9), p)
    p = model.parameters.values
    _, y = model.simulate(model.initial(p), u, np.ones(9), p)
    assert y == pytest.approx(expected, abs=1e-12)
    check_model(model, u)


def test_a_black_box_with_a_ratio_takes_a_whole_gearbox_s_place(tmp_path: Any) -> None:
    code = """
from evertwin import FunctionModel, Layout, Parameters
import math
model = FunctionModel(
    lambda x, u, dt, p: ([], [p[0] * u[0] + p[1] * math.tanh(u[0] / 0.02)]), Layout.of(v="rad/s"),
    Layout.of(drag="Nm"), parameters=Parameters.of(Fv=(4.0, "Nms/rad"), Fc=(7.0, "Nm")))
"""
    (tmp_path / "gear.py").write_text(code, encoding="utf-8")
    box = {"name": "gearbox2", "kind": "black_box", "axis": 2, "inputs": {"v": "speed"},
           "model": {"kind": "python", "options": {"file": str(tmp_path / "gear.py")}},
           "ratio": 100.0}  # fmt: skip
    lines = [box if line["name"] == "gearbox2" else line for line in arm()]
    model, reference = assembly(lines, measure="current"), assembly(arm(), measure="current")
    assert "gearbox2.ratio" in model.parameters.names
    u, dt = rows(model)
    _, y = model.simulate(np.zeros(0), u, dt, model.parameters.values)
    _, expected = reference.simulate(np.zeros(0), u, dt, reference.parameters.values)
    assert y == pytest.approx(expected, abs=1e-12)
    check_model(model)
    screw = [{**box, "axis": 1, "ratio": 0.0, "lead": 0.01}, AXIS[0], AXIS[3]]
    assert assembly(screw, measure="torque").outputs.names == ("m1",)
    with pytest.raises(UsageError, match="axis 2 has a gearbox already"):
        assembly([*arm(), {**box, "name": "second"}])


DRAG = """
import math
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Drag(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.speed, self.drag, self.fc, self.fv = 0.0, 0.0, 12.0, 40.0
        self.register_variable(Real("speed", causality=Fmi2Causality.input))
        self.register_variable(Real("drag", causality=Fmi2Causality.output))
        for name in ("fc", "fv"):
            self.register_variable(Real(
                name, causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))

    def do_step(self, current_time, step_size):
        self.drag = self.fv * self.speed + self.fc * math.tanh(self.speed / 0.02)
        return True
"""


def test_a_black_box_is_replaced_by_an_fmu(tmp_path: Any) -> None:
    """The same one line with another kind: same force, and asked once for all rows."""
    (tmp_path / "drag_slave.py").write_text(DRAG, encoding="utf-8")
    builder = pytest.importorskip("pythonfmu.builder")
    file = builder.FmuBuilder.build_FMU(tmp_path / "drag_slave.py", dest=tmp_path)
    options = {"file": str(file), "memory": "none"}
    box = {"name": "screw", "kind": "black_box", "axis": 1, "inputs": {"speed": "speed"},
           "model": {"kind": "fmu", "options": options}, "fc": 14.0}  # fmt: skip
    law = {"name": "screw", "kind": "guide", "axis": 1, "Fv": 40.0, "Fc": 14.0}
    model, reference = assembly([box, AXIS[3]]), assembly([law, AXIS[3]])
    u, dt = rows(model, 400)
    _, y = model.simulate(np.zeros(0), u, dt, model.parameters.values)
    _, expected = reference.simulate(np.zeros(0), u, dt, reference.parameters.values)
    assert y == pytest.approx(expected, abs=1e-9)
    check_model(model)
    check_model(assembly([box, AXIS[3]], "forward"))


def test_compiled_and_plain_step_agree_bit_for_bit(run_as: Callable[[str], None]) -> None:
    run_as("machine code")
    for model in (
        assembly(AXIS, measure="voltage", sensors=["motor.loss", "guide.heat"]),
        assembly(arm(friction="tanh+load", temperature="state")),
    ):
        u, dt = rows(model, 20)
        p, x = model.parameters.values, model.initial(model.parameters.values)
        context = model.kernel().context
        _, compiled = model.simulate(x, u, dt, p)
        for i in range(20):
            ahead, y = x.copy(), np.zeros(len(model.outputs))
            assert backward.step.plain(context, x, u[i], dt[i], p, ahead, y) == 0
            assert y.tolist() == compiled[i].tolist()
            x = ahead
        assert backward.adopt.plain(context, x, y) == 0


def test_it_survives_another_process() -> None:
    model = assembly(arm())
    u, dt = rows(model, 5)
    p = model.parameters.values
    expected = model.simulate(np.zeros(0), u, dt, p)[1]
    again = pickle.loads(pickle.dumps(model))  # noqa: S301  # our own bytes
    assert (again.simulate(np.zeros(0), u, dt, p)[1] == expected).all()


def test_the_ladder_of_friction_laws_is_climbed_by_component() -> None:
    model = assembly(arm(friction="tanh+stribeck"))
    assert isinstance(model, StaticInverse)
    assert model.rungs()[1].add == ("gearbox2.Fs",) and model.rungs()[1].output == 1
    assert model.law_name(1, ()) == "tanh"


def test_temperature_is_a_step_of_the_ladder_that_has_to_pay() -> None:
    """Planted with and without: the step is taken only where friction changes with warmth."""
    guide = {"name": "guide", "kind": "guide", "axis": 1, "temperature": "input", "Fc": 20.0}
    model = assembly([guide, AXIS[3]])
    assert isinstance(model, StaticInverse)
    assert model.rungs()[-1].add == ("guide.Fv_T", "guide.Fc_T")
    rng = np.random.default_rng(2)
    t = np.arange(4000) * 0.05
    v = 0.3 * np.sin(t) + 0.1 * np.sin(3.1 * t)
    u = np.column_stack([v, np.gradient(v, t), 293.15 + 20 * (1 - np.exp(-t / 60))])
    for change, taken in ((-0.2, True), (0.0, False)):
        p = model.parameters.with_values({"guide.Fc_T": change, "guide.Fv": 50.0}).values
        y = model.simulate(np.zeros(0), u, np.full(4000, 0.05), p)[1]
        y += rng.normal(0, 0.5, y.shape)
        stamps = np.arange(1000) * 200_000_000
        blocks = tuple(make_block(stamps, u[k::4], y[k::4]) for k in range(4))
        names = ("guide.Fv", "guide.Fc", "guide.offset")
        without_it = held_out(Problem(model, blocks, names))[0]
        with_it = held_out(Problem(model, blocks, (*names, *model.rungs()[-1].add)))[0]
        assert bool(with_it < 0.95 * without_it) is taken


def without(name: str) -> list[dict[str, Any]]:
    return [line for line in AXIS if line["name"] != name]


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ([{"kind": "mass"}], "expected a name"),
        ([{"name": "a", "kind": "gearbocks"}], "did you mean 'gearbox'"),
        ([{"name": "a", "kind": "zzz"}], "there are path, controller"),
        ([{"name": "a", "kind": "mass", "axis": "x"}], "component 'a': expected axis = 1"),
        ([{"name": "a", "kind": "mass", "axis": 1, "mas": 3.0}], "did you mean 'mass'"),
        ([{"name": "a", "kind": "mass", "axis": 1, "mass": "much"}], "needs a number"),
        ([{"name": "a", "kind": "mass", "axis": 1, "mass": True}], "needs a number"),
        ([*AXIS, AXIS[3]], "each name once, got 'table' twice"),
        ([*AXIS, {**AXIS[3], "name": "bed"}], "'bed': axis 1 has a structure already, 'table'"),
        (without("table"), "expected a structure"),
        ([*AXIS, {"name": "g2", "kind": "guide", "axis": 2}], "'g2': expected axis = 1 to 1"),
        ([{**AXIS[3], "axis": 2}], "axis 1: expected a mass or an inertia"),
        ([*without("screw"), {"name": "g", "kind": "gearbox", "axis": 1}],
         "'g' gives a rotation, 'table' takes a translation: put a ballscrew"),
        ([*without("table"), {"name": "i", "kind": "inertia", "axis": 1}], "put a gearbox between"),
        ([*arm(), {"name": "m", "kind": "mass", "axis": 1}], "the arm is the structure already"),
        ([*arm(), {"name": "b", "kind": "arm", "urdf": "ur5_like"}], "one arm, got 'arm' and 'b'"),
        ([{"name": "a", "kind": "arm"}], "component 'a': expected urdf"),
        ([{**AXIS[2], "friction": "glue"}, AXIS[3]], "component 'guide': friction: expected"),
        ([{**AXIS[2], "temperature": "warm"}, AXIS[3]], "temperature = 'input' or 'state'"),
        ([{**AXIS[0], "drive": "steam"}, *AXIS[1:]], "expected drive ="),
        ([{"name": "b", "kind": "black_box", "axis": 1}, AXIS[3]], "expected model ="),
        ([{"name": "b", "kind": "black_box", "axis": 1, "model": {"kind": "robot1d"}}, AXIS[3]],
         "say what its inputs read: inputs = { v = \"speed\" }"),
        ([{"name": "b", "kind": "black_box", "axis": 1, "model": {"kind": "robot1d"},
           "inputs": {"v": "colour"}}, AXIS[3]], "its input 'v' can read position"),
        ([{**AXIS[3], "mass": float("nan")}], "expected a number"),
    ],
)  # fmt: skip
def test_what_cannot_be_joined_is_said(lines: list[dict[str, Any]], said: str) -> None:
    with pytest.raises(UsageError, match=said.replace("(", r"\(").replace("{", r"\{")):
        model = assembly(lines)
        model.kernel()


def test_what_cannot_be_read_is_said() -> None:
    with pytest.raises(UsageError, match="expected measure = one of"):
        assembly(AXIS, measure="colour")
    with pytest.raises(UsageError, match="axis 1 has no motor"):
        assembly(AXIS[2:], measure="current")
    with pytest.raises(UsageError, match=r"no virtual sensor 'motor\.amps'"):
        assembly(AXIS, sensors=["motor.amps"])
    with pytest.raises(UsageError, match="step belongs to the forward reading"):
        assembly(AXIS, step=0.1)
    with pytest.raises(UsageError, match="expected reading ="):
        assembly(AXIS, "sideways")
    control = {"name": "control", "kind": "controller", "axis": 1}
    with pytest.raises(UsageError, match="only where commands are followed"):
        assembly([control, *AXIS], sensors=["control.error"])
    assert "motor.loss" in sensors_of(assembly(AXIS).train)
