"""MuJoCo models: laws, closed forms, recovery, divergence, parameters that are really connected."""

from __future__ import annotations

import math
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evertwin.errors import ModelError, UsageError
from evertwin.fold import make_block
from evertwin.machines.catalog import machine
from evertwin.models import BatchModel, Restart, check_model, python_kernel, roll
from evertwin.models.mujoco import InverseDynamics, MuJoCo
from evertwin.tuning import Problem, solve

RICH = """<mujoco><option timestep="0.002"/><worldbody>
  <geom name="floor" type="plane" size="5 5 1" pos="0 0 -2"/>
  <body name="upper"><joint name="shoulder" axis="0 1 0" damping=".1" frictionloss=".05"/>
    <geom type="capsule" size=".02" fromto="0 0 0 0 0 -.5"/><site name="tip"/>
    <body name="lower" pos="0 0 -.5"><joint name="elbow" axis="0 1 0" damping=".1" armature=".01"/>
      <geom type="capsule" size=".02" fromto="0 0 0 0 0 -.5"/></body></body>
  <body name="ball" pos="1 0 -1.85"><freejoint name="free"/>
    <geom name="ball" type="sphere" size=".1"/></body></worldbody>
  <actuator><motor name="motor" joint="shoulder" gear="2"/>
    <position name="servo" joint="elbow" kp="3" kv=".1"/></actuator>
  <sensor><jointpos name="angle" joint="shoulder"/><jointvel name="rate" joint="elbow"/>
    <accelerometer name="shake" site="tip"/></sensor></mujoco>"""
CART = """<mujoco><option timestep="0.001" gravity="0 0 0"/><worldbody><body name="cart">
  <joint name="rail" type="slide" axis="1 0 0" damping="{damping}"/>
  <geom size=".1" mass="{mass}"/></body></worldbody>
  <actuator><motor name="push" joint="rail"/></actuator></mujoco>"""
PENDULUM = """<mujoco><option timestep="0.002"/><worldbody><body name="rod">
  <joint name="pivot" axis="0 1 0" damping="0.05" {more}/>
  <inertial pos="{com}" mass="{mass}" diaginertia="{inertia}"/></body></worldbody>
  <actuator><motor name="motor" joint="pivot"/></actuator></mujoco>"""


INERTIA = ".03 .03 .02"


def told(mass: float = 1.0, com: str = "0 0 -.3", inertia: str = INERTIA, more: str = "") -> str:
    return PENDULUM.format(mass=mass, com=com, inertia=inertia, more=more)


def pendulum(mass: float = 1.0, com: str = "0 0 -.3", more: str = "", **options: Any) -> MuJoCo:
    return MuJoCo.from_text(told(mass, com, more=more), **options)


@pytest.mark.parametrize(
    "options", [{}, {"parameters": ["*"]}, {"outputs": ["shake.x", "elbow.pos"]}]
)
def test_the_laws_of_a_model_hold(options: dict[str, Any]) -> None:
    model = MuJoCo.from_text(RICH, **options)
    assert isinstance(model, BatchModel)
    rng = np.random.default_rng(1)
    check_model(model, rng.normal(size=(30, 2)), rng.choice([0.01, 0.0033, 0.0], 30))


def test_channels_are_named_by_joint_actuator_and_sensor() -> None:
    model = MuJoCo.from_text(RICH)
    assert model.inputs.names == ("motor", "servo") and model.inputs.units == ("1", "rad")
    assert model.outputs.names == ("angle", "rate", "shake.x", "shake.y", "shake.z")
    assert model.outputs.units == ("rad", "rad/s", "m/s^2", "m/s^2", "m/s^2")
    assert model.states.names[2:9] == tuple(
        f"free.{w}" for w in ("x", "y", "z", "qw", "qx", "qy", "qz")
    )
    bare = MuJoCo.from_text(RICH, inputs=["shoulder.torque", "servo"], outputs=["free.z"])
    assert bare.inputs.units == ("Nm", "rad") and bare.outputs.units == ("m",)


def test_a_cart_follows_its_closed_form() -> None:
    cart = MuJoCo.from_text(CART.format(damping=2.0, mass=4.0))
    p = cart.parameters.values
    _, y = cart.simulate(np.zeros(2), np.full((200, 1), 3.0), np.full(200, 0.01), p)
    t = 0.01 * np.arange(1, 201)
    np.testing.assert_allclose(y[:, 1], 1.5 * (1 - np.exp(-0.5 * t)), atol=2e-3)


