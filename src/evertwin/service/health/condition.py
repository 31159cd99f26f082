"""How a twin is, in the words of NAMUR NE 107, and how old what it shows is.

What the live version does now decides, also while another is on trial. An alarm whose cause is over
has returned to normal, acknowledged or not (IEC 62682): it is told with when, in the past tense.

>>> condition = Condition({"camera": math.inf}, asked=True)
>>> condition.told(failed=False)["condition"]
'check'
>>> condition.came("camera")
>>> condition.heard({"number": 7, "kind": "suspected", "reason": "x is off", "row": 40, "time": 4})
>>> told = condition.told(failed=False)
>>> told["condition"], told["why"], told["stale"]
('out_of_specification', 'x is off', False)
>>> condition.looked(Now("held", first=50, since=5))
>>> told = condition.told(failed=False)
>>> told["condition"], told["returned"]["reason"], told["returned"]["over"]
('good', 'x was off', 5)
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from evertwin.outcome.open.faults import lasts
from evertwin.service.health.deviation_now import Now
from evertwin.service.health.past_tense import past

OUT = ("suspected", "abnormal", "drift", "not_valid")
"""Events after which the machine is not as its twin expects, until it is."""
SOUND = ("promoted", "rolled_back")
"""Another version is live: it is judged anew."""
ERRORS, SPAN = 5, 600.0
"""Measurements of a channel that were refused within so many seconds, from which on its sensor is
to be looked at."""
PERIODS = 3.0
LEAST = 1.0
"""Seconds of silence that are never stale."""


@dataclass
class Alarm:
    """What is, or was, out.

    >>> Alarm(3, "suspected", "x is off", 40, 4).told["since"]
    4
    """

    event: int | None
    """Number of the newest event that says so; None: none has told of it."""
    kind: str
    reason: str
    row: int
    """Of the newest word on it."""
    since: int
    """Stamp of the first word on it [ns]."""
    signal: str = ""
    now: str = ""
    """The same as it is now; empty: as it was first."""
    label: str = ""
    """What a person said to it."""
    events: tuple[int, ...] = ()
    """Numbers of all that said so."""

    @property
    def told(self) -> dict[str, Any]:
        """In plain values."""
        return {"event": self.event, "kind": self.kind, "since": self.since, "label": self.label}

    def over(self, when: int) -> dict[str, Any]:
        """The same once its cause is gone [ns], whatever a person says to it."""
        return self.told | {"reason": past(self.reason), "over": when}


class Condition:
    """Condition and age of one twin. See the module for an example."""

    def __init__(
        self, timeouts: Mapping[str, float], stale: float | None = None, *, asked: bool = False
    ) -> None:
        """``timeouts``: by source [s], infinite where its rows wait for it; ``stale``: seconds of
        silence; None: by the usual time between samples; ``asked``: is a largest deviation?"""
        self._timeouts, self._stale, self._asked = timeouts, stale, asked
        self._newest: dict[str, float] = {}
        self._period: dict[str, float] = {}
        self._worn: dict[tuple[str, str], tuple[int, str]] = {}
        """Component and kind of alarm → its event and why, of lives that are over or end soon."""
        self._out: Alarm | None = None
        self._returned: dict[str, Any] | None = None
        self._said: dict[tuple[str, str], str] = {}
        """Kind and signal → the newest reason, of what was told since the alarm that stands."""
        self._was: dict[tuple[str, str], str] = {}
        """The same of alarms that are over."""
        self._errors: dict[str, deque[float]] = {}
        # what two signals say of each other does not end where one by itself looks sound
        self._refused: dict[tuple[str, bool], Alarm] = {}
        """Signal whose measurement is in error now → since when, and why."""

    def came(self, source: str) -> None:
        """Samples of one source arrived."""
        now = time.monotonic()
        before, period = self._newest.get(source, now), self._period.get(source, 0.0)
        self._newest[source] = now
        self._period[source] = period + 0.1 * ((now - before) - period)

    def heard(self, event: Mapping[str, Any]) -> None:
        """An event."""
        kind, reason, signal = (str(event.get(key, "")) for key in ("kind", "reason", "signal"))
        when, row = int(event.get("time", 0)), int(event.get("row", 0))
        number, named = int(event.get("number", 0)), f"{signal}: {reason}"
        if kind == "labelled":
            self._labelled(event["evidence"])
        elif kind in OUT:
            before = self._out
            since, told = (when, ()) if before is None else (before.since, before.events)
            said = reason if signal in reason else named
            self._out = Alarm(number, kind, said, row, since, signal, events=(*told, number))
            self._said[kind, signal] = said
        elif self._ends(kind, signal):
            self._over(when)
        elif kind == "measurement_error":
            newest = self._errors.setdefault(signal, deque(maxlen=ERRORS))
            newest.append(time.monotonic())
            if lasts(event.get("evidence") or {}, row):
                known = self._refused.get((signal, _compared(event)))
                since = when if known is None else known.since
                lies = Alarm(number, kind, named, row, since, signal)
                self._refused[signal, _compared(event)] = lies
        elif kind == "measurement_restored":
            lied = self._refused.pop((signal, _compared(event)), None)
            if lied is not None:
                self._returned = lied.over(when)
        elif kind == "started":  # rows are counted anew, and no sensor was judged yet
            self._refused.clear()
            if self._out is not None:
                self._out.row = -1
        elif kind in ("alarm", "alarm_cleared"):
            which = signal, str((event.get("evidence") or {}).get("kind", ""))
            self._worn.pop(which, None)
            if kind == "alarm":
                self._worn[which] = number, reason
        elif kind == "maintained":
            self._worn = {one: why for one, why in self._worn.items() if one[0] != signal}

    def lived(self, alarms: Iterable[Mapping[str, Any]]) -> None:
        """What alarms of lives say now, where they stand: with the figures that lives are told
        with."""
        for one in alarms:
            which = str(one["component"]), str(one["kind"])
            if which in self._worn:
                self._worn[which] = self._worn[which][0], str(one["reason"])

    def recalled(
        self, events: Iterable[Mapping[str, Any]], looks: Sequence[tuple[int, Now]]
    ) -> None:
        """What a process before left: all events, and how the rows of the newest run did between
        them, each with its newest row. What was over then is over."""
        events, waits = list(events), deque(looks)
        new = max((k for k, event in enumerate(events) if event["kind"] == "started"), default=0)
        for k, event in enumerate(events):
            while waits and k > new and waits[0][0] < event["row"]:
                self.looked(waits.popleft()[1])
            self.heard(event)
        for _, now in waits:
            self.looked(now)

    def looked(self, now: Now) -> None:
        """How the live version does on its newest rows; what is out is over once a whole window of
        them lies behind the newest word on it."""
        out = self._out
        behind = out is not None and out.kind != "not_valid" and now.first > out.row
        if now.judged == "off":
            if out is None:
                said = "suspected", now.reason, now.first, now.time, now.signal
                self._out = Alarm(None, *said)
            elif out.kind == "suspected":
                out.now = now.reason
        elif now.judged == "held" and behind:
            self._over(now.since)

    def _ends(self, kind: str, signal: str) -> bool:
        """Is an event the end of what is out?"""
        out = self._out
        valid = kind == "valid" and out is not None and out.kind == "not_valid"
        valid = valid and out is not None and out.signal == signal
        clears = kind == "normal" and (not self._asked or bool(out and out.signal == signal))
        return valid or kind in SOUND or clears

    def _over(self, when: int) -> None:
        """The cause of what was out is gone."""
        if self._out is not None:
            self._returned, self._out = self._out.over(when), None
            self._was |= self._said
            self._said = {}

    def in_past(self, text: str) -> str:
        """The text, with what alarms said that are over in the past tense."""
        for said in self._was.values():
            if said not in self._said.values():
                for one in (said, said[:1].upper() + said[1:]):
                    text = text.replace(one, past(one))
        return text

    def _labelled(self, said: Mapping[str, Any]) -> None:
        """A person's word on what is out holds until it is out anew."""
        number, verdict = int(said["event"]), str(said["verdict"])
        out = self._out
        if out is not None and number in out.events:
            out.label = verdict
        elif self._returned is not None and number == self._returned["event"]:
            self._returned["label"] = verdict
        if verdict == "false alarm":
            self._worn = {one: why for one, why in self._worn.items() if why[0] != number}
        for lies in self._refused.values():
            lies.label = verdict if lies.event == number else lies.label

    def told(self, *, failed: bool, over: Collection[str] = ()) -> dict[str, Any]:
        """In plain values: condition, why, what a person said to it, the alarm that stands and the
        newest that is over, signals whose sensor is in error, age [s], stale.

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
        out = self._out if self._out is not None and self._out.label != "false alarm" else None
        condition, why = "good", ""
        if failed:
            condition = "failure"
        elif silent:
            condition, why = "check", self._who(silent)
        elif out is not None:
            condition, why = "out_of_specification", out.now or out.reason
        elif self._worn or self._sensors(now):
            told = *dict.fromkeys(why for _, why in self._worn.values()), self._sensors(now)
            condition, why = "maintenance_required", "; ".join(filter(None, told))
        return {
            "condition": condition, "why": why, "stale": stale,
            "label": out.label if out and condition == "out_of_specification" else "",
            "alarm": None if out is None else out.told, "returned": self._returned,
            "refused": list(dict.fromkeys(signal for signal, _ in self._refused)),
            "age": round(age, 3) if age < math.inf else None,
        }  # fmt: skip

    def _sensors(self, now: float) -> str:
        """Whose measurements are refused, now or again and again, in words."""
        if self._refused:
            said = "; ".join(one.reason for one in self._refused.values())
            return f"look at the sensor of {said}"
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


def _compared(event: Mapping[str, Any]) -> bool:
    return bool((event.get("evidence") or {}).get("cause") == "kinematics")
