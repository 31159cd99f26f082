"""Where the numbers of a model start from: what the recording says of them, roughly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from evertwin.machines.thermal import CB, CH, GB, GH, POWER, ThermalBox
from evertwin.models import Model
from evertwin.signals import to_si
from evertwin.starter.proposal import ASK, Match
from evertwin.starter.seen import Seen
from evertwin.starter.store_guess import UNKNOWN, Store, guess_store
from evertwin.types import Vector

HEATER, QUICK = 0.1, 50.0
"""Of a box: the heater's capacity as a share of the box's, and so many times as fast as the box the
heater takes its heat to it."""


def store_of(found: Sequence[Match], seen: Sequence[Seen], period: float | None) -> Store:
    """Of a store of one's own, by what drives and what answers."""
    told = _columns(("u", "y"), found, seen, period)
    return UNKNOWN if told is None else guess_store(*told)


def box_of(
    model: Model | None, found: Sequence[Match], seen: Sequence[Seen], period: float | None
) -> Mapping[str, tuple[float, str]]:
    """Of a heated box, with units [SI]: a store of what it is warmer by than the room; of other
    models nothing. Heater and box can change places: from afar a fit ends with a heater that is
    slower than what it heats.
    """
    if not isinstance(model, ThermalBox):
        return {}
    told = _columns(("heater", "box", "room"), found, seen, period)
    if told is None or not all(isinstance(one.scale, float) for one in found):
        return {}
    t, heater, box, room = told
    store = guess_store(t, heater, box - room)
    if not (store.gain > 0.0 and store is not UNKNOWN):
        return {}
    capacity = float(model.parameters.values[POWER]) / store.gain
    own = HEATER * capacity
    values = {
        CH: own, GH: own * QUICK * store.leak, CB: capacity - own, GB: capacity * store.leak,
    }  # fmt: skip
    numbers = {model.parameters.items[k]: value for k, value in values.items()}
    return {
        one.name: (float(f"{value:.3g}"), one.unit)
        for one, value in numbers.items() if one.low < value < one.high
    }  # fmt: skip


def _columns(
    names: Sequence[str], found: Sequence[Match], seen: Sequence[Seen], period: float | None
) -> tuple[Vector, ...] | None:
    """Time [s] and channels in SI, of one table; None where it does not hold them all."""
    matches: dict[str, Match] = {match.channel: match for match in found if match.column != ASK}
    sources = {matches[name].source for name in names if name in matches}
    if not matches.keys() >= set(names) or len(sources) != 1:
        return None
    (source,) = sources
    values = tuple(_in_si(seen[source], matches[name]) for name in names)
    t = seen[source].t
    if t is None and period is not None:
        t = period * np.arange(len(values[0]))
    return None if t is None else (t, *values)


def _in_si(seen: Seen, match: Match) -> Vector:
    scale = match.scale if isinstance(match.scale, float) else 1.0  # an open question
    values: Vector = to_si(seen.values(match.column) * scale + match.offset, match.unit)
    return values
