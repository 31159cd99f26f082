"""Which of the columns drives a machine of one's own, and which one answers.

A heading says it by its words: a pump, a valve or a command drives, a level or a position answers.
Tags name it, too: what a controller puts out and a valve drive, its process value answers
(ISA-5.1; with DIN, y drives, w commands and x answers). What is around a machine answers to none.
Where words do not tell, a signal in steps is what somebody set: what is measured moves smoothly.

>>> told("Pump (V)"), told("Level lower tank (V)"), told("V1"), told("pump speed")
(1, -1, 0, 0)
>>> told("valve position [%]"), told("Ventilstellung V7")
(1, 1)
>>> told("SIC-101.OUT"), told("FIC-101.PV"), told("FV-101.ZT"), told("TT-7", "degC")
(2, -2, 1, -1)
>>> told("Zone1.Y", "%", {"Zone1.X": "degC", "Zone1.Y": "%"})
2
>>> levels = np.repeat([0.0, 2.0, 1.0, 3.0], 10)
>>> stepped(levels), stepped(np.sin(np.arange(40.0)))
(True, False)
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from evertwin.starter.looks.words import AMBIENT, QUANTITIES, role, same_kind, words
from evertwin.types import Vector

IN, OUT = {"u", "in", "input"}, {"y", "out", "output"}
"""First words of a heading that name the one or the other."""
DRIVES = {
    "pump", "valve", "heater", "heating", "fan", "throttle", "servo", "actuator", "drive", "pwm",
    "duty", "esc", "stimulus", "excitation", "input", "inflow", "outflow", *QUANTITIES["voltage"],
}  # fmt: skip
ANSWERS = {
    "level", "gap", "height", "displacement", "thrust", "response", *QUANTITIES["temperature"],
    *QUANTITIES["position"], *QUANTITIES["velocity"], "output",
}  # fmt: skip
NAMED = 4
"""What such a first word weighs, more than all others: of several the first is taken."""
PUT_OUT = {"out", "op", "mv", "cv", "co"}
"""How the tag of what a controller puts out ends."""
_CONTROLLER = re.compile(r"(?<![A-Za-z])[FLPTSQAWZJ]D?IC[-_ ]?\d+\w*[._/ -]([A-Za-z]+)$")
_VALUE = re.compile(r"(?<![A-Za-z])[A-Z]{2,4}[-_ ]?\d+\w*[._/ -](?i:pv)$")
_VALVE = re.compile(r"(?<![A-Za-z])[FLPTQ]C?V[-_ ]?\d{2,}")
_LOOP = re.compile(r"(.*[._/ ])([XYW])")
"""Tags as in FIC-101.PV and PCV-204, and the letters of a loop."""
HELD, JUMP, ENOUGH = 0.5, 0.05, 20
"""Share of the rows in which a signal in steps stays, its usual step of its spread, and rows."""


def told(name: str, unit: str = "", beside: Mapping[str, str] = MappingProxyType({})) -> int:
    """More than 0: it drives; less: it answers; 0: its heading does not say.

    ``beside``: all headings, with their units.
    """
    said = words(name)
    roles = _of_loop(name, beside) or {"command": 2, "measured": -2}.get(role(said), 0)
    drives = not DRIVES.isdisjoint(said) or _VALVE.search(name) is not None
    moved = QUANTITIES["position"] if "valve" in said else set[str]()  # what it is set to
    answers = not (ANSWERS - moved).isdisjoint(said) or same_kind(unit, "K")
    return _first(said) + roles + drives - (answers and AMBIENT.isdisjoint(said))


def _of_loop(name: str, beside: Mapping[str, str]) -> int:
    """What a controller's tag says of one of its signals."""
    if _VALUE.search(name) is not None:
        return -2
    tag = _CONTROLLER.search(name)
    if tag is not None:
        return 2 if tag[1].lower() in PUT_OUT else 0
    one = _LOOP.fullmatch(name)
    if one is None:
        return 0
    actual, output = (beside.get(f"{one[1]}{letter}") for letter in "XY")
    if actual is None or output is None or actual == output:  # places have one unit
        return 0
    return -2 if one[2] == "X" else 2


def _first(said: list[str]) -> int:
    begins = set(said[:1])
    return NAMED * ((not IN.isdisjoint(begins)) - (not OUT.isdisjoint(begins)))


def stepped(values: Vector) -> bool:
    """Does a signal stay where it is, but for jumps that are far more than its resolution?"""
    known = values[np.isfinite(values)]
    if len(known) < ENOUGH:
        return False
    steps = np.abs(np.diff(known))
    jumps = steps[steps > 0.0]
    if not len(jumps) or np.mean(steps == 0.0) < HELD:
        return False
    return float(np.median(jumps)) > JUMP * float(np.ptp(known))
