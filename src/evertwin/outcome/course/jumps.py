"""Measurements that stepped away from the model and were believed: until they stepped back, or to
the end.

The arbiter lets samples that agree with each other overrule the model, for the machine may have
been moved. A sensor that is off for a while looks the same as it leaves, and steps back by as much
when it is right again; what never came back cannot be told from a machine that was moved, nor from
a sensor that went off by and by and came right at once. Either is the first that a result has to
say. Where a signal overrules the model again and again, the model is rough there, and nothing of
this is said; nor of a jump within what the model is off by anyway, nor of an output that forgets
where it was, as a current does: a sensor that is off would go on to contradict the model. One that
forgets slowly, as a temperature does, contradicts it by so little within a prediction that nothing
else tells of it.

>>> there = {"delta": {"x": 0.5}, "sigma": {"x": 0.01}, "onset": 10}
>>> events = [Event(17, 0, "overruled", "pose", "", there)]
>>> jumps(events, {"x": ("m", "")})["pose"][:66]
'pose has stood x +50 cm apart from what the model followed since r'
>>> back = {"delta": {"x": -0.49}, "sigma": {"x": 0.01}, "onset": 90}
>>> jumps([*events, Event(97, 0, "overruled", "pose", "", back)], {"x": ("m", "")})["pose"][:50]
'pose stood x +50 cm apart from row 10 to 90 and ca'

What an error of the sensor takes back is over, and was it:

>>> away = {"cause": "away", "onset": 17, "end": 89}
>>> jumps([*events, Event(90, 0, "measurement_error", "pose", "", away)],
...       {"x": ("m", "")})["pose"]
'pose stood x +50 cm apart from row 10 to 89 and came back: its sensor was off.'
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from evertwin.fold import Event, Mark
from evertwin.gauges.rows.withdrawn import CAUSES
from evertwin.models import Model
from evertwin.signals.spoken import spoken
from evertwin.types import ParameterVector, PerOutput

OFTEN = 4
"""Jumps of a signal from which on it is the model that is rough."""
CLEAR = 6.0
"""Size in standard deviations of the sensor from which a jump is told."""
BACK = 0.2
"""Share of a jump within which the next one takes it back."""
HORIZONS, STEPS = 10, 200
"""How long an output remembers that it was moved, at least, and in how many steps that is asked."""
LONG = 10**17
"""Time [ns] after which no prediction goes on."""
STAYS = 0.5
"""Share of that which is still there then, at least."""


def forgotten(model: Model, p: ParameterVector, horizon: float) -> Mapping[str, float]:
    """Share of a move that outputs forget within a horizon: none where one stays moved, as a
    position does, or where that cannot be asked; all where no state takes it over.

    >>> from evertwin.models import FunctionModel, Parameters
    >>> from evertwin.signals import Layout
    >>> def cart(x, u, dt, p):
    ...     speed = x[1] - dt * p[0] * (x[1] - u[0])
    ...     return [x[0] + dt * speed, speed], [x[0] + dt * speed, speed]
    >>> both = Layout.of(x="m", v="m/s")
    >>> model = FunctionModel(
    ...     cart, Layout.of(u="m/s"), both, both, Parameters.of(quick=(9.0, "1/s")))
    >>> forgotten(model, model.parameters.values, 1.0)
    {'x': 0.0, 'v': 1.0}
    """
    names = model.outputs.names
    if not np.isfinite(horizon):
        return dict.fromkeys(names, 0.0)
    x0, dt = model.initial(p), np.full(STEPS, HORIZONS * horizon / STEPS)
    u, found = np.zeros((STEPS, len(model.inputs))), dict.fromkeys(names, 1.0)
    with np.errstate(all="ignore"):
        for k, name in enumerate(names):
            here, there = (np.where(np.arange(len(names)) == k, v, np.nan) for v in (0.0, 1.0))
            at, moved = model.observe(x0, here), model.observe(x0, there)
            if np.array_equal(at, moved):
                continue  # no state takes it over
            one, other = (model.simulate(x, u, dt, p)[1][:, k] for x in (at, moved))
            left = np.abs(other - one)
            gone = 0.0 if not left[-1] < STAYS else 1.0 - left[STEPS // HORIZONS - 1]
            found[name] = float(np.clip(round(gone, 3), 0.0, 1.0))
    return found


def usual_most(
    trace: Mapping[str, np.ndarray], events: Sequence[Event], horizon: float
) -> PerOutput | None:
    """The most that the live version was off by, apart from jumps, (ny,); None: no rows tell."""
    if not trace:
        return None
    row, mark = trace["row"], trace["mark"]
    trusted = (mark == Mark.OK) | (mark == Mark.HELD)
    for event in events:
        if event.kind == "overruled":
            first: Any = event.evidence.get("onset", event.row)
            until = event.time + min(horizon * 1e9, float(LONG))
            trusted[(row >= first - 1) & (trace["t"] <= until)] = False
    off = np.where(trusted & np.isfinite(trace["off"]), np.abs(trace["off"]), 0.0)
    return np.asarray(off.max(axis=0, initial=0.0))


def jumps(
    events: Sequence[Event], units: Mapping[str, tuple[str, str]],
    least: Mapping[str, float] | None = None, gone: Mapping[str, float] | None = None,
) -> Mapping[str, str]:  # fmt: skip
    """Signal to the sentence about it.

    Args:
        events: of a run.
        units: SI unit of each output, and the one that it is recorded in.
        least: how far an output has to jump for it to be the first thing to say; absent: not far.
        gone: share of a jump by which a sensor that is off goes on to contradict the model; None:
            it does not.
    """
    rule = least or {}, gone or {}
    told = {signal: _told(signal, some, units, rule) for signal, some in _seldom(events).items()}
    return {signal: sentence for signal, sentence in told.items() if sentence}


def believed(
    events: Sequence[Event], units: Mapping[str, tuple[str, str]], least: Mapping[str, float]
) -> Mapping[str, str]:
    """Signal to a sentence about its largest clear jump by more than ``least``, whose it may be."""
    told = {}
    for signal, some in _seldom(events).items():
        clear = [(event, *_farthest(event)) for event in some if event.kind == "overruled"]
        clear = [one for one in clear if one[3] > CLEAR and abs(one[2]) > least.get(one[1], 0.0)]
        if clear:
            event, name, delta, _ = max(clear, key=lambda one: one[3])
            told[signal] = (
                f"{signal} stepped {_by(signal, name, delta, units)} away from the model at row "
                f"{event.evidence['onset']} and was believed: the sensor, or the machine."
            )
    return told


def _seldom(events: Sequence[Event]) -> Mapping[str, Sequence[Event]]:
    """The jumps of each signal since the live model is; none of one that jumps again and again."""
    found: dict[str, list[Event]] = {}
    for event in events:
        if event.kind == "promoted":  # by what went before another model was overruled
            found.clear()
        if (event.kind == "overruled" and event.evidence.get("delta")) or _takes_back(event):
            found.setdefault(event.signal, []).append(event)
    often = {
        signal: sum(event.kind == "overruled" for event in some) for signal, some in found.items()
    }
    return {signal: some for signal, some in found.items() if often[signal] < OFTEN}


def _takes_back(event: Event) -> bool:
    """Is it the error of a sensor whose rows had been believed?"""
    return event.kind == "measurement_error" and event.evidence.get("cause") in CAUSES


def _farthest(event: Event) -> tuple[str, float, float]:
    """The output that jumped farthest, by how much, and by how many standard deviations."""
    known: Any = event.evidence
    sizes = {n: abs(d) / max(known["sigma"].get(n, 0.0), 1e-300) for n, d in known["delta"].items()}
    name = max(sizes, key=sizes.__getitem__)
    return name, float(known["delta"][name]), sizes[name]


def _told(
    signal: str, some: Sequence[Event], units: Mapping[str, tuple[str, str]],
    rule: tuple[Mapping[str, float], Mapping[str, float]],
) -> str:  # fmt: skip
    """Of the last jump that is clear and was not the way back of one before."""
    least, gone = rule
    open_one: tuple[Event, str, float] | None = None
    first: Any
    text = ""
    for event in some:
        known: Any = event.evidence
        if _takes_back(event):
            if open_one is not None and known["onset"] <= open_one[0].row <= known["end"]:
                off = _by(signal, *open_one[1:], units)
                first = open_one[0].evidence["onset"]
                text = (
                    f"{signal} stood {off} apart from row {first} to {known['end']} and came back: "
                    "its sensor was off."
                )
                open_one = None
            continue
        name, delta, size = _farthest(event)
        if open_one is not None and name == open_one[1] and _returns(delta, open_one[2]):
            first = open_one[0].evidence["onset"]
            text = (
                f"{signal} stood {_by(signal, name, open_one[2], units)} apart from row "
                f"{first} to {known['onset']} and came back: so does a sensor "
                "that is off; the model followed it meanwhile."
            )
            open_one = None
        elif size > CLEAR and abs(delta) > least.get(name, 0.0):
            open_one = event, name, delta
    if open_one is not None and (
        abs(open_one[2]) * gone.get(open_one[1], 0.0) <= least.get(open_one[1], 0.0)
    ):
        since: Any = open_one[0].evidence
        text = (
            f"{signal} has stood {_by(signal, *open_one[1:], units)} apart from what the model "
            f"followed since row {since['onset']}: the sensor is off since then, or was before and "
            "came right, if nothing moved the machine."
        )
    return text


def _returns(delta: float, before: float) -> bool:
    return abs(delta + before) < BACK * abs(before)


def _by(signal: str, name: str, delta: float, units: Mapping[str, tuple[str, str]]) -> str:
    which, sign = "" if name == signal else f"{name} ", "+" if delta > 0 else "−"
    return f"{which}{sign}{spoken(abs(delta), *units.get(name, ('1', '')))}"
