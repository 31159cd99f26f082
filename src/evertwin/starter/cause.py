"""Which of the columns drives a machine of one's own, and which one answers.

A heading says it by its words: a pump, a valve or a command drives, a level or a position answers.
Where words do not tell, a signal in steps is what somebody set: what is measured moves smoothly.

>>> told("Pump (V)"), told("Level lower tank (V)"), told("V1"), told("pump speed")
(1, -1, 0, 0)
>>> levels = np.repeat([0.0, 2.0, 1.0, 3.0], 10)
>>> stepped(levels), stepped(np.sin(np.arange(40.0)))
(True, False)
"""

from __future__ import annotations

import numpy as np

from evertwin.starter.words import QUANTITIES, role, words
from evertwin.types import Vector

IN, OUT = {"u", "in", "input"}, {"y", "out", "output"}
"""First words of a heading that name the one or the other."""
DRIVES = {
    "pump", "valve", "heater", "heating", "fan", "throttle", "servo", "actuator", "drive", "pwm",
    "duty", "esc", "stimulus", "excitation", "input", *QUANTITIES["voltage"],
}  # fmt: skip
ANSWERS = {
    "level", "gap", "height", "displacement", "thrust", "response", *QUANTITIES["temperature"],
    *QUANTITIES["position"], *QUANTITIES["velocity"], "output",
}  # fmt: skip
NAMED = 3
"""What such a word weighs: of several the first is taken."""
HELD, JUMP, ENOUGH = 0.5, 0.05, 20
"""Share of the rows in which a signal in steps stays, its usual step of its spread, and rows."""


def told(name: str) -> int:
    """More than 0: it drives; less: it answers; 0: its heading does not say."""
    said = words(name)
    roles = {"command": 2, "measured": -2}.get(role(said), 0)
    return _first(said) + roles + (not DRIVES.isdisjoint(said)) - (not ANSWERS.isdisjoint(said))


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
