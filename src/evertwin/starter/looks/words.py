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
from evertwin.signals.units import powers
from evertwin.sources.columns.description import ColumnInfo
from evertwin.starter.looks.abroad import english

QUANTITIES = {
    "acceleration": {"qdd", "ddq", "acc", "accel", "acceleration", "accelerations", "qddot"},
    "velocity": {
        "qd", "dq", "vel", "velo", "velocity", "velocities", "speed", "speeds", "spd", "qdot",
        "omega", "rate",
    },
    "torque": {"tau", "torque", "torques", "effort", "efforts", "moment", "trq", "tq"},
    "current": {"i", "cur", "curr", "current", "currents", "amps", "amp"},
    "temperature": {"temp", "temperature", "temperatures"},
    "force": {"force", "forces", "f"},
    "voltage": {"voltage", "vir", "volt", "volts", "u"},
    "position": {
        "q", "qm", "pos", "position", "positions", "posn", "angle", "angles", "theta", "encoder",
        "enc",
    },
}  # fmt: skip
"""Quantity → the words that name it; the first that has one of a heading's words names it."""

UNITS = {
    "position": ("rad", "m"), "velocity": ("rad/s", "m/s"),
    "acceleration": ("rad/s**2", "m/s**2"), "torque": ("Nm",), "current": ("A",),
    "temperature": ("K",), "force": ("N",), "voltage": ("V",),
}  # fmt: skip

COMMAND = {
    "cmd", "command", "commanded", "commands", "set", "setpoint", "sp", "desired", "des", "target",
    "tgt",
    "ref", "reference", "goal", "demand", "qg", "qref",
}  # fmt: skip
MEASURED = {
    "actual", "act", "measured", "meas", "msr", "feedback", "fb", "odom", "odometry", "encoder",
    "enc", "imu", "gyro", "icp", "slam", "pose", "groundtruth", "truth", "sensed", "read", "real",
    "qm",
}  # fmt: skip
WHEEL = {"wheel", "wheels", "motor", "motors", "left", "right", "rear", "front"}
OTHERS = {
    "delta", "diff", "difference", "increment", "error", "err", "variance", "var", "std", "sigma",
    "ext", "external", "residual", "covariance", "limit", "max", "min", "status", "mode",
}  # fmt: skip
"""What a column with such a word holds is said about the quantity, and is not the quantity."""
HEATER = {"heater", "heating", "heat"}
AMBIENT = {"ambient", "amb", "room", "outside", "outdoor", "environment", "env", "surroundings"}
"""Of the air around a machine."""
_JOINED = re.compile(r"(set|cmd|ref|des|act|meas)(vel|pos|speed|angle|torque|trq|cur)")
_AXIS = re.compile(r"(v)([xyz])")
_PREFIXED = re.compile(r"(?<![A-Za-z])[km](Pa|[AVWN])(?![A-Za-z])")
"""A unit with its prefix, whose capital begins no word: ``force_kN``."""

ENDS = {
    "deg": "deg", "rad": "rad", "mm": "mm", "cm": "cm", "mps": "m/s", "rpm": "rpm", "dps": "deg/s",
    "mmps": "mm/s", "radps": "rad/s", "degps": "deg/s",
    "um": "um", "m ah": "mAh", "ah": "Ah", "m ohm": "mOhm", "mohm": "mOhm", "ohm": "ohm",
    "nm": "Nm", "pct": "%", "percent": "%", "deg c": "degC", "celsius": "degC", "bar": "bar",
    "kpa": "kPa", "mpa": "MPa", "mbar": "mbar", "psi": "psi", "kw": "kW", "kn": "kN",
    "m s": "m/s", "cm s": "cm/s", "mm s": "mm/s", "rad s": "rad/s", "deg s": "deg/s",
    "m/min": "m/min", "l/min": "l/min", "lpm": "l/min", "m3/h": "m^3/h", "m3/min": "m^3/min",
    "m3/s": "m^3/s", "l s": "l/s", "km h": "km/h", "kmh": "km/h",
    "u/min": "rpm", "1/min": "rpm", "upm": "rpm",
    "m s 2": "m/s^2", "mm s 2": "mm/s^2", "rad s 2": "rad/s^2", "deg s 2": "deg/s^2",
    "deg f": "degF", "grad c": "degC", "prozent": "%", "grad": "deg",
}  # fmt: skip
"""Last words of a heading that can be nothing but its unit."""
LETTERS = {
    "a": {"current": "A"}, "ma": {"current": "mA"}, "n": {"force": "N"}, "v": {"voltage": "V"},
    "mv": {"voltage": "mV"}, "c": {"temperature": "degC"}, "k": {"temperature": "K"},
    "f": {"temperature": "degF"}, "m": {"position": "m"}, "w": {"power": "W"},
}  # fmt: skip
"""A letter that is a unit where the words before it name the quantity that it measures."""
_PLACES = {
    "x", "y", "z", "distance", "east", "north", "easting", "northing", "height", "depth", "stroke",
    "level", "gap", "displacement", "travel",
}  # fmt: skip
_POWERS = {"power", "heater", "heating"}
_RATES = re.compile(r"(?:^|_)(m|l|u|1)_(min)$|(?:^|_)[ns]?(m)_(3)_(h|s|min)$")
"""Rates in a heading's last words: a minute is no minimum there, the 3 of a volume no number; a
normal or standard volume counts as one."""
_BEHIND = re.compile(
    r"\S\s+([kMGmcu]?(?:g|t|Pa|W|N|V|A|J|Hz|Nm|Wh|m|s|K|bar|l)\d?/(?:s|min|h|kg|m\d?|K)|[kM]W|kWh|kg"
    r"|Hz|rpm|Nm|Pa|mA|kV|kA|kJ|kN|MN|°C|°F)"
)
"""Text behind a blank that can be nothing but a unit."""
_MACHINES = {"drive", "base", "robot", "bot"}
"""Before these such a word names a kind of machine: a differential drive is no difference."""
_ACTIVE = {"power", "pwr"}
"""Before these ``act`` is active, not actual."""