def test_intervals_that_the_step_does_not_divide_are_met_exactly() -> None:
    cart = MuJoCo.from_text(CART.format(damping=0.0, mass=1.0))
    dt = np.array([0.0123, 0.0, 0.00017, 0.25])
    x, _ = cart.simulate(np.array([0.0, 2.0]), np.zeros((4, 1)), dt, cart.parameters.values)
    assert x[0] == pytest.approx(2.0 * dt.sum(), abs=1e-12)


@settings(max_examples=20, deadline=None)
@given(st.lists(st.integers(1, 39), max_size=5), st.integers(0, 3))
def test_where_rows_are_cut_does_not_matter(cuts: list[int], seed: int) -> None:
    model = MuJoCo.from_text(RICH)
    rng = np.random.default_rng(seed)
    u, dt, p = rng.normal(size=(40, 2)), rng.choice([0.01, 0.004], 40), model.parameters.values
    end, whole = model.simulate(model.initial(p), u, dt, p)
    x, parts = model.initial(p), []
    for a, b in zip([0, *sorted(set(cuts))], [*sorted(set(cuts)), 40], strict=True):
        x, y = model.simulate(x, u[a:b], dt[a:b], p)
        parts.append(y)
    assert np.concatenate(parts).tobytes() == whole.tobytes() and x.tobytes() == end.tobytes()


@pytest.mark.parametrize(
    ("text", "name", "value"),
    [
        (told(mass=2.5), "body.rod.mass", 2.5),
        (told(com="0 0 -.2"), "body.rod.com_z", -0.2),
        (told(inertia=".03 .045 .02"), "body.rod.inertia_2", 0.045),
        (told(more='frictionloss=".3"'), "joint.pivot.frictionloss", 0.3),
        (told(more='armature=".1"'), "joint.pivot.armature", 0.1),
        (told(more='stiffness="2"'), "joint.pivot.stiffness", 2.0),
    ],
)
def test_a_parameter_does_what_the_file_would(text: str, name: str, value: float) -> None:
    model, other = pendulum(parameters=["*"]), MuJoCo.from_text(text, parameters=["*"])
    u, dt = np.sin(np.arange(300.0))[:, None], np.full(300, 0.004)
    p = model.parameters.with_values({name: value}).values
    _, mine = model.simulate(np.array([0.4, 0.0]), u, dt, p)
    _, theirs = other.simulate(np.array([0.4, 0.0]), u, dt, other.parameters.values)
    _, before = model.simulate(np.array([0.4, 0.0]), u, dt, model.parameters.values)
    np.testing.assert_allclose(mine, theirs, atol=1e-9)
    assert np.abs(mine - before).max() > 1e-3


def test_a_centre_of_mass_on_the_joint_can_be_moved_off_it() -> None:
    """A body centred on its frame is compiled with short cuts; they must not survive."""
    centred, off = pendulum(com="0 0 0", parameters=["body.*"]), pendulum(com=".1 0 -.3")
    p = centred.parameters.with_values({"body.rod.com_x": 0.1, "body.rod.com_z": -0.3}).values
    u, dt = np.zeros((200, 1)), np.full(200, 0.004)
    _, mine = centred.simulate(np.array([0.4, 0.0]), u, dt, p)
    _, theirs = off.simulate(np.array([0.4, 0.0]), u, dt, off.parameters.values)
    np.testing.assert_allclose(mine, theirs, atol=1e-9)


def test_servo_gains_are_written_to_both_of_their_places() -> None:
    text = RICH.replace('kp="3" kv=".1"', 'kp="7" kv=".4"')
    model, other = MuJoCo.from_text(RICH), MuJoCo.from_text(text)
    p = model.parameters.with_values({"actuator.servo.kp": 7.0, "actuator.servo.kv": 0.4}).values
    u, dt = np.ones((100, 2)), np.full(100, 0.01)
    x = model.initial(p)
    np.testing.assert_allclose(
        model.simulate(x, u, dt, p)[1],
        other.simulate(x, u, dt, other.parameters.values)[1], atol=1e-9,
    )  # fmt: skip


def test_a_row_that_diverges_is_nan_and_the_next_goes_on() -> None:
    model = pendulum()
    u, dt, p = np.zeros((40, 1)), np.full(40, 0.01), model.parameters.values
    u[10], u[20], dt[30] = np.nan, 1e12, 1e7
    _, y = model.simulate(np.array([0.3, 0.0]), u, dt, p)
    assert np.flatnonzero(np.isnan(y).any(axis=1)).tolist() == [10, 20, 30]
    good = np.delete(np.arange(40), [10, 20, 30])
    _, straight = model.simulate(np.array([0.3, 0.0]), u[good], dt[good], p)
    assert y[good].tobytes() == straight.tobytes()
    assert np.isnan(model.simulate(np.array([0.3, 0.0]), u, dt, np.full(len(p), np.nan))[1]).all()


