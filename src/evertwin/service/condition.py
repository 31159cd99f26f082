"""How a twin is, in the words of NAMUR NE 107, and how old what it shows is.

>>> condition = Condition({"camera": math.inf})
>>> condition.told(failed=False)["condition"]
'check'
>>> condition.came("camera"); condition.heard({"kind": "suspected", "reason": "off by 9 %"})
>>> told = condition.told(failed=False)
>>> told["condition"], told["why"], told["stale"]
('out_of_specification', 'off by 9 %', False)
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Collection, Mapping
from typing import Any

OUT = ("suspected", "abnormal", "drift", "not_valid")
"""Events after which the machine is not as its twin expects, until it is."""
SOUND = ("normal", "promoted", "valid", "rolled_back")
ERRORS, SPAN = 5, 600.0
"""Measurements of a channel that were refused within so many seconds, from which on its sensor is
to be looked at."""
PERIODS = 3.0
LEAST = 1.0
"""Seconds of silence that are never stale."""


class Condition:
    """Condition and age of one twin. See the module for an example."""

    def __init__(self, timeouts: Mapping[str, float], stale: float | None = None) -> None:
        """``timeouts``: by source [s], infinite where its rows wait for it; ``stale``: seconds of
        silence; None: by the usual time between samples."""
        self._timeouts, self._stale = timeouts, stale
        self._newest: dict[str, float] = {}
        self._period: dict[str, float] = {}
        self._out = self._alarm = self._label = ""
        self._since = 0
        self._errors: dict[str, deque[float]] = {}

    def came(self, source: str) -> None:
        """Samples of one source arrived."""
        now = time.monotonic()
        before, period = self._newest.get(source, now), self._period.get(source, 0.0)
        self._newest[source] = now
        self._period[source] = period + 0.1 * ((now - before) - period)

    def heard(self, event: Mapping[str, Any]) -> None:
        """An event."""
        kind, reason = str(event["kind"]), str(event["reason"])
        if kind == "labelled":
            self._labelled(event["evidence"])
        elif kind in OUT:
            self._out, self._since, self._label = reason, int(event.get("number", 0)), ""
        elif kind in SOUND:
            self._out = ""
        elif kind == "measurement_error":
            newest = self._errors.setdefault(str(event.get("signal", "")), deque(maxlen=ERRORS))
            newest.append(time.monotonic())
        elif kind in ("alarm", "alarm_cleared"):
            self._alarm = reason if kind == "alarm" else ""

    def _labelled(self, said: Mapping[str, Any]) -> None:
        """A person's word on what is out holds until it is out anew."""
        if not self._out or int(said["event"]) < self._since:
            return
        self._label = str(said["verdict"])
        if self._label == "false alarm":
            self._out = ""

    def told(self, *, failed: bool, over: Collection[str] = ()) -> dict[str, Any]:
        """In plain values: condition, why, what a person said to it, age [s], stale.

        Args:
            failed: is it in quarantine?
            over: sources that have ended, which nobody waits for.
        """
        silent = {name: age for name, age in self._ages(over).items() if self._stays(name, age)}
        # without what it waits for, a twin makes no rows; without another source it does
        waits = [age for name, age in silent.items() if self._timeouts[name] == math.inf]
        stale = bool(waits) or (bool(silent) and len(silent) == len(self._ages(over)))
        now = time.monotonic()
        age = max(waits, default=now - max(self._newest.values(), default=-math.inf))
        condition, why = "good", ""
        if failed:
            condition = "failure"
        elif silent:
            condition, why = "check", self._who(silent)
        elif self._out:
            condition, why = "out_of_specification", self._out
        elif self._alarm or self._sensors(now):
            condition, why = "maintenance_required", self._alarm or self._sensors(now)
        return {
            "condition": condition, "why": why, "stale": stale,
            "label": self._label if condition == "out_of_specification" else "",
            "age": round(age, 3) if age < math.inf else None,
        }  # fmt: skip

    def _sensors(self, now: float) -> str:
        """Whose measurements are refused again and again, in words."""
        often = [s for s, at in self._errors.items() if len(at) == ERRORS and now - at[0] < SPAN]
        return f"look at the sensor of {', '.join(often)}" if often else ""

    def _ages(self, over: Collection[str]) -> dict[str, float]:
        """Seconds since each source spoke; infinite: never yet."""
        now = time.monotonic()
        return {
            name: now - self._newest.get(name, -math.inf)
            for name in self._timeouts
            if name not in over
        }

    def _stays(self, name: str, age: float) -> bool:
        usual = max(PERIODS * self._period.get(name, 0.0), LEAST)
        timeout = self._timeouts[name]
        limit = self._stale or (usual if timeout == math.inf else max(timeout, usual))
        return age > limit

    def _who(self, silent: Mapping[str, float]) -> str:
        """Which sources stay away, in words."""
        if len(silent) == len(self._timeouts):
            return "no samples" if not self._newest else "samples stay away"
        return "; ".join(
            f"{name}: no samples" + ("" if age == math.inf else f" for {age:.0f} s")
            for name, age in silent.items()
        )