def said_unit(name: str) -> str:
    """The unit that a heading ends in, or none.

    >>> said_unit("ax1_deg"), said_unit("chamberDegC"), said_unit("rpm"), said_unit("bar")
    ('deg', 'degC', 'rpm', '')
    >>> said_unit("FI_NET Nm3/min"), said_unit("LOAD kg"), said_unit("VFD_%")
    ('m^3/min', 'kg', '%')
    >>> said_unit("drive setpoint 1/min"), said_unit("n_U/min")
    ('rpm', 'rpm')
    >>> said_unit("flow_m3h"), said_unit("belt_m_min"), said_unit("current_mA"), said_unit("A")
    ('m^3/h', 'm/min', 'mA', '')
    >>> said_unit("J1_acc_deg/s2"), said_unit("acc_m_s2"), said_unit("acc rad/s^2")
    ('deg/s^2', 'm/s^2', 'rad/s^2')
    """
    if name.rstrip().endswith("%"):
        return "%"
    said = words(name)
    behind = _BEHIND.fullmatch(name[name.rstrip().rfind(" ") - 1 :].rstrip()) if said else None
    for count in (3, 2, 1):
        end = " ".join(said[-count:])
        if end in ENDS and (len(said) > count or end == "rpm"):
            return ENDS[end]
    if behind is not None:
        return behind[1]
    what = _measured(said[:-1])
    return LETTERS.get(said[-1], {}).get(what, "") if said else ""


def _measured(said: Sequence[str]) -> str:
    """The quantity that words before a unit of one letter name."""
    if said and (said[0] == "t" or "temperature" in said):
        return "temperature"
    if not _POWERS.isdisjoint(said):
        return "power"
    return quantity(said) or ("position" if not _PLACES.isdisjoint(said) else "")


def words(name: str) -> list[str]:
    """The words and numbers of a heading, in lower case and English."""
    whole = _PREFIXED.sub(lambda unit: unit[0].lower(), name)
    spaced = english(re.sub(r"([a-z])([A-Z])", r"\1 \2", whole))
    out: list[str] = []
    for word in re.findall(r"[a-z]+|\d+", spaced.lower()):
        found = _AXIS.fullmatch(word) or _JOINED.fullmatch(word)  # vx: v along x
        out += found.groups() if found else (word,)
    rate = _RATES.search("_".join(out))
    if rate is not None:
        over, under = (rate[1], rate[2]) if rate[1] else ("m3", rate[5])
        out[-2 if rate[1] else -3 :] = [f"{over}/{under}"]
    return out


def is_temperature(column: ColumnInfo) -> bool:
    """Does a unit, or a name, say that it is a temperature?"""
    said = words(column.name)
    if column.unit:
        return same_kind(column.unit, "K")
    return (said[:1] == ["t"] and len(said) > 1) or not QUANTITIES["temperature"].isdisjoint(said)


def quantity(said: Collection[str], unit: str = "") -> str:
    """Which quantity words and a stated unit name; empty where neither does. A share is of any."""
    for name, units in UNITS.items():
        if unit and not _share(unit) and any(same_kind(unit, one) for one in units):
            return name
    return next((name for name, known in QUANTITIES.items() if not known.isdisjoint(said)), "")


def _share(unit: str) -> bool:
    """Is it a number alone, such as ``%``? An angle is not."""
    try:
        return not powers(unit)
    except UsageError:
        return False


def role(said: Sequence[str]) -> str:
    """``command``, ``measured``, ``other`` (a difference, a limit …) or empty."""
    if any(a in OTHERS and b not in _MACHINES for a, b in pairwise([*said, ""])):
        return "other"
    desired = any(a in ("q", "dq", "ddq", "tau") and b == "d" for a, b in pairwise(said))
    if desired or not COMMAND.isdisjoint(said):
        return "command"
    rest = [a for a, b in pairwise([*said, ""]) if a != "act" or b not in _ACTIVE]
    return "" if MEASURED.isdisjoint(rest) else "measured"


def same_kind(a: str, b: str) -> bool:
    """Do two units measure the same kind of quantity? No, where one is not known."""
    try:
        return compatible(a, b)
    except UsageError:
        return False