def test_a_model_that_blows_up_never_raises(capfd: pytest.CaptureFixture[str]) -> None:
    model = MuJoCo.from_text(CART.format(damping=0.0, mass=1e-6), parameters=["joint.*.stiffness"])
    p = np.array([1e12])
    x, y = model.simulate(np.array([1.0, 0.0]), np.zeros((2000, 1)), np.full(2000, 0.01), p)
    assert np.isnan(y).any() and np.isfinite(x).all()
    assert "unstable" not in "".join(capfd.readouterr())


def test_what_is_measured_is_written_into_the_state() -> None:
    model = MuJoCo.from_text(RICH)
    x = model.observe(
        model.initial(model.parameters.values), np.array([0.5, np.nan, 9.0, 9.0, 9.0])
    )
    assert x[0] == 0.5 and x[10] == 0.0 and not (x == 9.0).any()


def test_runs_in_threads_equal_runs_alone() -> None:
    model = pendulum(parameters=["joint.*", "body.*"], threads=2)
    rng = np.random.default_rng(0)
    p = model.parameters.values * (1 + 0.1 * rng.random((8, len(model.parameters))))
    x, u, dt = np.tile([0.4, 0.0], (8, 1)), rng.normal(size=(100, 1)), np.full(100, 0.01)
    together = model.simulate_batch(x, u, dt, p)
    for j in range(8):
        assert together[j].tobytes() == model.simulate(x[j], u, dt, p[j])[1].tobytes()


def test_restarts_in_a_batch_are_those_of_the_loop() -> None:
    model = pendulum()
    rng, p = np.random.default_rng(0), model.parameters.values
    u, dt = rng.normal(size=(60, 1)), np.full(60, 0.01)
    code = rng.choice([0, 0, 0, 1, 2], 60).astype(np.uint8)
    code[0] = 2
    y = np.where(rng.random((60, 2)) < 0.3, np.nan, rng.normal(size=(60, 2)))
    x = np.array([0.1, 0.2])
    _, one = roll(python_kernel(model), x, u, dt, p, Restart(y, code, x))
    many = model.simulate_batch(x[None], u, dt, p[None], Restart(y, code, x))
    assert many[0].tobytes() == one.tobytes()


def test_planted_damping_and_mass_are_recovered() -> None:
    truth, start = pendulum(mass=1.3), pendulum(parameters=["joint.*.damping", "body.*.mass"])
    rng = np.random.default_rng(0)
    u, dt = rng.normal(size=(400, 1)).cumsum(axis=0) * 0.3, np.full(400, 0.01)
    _, y = truth.simulate(np.zeros(2), u, dt, truth.parameters.values)
    rows = make_block(t=np.arange(400) * 10**7, u=u, y=y + 1e-4 * rng.normal(size=y.shape))
    fit = solve(Problem(start, (rows,), ("joint.pivot.damping", "body.rod.mass"), horizon=1.0))
    found = dict(zip(fit.names, fit.values.tolist(), strict=True))
    assert found["body.rod.mass"] == pytest.approx(1.3, abs=2e-3)
    assert found["joint.pivot.damping"] == pytest.approx(0.05, abs=2e-3)


def test_inverse_dynamics_are_the_torques_that_make_the_motion() -> None:
    sliding = RICH.replace("<freejoint", "<joint type='slide'")
    assert InverseDynamics.from_text(sliding).outputs.units == ("Nm", "Nm", "N")
    check_model(InverseDynamics.from_text(sliding))
    down = InverseDynamics.from_text(told())
    q, v, a = 0.7, 1.1, -0.4
    _, tau = down.simulate(np.zeros(0), np.array([[q, v, a]]), np.zeros(1), down.parameters.values)
    expected = (0.03 + 0.09) * a + 0.05 * v + 9.81 * 0.3 * math.sin(q)
    assert tau[0, 0] == pytest.approx(expected, abs=1e-12)


def test_a_model_survives_a_copy_and_a_pickle() -> None:
    model = pendulum()
    u, dt, p = np.ones((5, 1)), np.full(5, 0.01), model.parameters.values
    again = pickle.loads(pickle.dumps(model))  # noqa: S301  (our own bytes)
    assert again.simulate(np.zeros(2), u, dt, p)[1].tobytes() == (
        model.simulate(np.zeros(2), u, dt, p)[1].tobytes()
    )


