"""The channels of a MuJoCo model: what goes in, what comes out, what it remembers.

States are all positions, then velocities, then activations, by joint: ``elbow.pos elbow.vel``; a
free joint has ``x y z qw qx qy qz`` and ``vx … wz``, a ball its quaternion and ``wx wy wz``.
Inputs are the actuators by name, or where there is none the joint torques ``elbow.torque``
(``elbow.force`` where it slides). Outputs are the sensors by name (``force.x`` where one has
several numbers), or where there is none all positions and velocities.

With the option ``tables`` so many places for tables on legs follow among the inputs: ``table1.x
.y .heading`` in the world, ``.length .width`` around the legs, ``.leg``, a leg's radius; a length
of 0 says that none stands there. ``plate`` says the rest: ``height`` (0.72 m) of its upper side,
``overhang`` (0 m), ``solid`` (false: legs; true: a box down to the floor).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import mujoco

from evertwin.models.mujoco.knobs import name_of
from evertwin.signals.channels import Channel, Layout

_FREE, _BALL, _SLIDE, _HINGE = range(4)
_QUATERNION = ("qw", "qx", "qy", "qz")
_POSITIONS = {_FREE: ("x", "y", "z", *_QUATERNION), _BALL: _QUATERNION}
_SPEEDS = {_FREE: ("vx", "vy", "vz", "wx", "wy", "wz"), _BALL: ("wx", "wy", "wz")}


class Output(NamedTuple):
    """Where an output is read.

    >>> Output(Channel("elbow.pos", "rad"), 0, True).kept
    True
    """

    channel: Channel
    place: int
    """Place in the state, or among the sensors' numbers."""
    kept: bool
    """Is it a number of the state itself, so that a measurement can be written back?"""


def states(model: Any) -> Layout:
    """Positions, velocities, activations, (nq + nv + na)."""
    positions, speeds = [], []
    for j in range(model.njnt):
        name, kind = name_of(model, "joint", j), int(model.jnt_type[j])
        unit = "m" if kind == _SLIDE else "rad"
        for word in _POSITIONS.get(kind, ("pos",)):
            own = "m" if word in "xyz" else "1" if word in _QUATERNION else unit
            positions.append(Channel(f"{name}.{word}", own))
        for word in _SPEEDS.get(kind, ("vel",)):
            own = "m/s" if word[:2] in ("vx", "vy", "vz") else f"{unit}/s"
            speeds.append(Channel(f"{name}.{word}", own))
    acts = [Channel(f"activation{k + 1}", "1") for k in range(model.na)]
    return Layout((*positions, *speeds, *acts))


def controls(model: Any) -> Layout:
    """All that can drive the model: its actuators, then a force on every degree of freedom."""
    channels = []
    for a in range(model.nactuator):
        name, many = name_of(model, "actuator", a), int(model.actuator_ctrlnum[a])
        names = [name] if many == 1 else [f"{name}.{k + 1}" for k in range(many)]
        unit = _unit_of(model, a) if many == 1 else "1"
        channels += [Channel(text, unit) for text in names]
    for channel in states(model).channels[model.nq : model.nq + model.nv]:
        joint, word = channel.name.rsplit(".", 1)
        kind = "force" if channel.unit == "m/s" else "torque"
        tail = "" if word == "vel" else f"_{word[1]}"
        channels.append(Channel(f"{joint}.{kind}{tail}", "N" if kind == "force" else "Nm"))
    return Layout(tuple(channels))


def _unit_of(model: Any, a: int) -> str:
    """A motor of gain and gear 1 is told its torque, a servo its aim; others are told a number."""
    if int(model.actuator_trntype[a]) != int(mujoco.mjtTrn.mjTRN_JOINT):
        return "1"
    kind = int(model.jnt_type[int(model.actuator_trnid[a, 0])])
    gain, bias = model.actuator_gainprm[a], model.actuator_biasprm[a]
    slides, unscaled = kind == _SLIDE, float(model.actuator_gear[a, 0]) == 1.0
    if gain[0] == 1.0 and unscaled and not bias.any():
        return "N" if slides else "Nm"
    if unscaled and bias[1] == -gain[0] != 0.0:
        return "m" if slides else "rad"
    if unscaled and bias[2] == -gain[0] != 0.0:
        return "m/s" if slides else "rad/s"
    return "1"


_SENSOR_UNITS = {
    "JOINTACTFRC": "Nm", "JOINTLIMITFRC": "Nm", "FRAMEPOS": "m", "FRAMELINVEL": "m/s",
    "FRAMEANGVEL": "rad/s", "FRAMELINACC": "m/s^2", "FRAMEANGACC": "rad/s^2", "GYRO": "rad/s",
    "ACCELEROMETER": "m/s^2", "VELOCIMETER": "m/s", "FORCE": "N", "TORQUE": "Nm", "TOUCH": "N",
    "RANGEFINDER": "m", "SUBTREECOM": "m", "SUBTREELINVEL": "m/s", "BALLANGVEL": "rad/s",
    "TENDONPOS": "m", "TENDONVEL": "m/s", "E_POTENTIAL": "J", "E_KINETIC": "J",
    "GEOMDIST": "m", "MAGNETOMETER": "T",
}  # fmt: skip


def outputs(model: Any, names: Sequence[str] | None = None) -> tuple[Output, ...]:
    """The outputs called ``names`` (states and sensors), by default all sensors, else all states.

    Raises:
        UsageError: there is no such output; names the nearest one.
    """
    own = [Output(c, k, True) for k, c in enumerate(states(model).channels)]
    seen = [output for s in range(model.nsensor) for output in _sensor(model, s)]
    if names is None:
        return tuple(seen or own[: model.nq + model.nv])
    # Where a sensor is named like a state, the sensor is meant.
    every = {o.channel.name: o for o in (*own, *seen)}
    layout = Layout(tuple(o.channel for o in every.values()))
    return tuple(every[layout.channels[layout.index(name)].name] for name in names)


def _sensor(model: Any, s: int) -> list[Output]:
    name, size = name_of(model, "sensor", s), int(model.sensor_dim[s])
    word = mujoco.mjtSensor(int(model.sensor_type[s])).name.removeprefix("mjSENS_")
    if word in ("JOINTPOS", "JOINTVEL") and not model.sensor_cutoff[s] > 0:
        return [_joint_sensor(model, name, int(model.sensor_objid[s]), word == "JOINTPOS")]
    if word == "CLOCK":
        return []  # rows know their duration, not the time
    unit, at = _SENSOR_UNITS.get(word, "1"), int(model.sensor_adr[s])
    if word in ("JOINTACTFRC", "JOINTLIMITFRC") and _slides(model, int(model.sensor_objid[s])):
        unit = "N"
    tails = {1: ("",), 3: (".x", ".y", ".z"), 4: (".w", ".x", ".y", ".z")}
    named = tails.get(size, tuple(f".{k + 1}" for k in range(size)))
    return [Output(Channel(name + tail, unit), at + k, False) for k, tail in enumerate(named)]


def _slides(model: Any, joint: int) -> bool:
    return int(model.jnt_type[joint]) == _SLIDE


def _joint_sensor(model: Any, name: str, joint: int, position: bool) -> Output:
    """A sensor that shows a number of the state."""
    at = int(model.jnt_qposadr[joint]) if position else model.nq + int(model.jnt_dofadr[joint])
    unit = ("m" if _slides(model, joint) else "rad") + ("" if position else "/s")
    return Output(Channel(name, unit), at, True)
