"""How a twin is, in the words of NAMUR NE 107, and how old what it shows is.

>>> condition = Condition()
>>> condition.told(failed=False, ended=False)["condition"]
'check'
>>> condition.came(1); condition.heard({"kind": "suspected", "reason": "off by 9 %"})
>>> told = condition.told(failed=False, ended=False)
>>> told["condition"], told["why"], told["stale"]
('out_of_specification', 'off by 9 %', False)
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

OUT = ("suspected", "abnormal", "drift", "not_valid")
"""Events after which the machine is not as its twin expects, until it is."""
SOUND = ("normal", "promoted", "valid", "rolled_back")
PERIODS = 3.0
LEAST = 1.0
"""Seconds of silence that are never stale."""


class Condition:
    """Condition and age of one twin. See the module for an example."""

    def __init__(self, stale: float | None = None) -> None:
        """``stale``: seconds of silence; None: by the usual time between samples."""
        self._stale = stale
        self._newest: float | None = None
        self._period = 0.0
        self._out = self._alarm = self._label = ""
        self._since = 0

    def came(self, count: int) -> None:
        """Samples arrived."""
        now = time.monotonic()
        if self._newest is not None:
            self._period += 0.1 * ((now - self._newest) - self._period)
        self._newest = now

    def heard(self, event: Mapping[str, Any]) -> None:
        """An event."""
        kind, reason = str(event["kind"]), str(event["reason"])
        if kind == "labelled":
            self._labelled(event["evidence"])
        elif kind in OUT:
            self._out, self._since, self._label = reason, int(event.get("number", 0)), ""
        elif kind in SOUND:
            self._out = ""
        elif kind in ("alarm", "alarm_cleared"):
            self._alarm = reason if kind == "alarm" else ""

    def _labelled(self, said: Mapping[str, Any]) -> None:
        """A person's word on what is out holds until it is out anew."""
        if not self._out or int(said["event"]) < self._since:
            return
        self._label = str(said["verdict"])
        if self._label == "false alarm":
            self._out = ""

    def told(self, *, failed: bool, ended: bool) -> dict[str, Any]:
        """In plain values: condition, why, what a person said to it, age [s], stale."""
        age = None if self._newest is None else time.monotonic() - self._newest
        limit = self._stale if self._stale is not None else max(PERIODS * self._period, LEAST)
        stale = age is None or age > limit
        condition, why = "good", ""
        if failed:
            condition = "failure"
        elif stale and not ended:
            condition, why = "check", "no samples" if age is None else "samples stay away"
        elif self._out:
            condition, why = "out_of_specification", self._out
        elif self._alarm:
            condition, why = "maintenance_required", self._alarm
        return {
            "condition": condition, "why": why, "stale": stale,
            "label": self._label if condition == "out_of_specification" else "",
            "age": None if age is None else round(age, 3),
        }  # fmt: skip