def test_a_keyframe_is_the_start() -> None:
    key = '<keyframe><key name="bent" qpos="1 2 0 0 0 1 0 0 0"/></keyframe></mujoco>'
    text = RICH.replace("</mujoco>", key)
    model = MuJoCo.from_text(text, keyframe="bent")
    assert model.initial(model.parameters.values)[:2].tolist() == [1.0, 2.0]
    with pytest.raises(UsageError, match="no 'straight' in the model"):
        MuJoCo.from_text(text, keyframe="straight")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"timestp": 1}, "mujoco: no option 'timestp', did you mean 'timestep'"),
        ({"parameters": ["joint.knee.*"]}, "no parameter matches 'joint.knee.*'"),
        ({"parameters": ["actuator.motor.gian"]}, "there are actuator.motor.gain, actuator.motor"),
        ({"outputs": ["elbow.poz"]}, "did you mean 'elbow.pos'"),
        ({"inputs": ["moter"]}, "did you mean 'motor'"),
    ],
)
def test_options_that_do_not_fit_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        MuJoCo.from_text(RICH, **options)


def test_the_catalogue_builds_both_readings() -> None:
    text = told()
    assert isinstance(machine("mujoco", {"text": text}), MuJoCo)
    assert isinstance(machine("mujoco", {"text": text, "inverse": True}), InverseDynamics)
    with pytest.raises(UsageError, match="expected the option 'file'"):
        machine("mujoco", {})


def test_what_has_a_state_that_is_not_kept_is_refused() -> None:
    with pytest.raises(ModelError, match="1 to 1000 degrees of freedom"):
        MuJoCo.from_text("<mujoco><worldbody/></mujoco>")
    with pytest.raises(ModelError, match="expected a time step"):
        pendulum(timestep=0.0)


AMONG = """<mujoco><option timestep="0.005"/><worldbody><body name="cart" pos="0 0 .1">
<joint name="way" type="slide" axis="1 0 0"/><geom type="cylinder" size=".2 .1" mass="20"/></body>
</worldbody><actuator><velocity name="v" joint="way" kv="200" forcerange="-40 40"/></actuator>
</mujoco>"""


def before_a_table(rows: int, away: float = 2.0) -> np.ndarray:
    """The cart is driven on; a leg of a table stands on its way."""
    table = [away + 0.5 - 0.03, 0.3 - 0.03, 0.0, 1.0, 0.6, 0.03]
    return np.tile([0.3, *table, *np.zeros(6)], (rows, 1))


def test_tables_that_are_inputs_stop_what_is_driven_at_them() -> None:
    model = MuJoCo.from_text(AMONG, tables=2, outputs=["way.pos"], plate={"height": "60 cm"})
    check_model(model)
    assert model.inputs.names[:3] == ("v", "table1.x", "table1.y") and len(model.inputs) == 13
    p, dt = model.parameters.values, np.full(120, 0.1)
    at_leg = model.simulate(model.initial(p), before_a_table(120), dt, p)[1]
    assert at_leg[-1, 0] == pytest.approx(2.0 - 0.03 - 0.2, abs=0.01)
    solid = MuJoCo.from_text(AMONG, tables=2, outputs=["way.pos"], plate={"solid": True})
    assert solid.simulate(solid.initial(p), before_a_table(120), dt, p)[1][-1, 0] < 2.0 - 0.2
    gone = before_a_table(120)
    gone[60:, 1:] = 0.0  # while the cart is on its way
    assert model.simulate(model.initial(p), gone, dt, p)[1][-1, 0] > 3.0


def test_where_rows_are_cut_does_not_matter_among_tables() -> None:
    model = MuJoCo.from_text(AMONG, tables=2)
    u, p, dt = before_a_table(90), model.parameters.values, np.full(90, 0.1)
    u[40:, 1] -= 0.3
    u[55:, 4] = 0.0
    x, whole = model.simulate(model.initial(p), u, dt, p)
    state, parts = model.initial(p), []
    for a, b in ((0, 7), (7, 41), (41, 42), (42, 90)):
        state, y = model.simulate(state, u[a:b], dt[a:b], p)
        parts.append(y)
    assert np.concatenate(parts).tobytes() == whole.tobytes() and state.tobytes() == x.tobytes()


@pytest.mark.parametrize(
    ("options", "message"),
    [({"tables": 40}, "tables: expected 0 to 32"), ({"tables": "two"}, "tables: expected 0 to 32"),
     ({"tables": 1, "plate": {"hight": 1}}, "did you mean 'height'")],
)  # fmt: skip
def test_tables_that_do_not_fit_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        MuJoCo.from_text(AMONG, **options)
