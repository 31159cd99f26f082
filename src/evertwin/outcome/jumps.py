"""Measurements that stepped away from the model and were believed: until they stepped back, or to
the end.

The arbiter lets samples that agree with each other overrule the model, for the machine may have
been moved. A sensor that is off for a while looks the same as it leaves, and steps back by as much
when it is right again; what never came back cannot be told from a machine that was moved. Either
is the first that a result has to say. Where a signal overrules the model again and again, the model
is rough there, and nothing of this is said.

>>> there = {"delta": {"x": 0.5}, "sigma": {"x": 0.01}, "onset": 10}
>>> events = [Event(17, 0, "overruled", "pose", "", there)]
>>> jumps(events, {"x": ("m", "")})["pose"][:66]
'pose has stood x +50 cm apart from what the model followed since r'
>>> back = {"delta": {"x": -0.49}, "sigma": {"x": 0.01}, "onset": 90}
>>> jumps([*events, Event(97, 0, "overruled", "pose", "", back)], {"x": ("m", "")})["pose"][:50]
'pose stood x +50 cm apart from row 10 to 90 and ca'
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from evertwin.fold import Event
from evertwin.signals.spoken import spoken

OFTEN = 4
"""Jumps of a signal from which on it is the model that is rough."""
CLEAR = 6.0
"""Size in standard deviations of the sensor from which a jump is told."""
BACK = 0.2
"""Share of a jump within which the next one takes it back."""


def jumps(
    events: Sequence[Event], units: Mapping[str, tuple[str, str]], least: float = 0.0
) -> Mapping[str, str]:
    """Signal to the sentence about it.

    Args:
        events: of a run.
        units: SI unit of each output, and the one that it is recorded in.
        least: what an output may be off by: a smaller jump is nothing to say first.
    """
    found: dict[str, list[Event]] = {}
    for event in events:
        if event.kind == "promoted":  # by what went before another model was overruled
            found.clear()
        if event.kind == "overruled" and event.evidence.get("delta"):
            found.setdefault(event.signal, []).append(event)
    told = {}
    for signal, some in found.items():
        sentence = _told(signal, some, units, least) if len(some) < OFTEN else ""
        if sentence:
            told[signal] = sentence
    return told


def _told(
    signal: str, some: Sequence[Event], units: Mapping[str, tuple[str, str]], least: float
) -> str:
    """Of the last jump that is clear and was not the way back of one before."""
    open_one: tuple[Event, str, float] | None = None
    text = ""
    for event in some:
        known: Any = event.evidence
        sizes = {
            n: abs(d) / max(known["sigma"].get(n, 0.0), 1e-300) for n, d in known["delta"].items()
        }
        name = max(sizes, key=sizes.__getitem__)
        delta = float(known["delta"][name])
        if open_one is not None and name == open_one[1] and _returns(delta, open_one[2]):
            first: Any = open_one[0].evidence
            text = (
                f"{signal} stood {_by(signal, name, open_one[2], units)} apart from row "
                f"{first['onset']} to {known['onset']} and came back: so does a sensor "
                "that is off; the model followed it meanwhile."
            )
            open_one = None
        elif sizes[name] > CLEAR and abs(delta) > least:
            open_one = event, name, delta
    if open_one is not None:
        since: Any = open_one[0].evidence
        text = (
            f"{signal} has stood {_by(signal, *open_one[1:], units)} apart from what the model "
            f"followed since row {since['onset']}: the sensor is off, if nothing moved the machine."
        )
    return text


def _returns(delta: float, before: float) -> bool:
    return abs(delta + before) < BACK * abs(before)


def _by(signal: str, name: str, delta: float, units: Mapping[str, tuple[str, str]]) -> str:
    which, sign = "" if name == signal else f"{name} ", "+" if delta > 0 else "−"
    return f"{which}{sign}{spoken(abs(delta), *units.get(name, ('1', '')))}"
