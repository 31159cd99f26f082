"""What a heading says: which quantity, commanded or measured, of which part.

The words of a heading are compared with those of the field; a stated unit goes before them.

>>> words("actual_qd_0"), words("J1_pos"), words("leftWheelVel")
(['actual', 'qd', '0'], ['j', '1', 'pos'], ['left', 'wheel', 'vel'])
>>> quantity(words("actual_qd_0")), role(words("target_q_0"))
('velocity', 'command')
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from itertools import pairwise

from evertwin.errors import UsageError
from evertwin.signals import compatible
from evertwin.starter.abroad import english

QUANTITIES = {
    "acceleration": {"qdd", "ddq", "acc", "accel", "acceleration", "accelerations", "qddot"},
    "velocity": {
        "qd", "dq", "vel", "velocity", "velocities", "speed", "speeds", "qdot", "omega", "rate",
    },
    "torque": {"tau", "torque", "torques", "effort", "efforts", "moment", "trq", "tq"},
    "current": {"i", "cur", "curr", "current", "currents", "amps", "amp"},
    "temperature": {"temp", "temperature", "temperatures"},
    "force": {"force", "forces", "f"},
    "voltage": {"voltage", "vir", "volt", "volts", "u"},
    "position": {
        "q", "qm", "pos", "position", "positions", "posn", "angle", "angles", "theta", "encoder",
    },
}  # fmt: skip
"""Quantity → the words that name it; the first that has one of a heading's words names it."""

UNITS = {
    "position": ("rad", "m"), "velocity": ("rad/s", "m/s"),
    "acceleration": ("rad/s**2", "m/s**2"), "torque": ("Nm",), "current": ("A",),
    "temperature": ("K",), "force": ("N",), "voltage": ("V",),
}  # fmt: skip

COMMAND = {
    "cmd", "command", "commanded", "commands", "set", "setpoint", "desired", "des", "target", "tgt",
    "ref", "reference", "goal", "demand", "qg", "qref",
}  # fmt: skip
MEASURED = {
    "actual", "act", "measured", "meas", "msr", "feedback", "fb", "odom", "odometry", "encoder",
    "imu", "gyro", "icp", "slam", "pose", "groundtruth", "truth", "sensed", "read", "real", "qm",
}  # fmt: skip
WHEEL = {"wheel", "wheels", "motor", "motors", "left", "right", "rear", "front"}
OTHERS = {
    "delta", "diff", "difference", "increment", "error", "err", "variance", "var", "std", "sigma",
    "ext", "external", "residual", "covariance", "limit", "max", "min", "status", "mode",
}  # fmt: skip
"""What a column with such a word holds is said about the quantity, and is not the quantity."""
_JOINED = re.compile(r"(set|cmd|ref|des|act|meas)(vel|pos|speed|angle|torque|cur)")
_AXIS = re.compile(r"(v)([xyz])")


ENDS = {
    "deg": "deg", "rad": "rad", "mm": "mm", "cm": "cm", "mps": "m/s", "rpm": "rpm", "dps": "deg/s",
    "nm": "Nm", "pct": "%", "percent": "%", "deg c": "degC", "celsius": "degC", "bar": "bar",
    "kpa": "kPa", "kw": "kW", "m s": "m/s", "cm s": "cm/s", "mm s": "mm/s", "rad s": "rad/s",
    "deg s": "deg/s",
}  # fmt: skip
"""Last words of a heading that can be nothing but its unit."""


def said_unit(name: str) -> str:
    """The unit that a heading ends in, or none.

    >>> said_unit("ax1_deg"), said_unit("chamberDegC"), said_unit("rpm"), said_unit("bar")
    ('deg', 'degC', 'rpm', '')
    """
    said = words(name)
    for count in (2, 1):
        end = " ".join(said[-count:])
        if end in ENDS and (len(said) > count or end == "rpm"):
            return ENDS[end]
    return ""


def words(name: str) -> list[str]:
    """The words and numbers of a heading, in lower case and English."""
    spaced = english(re.sub(r"([a-z])([A-Z])", r"\1 \2", name))
    out: list[str] = []
    for word in re.findall(r"[a-z]+|\d+", spaced.lower()):
        found = _AXIS.fullmatch(word) or _JOINED.fullmatch(word)  # vx: v along x
        out += found.groups() if found else (word,)
    return out


def quantity(said: Collection[str], unit: str = "") -> str:
    """Which quantity words and a stated unit name; empty where neither does."""
    for name, units in UNITS.items():
        if unit and any(same_kind(unit, one) for one in units):
            return name
    return next((name for name, known in QUANTITIES.items() if not known.isdisjoint(said)), "")


def role(said: Sequence[str]) -> str:
    """``command``, ``measured``, ``other`` (a difference, a limit …) or empty."""
    if not OTHERS.isdisjoint(said):
        return "other"
    desired = any(a in ("q", "dq", "ddq", "tau") and b == "d" for a, b in pairwise(said))
    if desired or not COMMAND.isdisjoint(said):
        return "command"
    return "" if MEASURED.isdisjoint(said) else "measured"


def same_kind(a: str, b: str) -> bool:
    """Do two units measure the same kind of quantity? No, where one is not known."""
    try:
        return compatible(a, b)
    except UsageError:
        return False
