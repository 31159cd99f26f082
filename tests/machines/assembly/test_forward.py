"""The forward reading: equal to `Drive`, springs, energy, controller, winding, path."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from evertwin.errors import UsageError
from evertwin.machines.assembly import Forward, assembly, onward, plan
from evertwin.machines.assembly.path import Joints, Limits
from evertwin.machines.drive import Drive
from evertwin.models import check_model
from evertwin.models.configured import configured

TABLE = {"name": "table", "kind": "mass", "axis": 1, "mass": 95.0}
GUIDE = {"name": "guide", "kind": "guide", "axis": 1, "friction": "sign", "Fc": 20.0, "Fv": 200.0}
MOTOR = {"name": "motor", "kind": "motor", "axis": 1, "k": 0.5, "R": 2.0, "J": 2e-4}
SCREW = {"name": "screw", "kind": "ballscrew", "axis": 1, "lead": 0.02, "Fc": 8.0, "Fv": 50.0}
CONTROL = {"name": "control", "kind": "controller", "axis": 1, "kp": 20.0, "kv": 60.0, "ki": 400.0}


def arm(**gearbox: Any) -> list[dict[str, Any]]:
    lines: list[dict[str, Any]] = [{"name": "arm", "kind": "arm", "urdf": "ur5_like"}]
    for j in range(1, 7):
        motor = {"name": f"motor{j}", "kind": "motor", "axis": j, "J": 1e-4 if j < 4 else 3e-5}
        control = {"name": f"control{j}", "kind": "controller", "axis": j, "kp": 20.0}
        box = {"name": f"gearbox{j}", "kind": "gearbox", "axis": j, "ratio": 100.0}
        lines += [{**control, "kv": 300.0, "ki": 2000.0}, {**motor, "k": 0.1}]
        lines.append({**box, "Fc": 3.0, "Fv": 2.0, **gearbox})
    return lines


def ended(model: Forward, u: np.ndarray, dt: float = 0.001) -> np.ndarray:
    p = model.parameters.values
    y = model.simulate(model.initial(p), u, np.full(len(u), dt), p)[1]
    assert isinstance(y, np.ndarray) and not np.isnan(y).any()
    return y


def with_values(model: Forward, **values: float) -> Forward:
    said = {name.replace("__", "."): value for name, value in values.items()}
    return configured(model, parameters=model.parameters.with_values(said))


@pytest.mark.parametrize("law", ["sign", "sign+direction"])
def test_an_assembly_of_one_axis_is_the_drive(law: str) -> None:
    more = {"Fv_back": 40.0} if law != "sign" else {}
    model = assembly([{**GUIDE, "friction": law, "offset": -3.0, **more}, TABLE], "forward")
    reference = Drive(law)
    said = {"mass": 95.0, "Fv": 200.0, "Fc": 20.0, "offset": -3.0, **more}
    p = reference.parameters.with_values(said).values
    rng = np.random.default_rng(0)
    u = np.repeat(rng.uniform(-60, 60, (40, 1)), 50, axis=0)
    dt = np.full(len(u), 0.00100002)
    _, expected = reference.simulate(np.zeros(2), u, dt, p)
    _, y = model.simulate(np.zeros(2), u, dt, model.parameters.values)
    assert (y == expected).all()
    assert (y[:, 1] == 0.0).any()


@pytest.mark.parametrize(
    "lines",
    [
        [GUIDE, TABLE],
        [CONTROL, MOTOR, SCREW, GUIDE, TABLE],
        [{**CONTROL, "ki": 0.0}, MOTOR, SCREW, TABLE],
        [{**MOTOR, "drive": "voltage", "L": 2e-3}, {**SCREW, "kind": "elastic_ballscrew"}, TABLE],
        [{**MOTOR, "drive": "torque"}, {**SCREW, "temperature": "state", "Fc_T": -0.1}, TABLE],
        [CONTROL, TABLE, {**GUIDE, "friction": "tanh"}],
    ],
)
def test_the_laws_of_a_model_hold(
    lines: list[dict[str, Any]], run_as: Callable[[str], None]
) -> None:
    run_as("machine code")
    model = assembly(lines, "forward")
    check_model(model)
    rng = np.random.default_rng(1)
    u, dt = rng.uniform(-1, 1, (12, len(model.inputs))), np.full(12, 0.002)
    p, context = model.parameters.values, model.kernel().context
    x = model.initial(p)
    _, compiled = model.simulate(x, u, dt, p)
    for i in range(12):
        ahead, y = x.copy(), np.zeros(len(model.outputs))
        assert onward.step.plain(context, x, u[i], dt[i], p, ahead, y) == 0
        assert y.tolist() == compiled[i].tolist()
        x = ahead
    y[0] = np.nan
    adopted = x.copy()
    onward.adopt.plain(context, adopted, y)
    assert adopted.tolist() == model.observe(x, y).tolist()


def test_the_laws_of_a_model_hold_for_an_arm() -> None:
    model = assembly(arm(temperature="state"), "forward", sensors=["motor1.current"])
    rng = np.random.default_rng(1)
    check_model(model, rng.uniform(-0.1, 0.1, (12, len(model.inputs))), np.full(12, 0.01))


@pytest.mark.parametrize("more", [{}, {"friction": "tanh+stribeck+root+load", "Fl": 0.3}])
def test_forward_and_inverse_are_one_machine(more: dict[str, Any]) -> None:
    """The torque that the inverse reading asks for moves the arm the same way."""
    bare = [line for line in arm(width=0.5, **more) if not line["name"].startswith("control")]
    forward, inverse = assembly(bare, "forward", step=1e-3), assembly(bare, measure="current")
    limits = Limits((0.6,) * 6, (1.5,) * 6)
    start, end = (0.0, -1.2, 1.5, -1.8, -1.57, 0.0), (0.5, -0.9, 1.1, -1.5, -1.2, 0.4)
    motion = plan([Joints(end)], start, limits, 1000.0, "quintic")
    u = np.concatenate(motion[1:], axis=1)
    p = inverse.parameters.values
    _, current = inverse.simulate(np.zeros(0), u, np.full(len(u), 1e-3), p)
    x = np.concatenate([motion.q[0], motion.qd[0]])
    middle = 0.5 * (current[1:] + current[:-1])
    _, y = forward.simulate(x, middle, np.full(len(middle), 1e-3), p)
    assert y[:, :6] == pytest.approx(motion.q[1:], abs=2e-5)


def test_a_stiff_spring_is_a_rigid_gearbox() -> None:
    t = np.arange(400) * 1e-3
    u = 3.0 * np.sin(2 * np.pi * 4.0 * t)[:, None]
    rigid = ended(assembly([MOTOR, SCREW, TABLE], "forward"), u)
    off = []
    for stiffness in (3e5, 3e6, 3e7):
        soft = {**SCREW, "kind": "elastic_ballscrew", "stiffness": stiffness, "damping": 2e3}
        y = ended(assembly([MOTOR, soft, TABLE], "forward"), u)
        off.append(np.abs(y[:, 0] - rigid[:, 0]).max())
    assert off[0] > 5 * off[1] > 25 * off[2] > 0
    assert off[2] < 3e-4 * np.abs(rigid[:, 0]).max()


def test_a_spring_swings_at_its_frequency() -> None:
    """Two masses on a spring: ω² = K·(1/m + 1/Jr²)."""
    soft = {**SCREW, "kind": "elastic_ballscrew", "friction": "none", "stiffness": 1e5}
    del soft["Fc"], soft["Fv"]
    model = assembly(
        [MOTOR, {**soft, "damping": 0.0}, TABLE], "forward", sensors=["screw.deflection"]
    )
    p = model.parameters.values
    x = model.initial(p)
    x[model.states.names.index("qm1")] = 1e-3
    rotor = 2e-4 * (2 * np.pi / 0.02) ** 2
    period = 2 * np.pi / np.sqrt(1e5 * (1 / 95.0 + 1 / rotor))
    rows = 500
    dt = np.full(rows, 10 * period / rows)
    _, y = model.simulate(x, np.zeros((rows, 1)), dt, p)
    assert y[-1, 2] == pytest.approx(1e-3, rel=2e-3)
    assert y[rows // 20 - 1, 2] == pytest.approx(-1e-3, rel=2e-3)


def test_energy_is_kept() -> None:
    """Electrical energy = losses of winding and friction + energy of motion, spring and coil."""
    soft = {**SCREW, "kind": "elastic_ballscrew", "stiffness": 4e5, "damping": 0.0}
    motor = {**MOTOR, "drive": "voltage", "L": 2e-3}
    show = ["motor.power", "motor.loss", "screw.heat", "guide.heat", "screw.deflection"]
    lines = [motor, soft, {**GUIDE, "friction": "tanh"}, TABLE]
    model = assembly(lines, "forward", sensors=show)
    dt = 1e-4
    t = np.arange(1, 6001) * dt
    u = np.where(t < 0.3, 24.0, -12.0)[:, None]
    p = model.parameters.values
    y = model.simulate(model.initial(p), u, np.full(len(u), dt), p)[1]
    x = model.simulate(model.initial(p), u, np.full(len(u), dt), p)[0]
    put_in, winding, inside, outside = (dt * y[:, 2:6].sum(axis=0)).tolist()
    names = model.states.names
    speed, motor_speed, current = (x[names.index(n)] for n in ("qd1", "qmd1", "motor.current"))
    rotor = 2e-4 * (2 * np.pi / 0.02) ** 2
    kept = 0.5 * (95.0 * speed**2 + rotor * motor_speed**2 + 4e5 * y[-1, 6] ** 2)
    kept += 0.5 * 2e-3 * current**2
    assert put_in == pytest.approx(winding + inside + outside + kept, rel=2e-3)
    assert min(put_in, winding, inside, outside) > 0.5


def test_a_motor_on_voltage_settles_at_ohms_law() -> None:
    motor = {**MOTOR, "drive": "voltage"}
    for coil in (0.0, 1e-3):
        show = ["motor.current", "motor.speed", "screw.friction"]
        model = assembly([{**motor, "L": coil}, SCREW, TABLE], "forward", sensors=show)
        y = ended(model, np.full((4000, 1), 24.0))
        _, v, current, speed, drag = y[-1]
        assert current == pytest.approx((24.0 - 0.5 * speed) / 2.0, rel=1e-6)
        assert 0.5 * current * 2 * np.pi / 0.02 == pytest.approx(drag, rel=1e-4)
        assert speed == pytest.approx(v * 2 * np.pi / 0.02)


def test_the_controller_follows_and_keeps_its_limits() -> None:
    motion = plan([Joints((0.4,))], (0.0,), Limits((0.3,), (1.0,)), 1000.0)
    u = np.concatenate([motion.q, motion.qd], axis=1)
    u = np.concatenate([u, np.tile(u[-1], (800, 1))])
    lines = [{**CONTROL, "feedforward": 1.0}, MOTOR, SCREW, {**GUIDE, "friction": "tanh"}, TABLE]
    show = ["control.error", "motor.current", "control.demand"]
    y = ended(assembly(lines, "forward", sensors=show), u)
    assert np.abs(y[:, 2]).max() < 5e-3
    assert np.abs(y[-1, 0] - 0.4) < 1e-5
    limit = 0.9 * float(np.abs(y[:, 3]).max())
    weak = ended(assembly([{**lines[0], "limit": limit}, *lines[1:]], "forward", sensors=show), u)
    assert np.abs(weak[:, 3]).max() == pytest.approx(limit) and (weak[:, 3] == weak[:, 4]).all()
    slow = ended(
        assembly([{**lines[0], "speed_limit": 0.1}, *lines[1:]], "forward", sensors=show), u
    )
    assert 0.09 < np.abs(slow[:, 1]).max() < 0.11


def test_an_arm_follows_its_planned_path() -> None:
    moves = [{"move": "joints", "to": [0.3, -1.0, 1.3, -1.6, -1.4, 0.2]},
             {"move": "pause", "seconds": 0.3}]  # fmt: skip
    path = {"name": "path", "kind": "path", "moves": moves, "speed": [0.8] * 6,
            "acceleration": [2.0] * 6, "rate": 100.0, "profile": "quintic",
            "start": [0.0, -1.2, 1.5, -1.8, -1.57, 0.0]}  # fmt: skip
    lines = [path, *({**x, "feedforward": 1.0} if "control" in x["name"] else x for x in arm())]
    model = assembly(lines, "forward", sensors=["motor2.current", "control2.error"])
    assert model.inputs.names == ("override",) and model.motion is not None
    rows = len(model.motion.t) - 1
    y = ended(model, np.ones((rows, 1)), 0.01)
    assert y[-1, :6] == pytest.approx(moves[0]["to"], abs=2e-3)
    assert np.abs(y[:, :6] - model.motion.q[1:]).max() < 0.02
    slow = ended(model, np.full((2 * rows, 1), 0.5), 0.01)
    assert slow[1::2, :6] == pytest.approx(model.motion.q[1:], abs=0.02)
    p = model.parameters.values
    stopped = model.simulate(model.initial(p), np.zeros((20, 1)), np.full(20, 0.01), p)[1]
    # the controllers hold the arm where it is, but for what their integrals have not yet taken
    assert stopped[-1, :6] == pytest.approx(model.motion.q[0], abs=0.02)


def test_a_black_box_acts_forward_too() -> None:
    box = {"name": "brake", "kind": "black_box", "axis": 1, "model": {"kind": "drive_force"},
           "inputs": {"speed": "speed", "acceleration": "speed"}, "Fc": 0.0, "Fv": 300.0,
           "mass": 1e-6}  # fmt: skip
    law = {"name": "brake", "kind": "guide", "axis": 1, "friction": "tanh", "Fv": 300.0}
    u = np.full((500, 1), 30.0)
    off = []
    for step in (1e-3, 1e-4):
        boxed = ended(assembly([box, TABLE], "forward", step=step), u)
        plain = ended(assembly([law, TABLE], "forward", step=step), u)
        off.append(np.abs(boxed - plain).max())
    assert off[0] < 2e-3 * np.abs(plain).max() and off[1] < 0.2 * off[0]
    check_model(assembly([box, TABLE], "forward"))


def test_adopting_keeps_the_springs_deflection() -> None:
    soft = {**SCREW, "kind": "elastic_ballscrew"}
    model = assembly([MOTOR, soft, TABLE], "forward")
    x = np.array([0.1, 0.0, 0.101, 0.5])
    seen = model.observe(x, np.array([0.2, np.nan]))
    assert seen.tolist() == pytest.approx([0.2, 0.0, 0.201, 0.5])


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (arm(friction="sign"), "component 'gearbox1': expected a smooth law in an arm"),
        ([{**GUIDE, "friction": "sign+load"}, TABLE], "a share of the load"),
        ([{**MOTOR, "J": 0.0}, {**SCREW, "kind": "elastic_ballscrew"}, TABLE], "rotor inertia J"),
        ([{"name": "p", "kind": "path", "moves": [], "speed": [1.0], "acceleration": [1.0]},
          MOTOR, SCREW, TABLE], "needs a controller"),
        ([{"name": "p", "kind": "path", "moves": [], "speed": [1.0], "acceleration": [1.0]},
          CONTROL, MOTOR, SCREW, TABLE], "component 'p': expected moves"),
        ([{"name": "p", "kind": "path", "speed": [1.0], "acceleration": [1.0],
           "start": [0.0, 1.0]}, CONTROL, MOTOR, SCREW, TABLE], "start with 1 positions, got 2"),
        ([{"name": "b", "kind": "black_box", "axis": 1, "model": {"kind": "drive_force"},
           "inputs": {"speed": "speed", "acceleration": "acceleration"}}, TABLE],
         "no acceleration to read"),
    ],
)  # fmt: skip
def test_what_cannot_move_forward_is_said(lines: list[dict[str, Any]], said: str) -> None:
    with pytest.raises(UsageError, match=said):
        assembly(lines, "forward")


def test_what_cannot_be_asked_forward_is_said() -> None:
    with pytest.raises(UsageError, match="measure belongs to the inverse reading"):
        assembly([GUIDE, TABLE], "forward", measure="current")
    with pytest.raises(UsageError, match="expected step above 0"):
        assembly([GUIDE, TABLE], "forward", step=-1.0)
    # a row that would need more parts than allowed is an error, not a guess
    model = assembly([{**GUIDE, "friction": "tanh", "width": 1e-6}, TABLE], "forward")
    p = model.parameters.values
    assert np.isnan(model.simulate(model.initial(p), np.ones((1, 1)), np.ones(1), p)[1]).all()
