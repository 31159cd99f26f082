"""How a recording may have been read: each channel times a number that divides two units, with its
sign turned, or in another's place; all channels of a unit; and a pose of scans mirrored.

>>> from evertwin.machines.mobile import Differential
>>> [one.said for one in readings(Differential(), ("",) * 5) if "exchanged" in one.said][:3]
['v and w look exchanged', 'v and x look exchanged', 'v and y look exchanged']
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from evertwin.fold import Block
from evertwin.gauges.rows import scanned
from evertwin.models import Model
from evertwin.rows.channels import averaged, measured_as, unit_told
from evertwin.setup.setup import Setup
from evertwin.signals import Channel
from evertwin.signals.mistaken import SIGN, TURN, Mistake, mistaken
from evertwin.signals.units import conversion_of
from evertwin.types import Bools, Float64, Vector

SWITCH = (0.0, 1.0)
"""Off and on."""
BESIDE = 0.1
"""So much more or less of a reading has to leave more; of a factor the relative change."""
LITTLE = 0.1
"""Share of what a reading takes away of a part by which it may be worse there than its likes."""
NEARLY = 0.01
"""The same of all parts together."""
ASIDE = 0.1
"""Part of the way that an exchange moves a channel by which it may miss where it lay."""
FEW = 6
"""Channels, or inputs, up to which any two may have been exchanged; of more, those of one unit."""


class Reading(NamedTuple):
    """What a recording may have been: channels in order are these of its columns, times a factor.

    >>> Reading._fields
    ('columns', 'factors', 'shifts', 'channels', 'number', 'said', 'mixed')
    """

    columns: tuple[int, ...]
    """Of each input, then each output."""
    factors: Vector
    shifts: Vector
    """What is added to each after that, in SI."""
    channels: tuple[str, ...]
    number: float
    """Recorded over true; 1 of an exchange."""
    said: str
    mixed: Float64[np.ndarray, "c c"] | None = None
    """Shares of the columns in each channel, where one is a mean that holds another."""

    @property
    def exchanged(self) -> bool:
        """Are two columns in each other's place?"""
        return bool(self.places.any())

    @property
    def places(self) -> Bools:
        """Channels that are in another's place, of all inputs and outputs."""
        own = np.arange(len(self.columns))
        others = np.asarray(np.array(self.columns) != own)
        if self.mixed is None:
            return others
        return np.asarray(others | (self.mixed != np.eye(len(own))).any(axis=1))

    @property
    def moved(self) -> Bools:
        """Channels that are not what was recorded, of all inputs and outputs."""
        return np.asarray((self.factors != 1.0) | (self.shifts != 0.0) | self.places)

    def of(self, values: Float64[np.ndarray, "n c"]) -> Float64[np.ndarray, "n c"]:
        """Inputs and outputs as they would be, had they been read so."""
        if self.mixed is None:
            return np.asarray(values[:, list(self.columns)] * self.factors + self.shifts)
        own, mixed = values.copy(), self.mixed
        for k in np.flatnonzero((mixed != np.eye(len(mixed))).any(axis=1)):
            shares = mixed[k]
            holds = shares != 0.0  # what is missing of the others is missing of them alone
            own[:, k] = values[:, holds] @ shares[holds]
        return np.asarray(own[:, list(self.columns)] * self.factors + self.shifts)

    def at_usual_levels(
        self, old: Float64[np.ndarray, "before moved"], new: Float64[np.ndarray, "since c"]
    ) -> bool:
        """Has a channel that it moves only values that it had, or off and on? In another unit a
        switched command would have others."""
        if self.exchanged or (self.factors <= 0.0).any():
            return False
        sides = zip(old.T, new[:, self.moved].T, strict=True)
        return any(np.isin(values, np.append(usual, SWITCH)).all() for usual, values in sides)

    def lies_among(
        self, old: Float64[np.ndarray, "before moved"], new: Float64[np.ndarray, "since c"]
    ) -> bool:
        """Read so, do the channels that it moves lie where they lay, by half a range at most?"""
        low, high = np.nanmin(old, axis=0), np.nanmax(old, axis=0)
        room, usual = 0.5 * (high - low) + 1e-12, np.nanmedian(self.of(new)[:, self.moved], axis=0)
        if self.exchanged:  # what hardly varied may have gone on
            away = np.nanmedian(new[:, self.moved], axis=0)
            room = np.maximum(room, ASIDE * np.maximum(low - away, away - high))
        inside = (low - room <= usual) & (usual <= high + room)
        return bool((inside | ~np.isfinite(usual)).all())

    def partly(self, share: float) -> Reading:
        """As much of it: 0 is as recorded, 1 all of it; of a factor alone its power."""
        shifts, mixed = share * self.shifts, self.mixed
        if not self.exchanged:
            powers = np.abs(self.factors) ** share
            alone = (self.factors > 0.0) & (self.shifts == 0.0)
            factors = np.where(alone, powers, 1.0 + share * (self.factors - 1.0))
            return self._replace(factors=factors, shifts=shifts)
        same = np.eye(len(self.columns))
        whole = (same if mixed is None else mixed)[list(self.columns)] * self.factors[:, None]
        mixed = (same + share * (whole - same))[np.argsort(self.columns)]
        return self._replace(factors=np.ones(len(same)), shifts=shifts, mixed=mixed)

    def exact(self, off: Callable[[Reading], Vector]) -> bool:
        """Are the rows further off by a tenth more or less of it, and each part of them by as good
        as nothing nearer? What drifts, or a machine that changed, asks for another number.
        ``off``: squares of each part, (parts,)."""
        sizes, whole = np.abs(np.log(np.abs(self.factors))), self.exchanged or self.shifts.any()
        step = BESIDE / (1.0 if whole or not sizes.any() else float(sizes.max()))
        own, gone = off(self), off(self.partly(0.0))
        sides = [off(self.partly(1.0 + by)) for by in (-step, step)]
        least = np.min([own, *sides], axis=0)
        more = np.maximum(gone - own, 0.0)
        nearly = own.sum() - min(side.sum() for side in sides) <= NEARLY * more.sum()
        return bool(nearly and (own - least <= LITTLE * more).all())

    def undone(self, window: Block) -> Block:
        """The rows as they would be, had they been read so."""
        nu, columns = window.u.shape[1], list(self.columns)
        values = self.of(np.concatenate([window.u, window.y], axis=1))
        u, y = np.ascontiguousarray(values[:, :nu]), np.ascontiguousarray(values[:, nu:])
        return window._replace(u=u, y=y, mark=np.ascontiguousarray(window.mark[:, columns]))


def readings(model: Model, units: Sequence[str]) -> Iterator[Reading]:
    """Everything that is tried. ``units``: each input, then each output, is recorded in, (nu + ny).

    Channels of one unit may all be read wrongly, as by a logger that was exchanged.
    """
    nu, channels = len(model.inputs), (*model.inputs, *model.outputs)
    own, still = tuple(range(len(channels))), np.zeros(len(channels))
    singles = [(k,) for k in own]
    alike = [
        tuple(k for k in side if channels[k].unit == unit)
        for side in (own[:nu], own[nu:])
        for unit in dict.fromkeys(channels[k].unit for k in side)
    ]
    for which in (*singles, *(some for some in alike if len(some) > 1)):
        names = tuple(channels[k].name for k in which)
        for one in _mistakes(channels[which[0]], units[which[0]]):
            factors, shifts = np.ones(len(own)), still.copy()
            factors[list(which)] = 1.0 / one.number
            shifts[list(which)] = -one.shift / one.number
            yield Reading(own, factors, shifts, names, one.number, _said(names, one))
    for a, b in combinations(own, 2):
        same = channels[a].unit == channels[b].unit
        if not (same or (b < nu <= FEW) or len(own) <= FEW):
            continue
        factors, columns = np.ones(len(own)), list(own)
        columns[a], columns[b] = b, a
        if not same or b < nu:
            scale = conversion_of(units[a])[0], conversion_of(units[b])[0]
            factors[a], factors[b] = scale[0] / scale[1], scale[1] / scale[0]
        names = channels[a].name, channels[b].name
        said = f"{' and '.join(names)} look exchanged"
        yield Reading(tuple(columns), factors, still, names, 1.0, said)


def possible(setup: Setup, model: Model) -> Iterator[Reading]:
    """Everything that is tried of a twin: its channels, and one of several of which one is the mean
    (that of a box is half as wrong as one of its two sensors)."""
    units, channels, spec = recorded(setup), (*model.inputs, *model.outputs), setup.spec
    if pose := scanned.pose_of(spec, model):
        signs = np.array([SIGN if one.name in pose[1:] else 1.0 for one in channels])
        own, still = tuple(range(len(channels))), np.zeros(len(channels))
        yield Reading(own, signs, still, (pose[2], pose[1]), SIGN, scanned.other_way(spec))
    measured = [measured_as(spec, one.name) for one in channels]
    for recorded_so in readings(model, units):
        one = _carried(recorded_so, channels, measured)
        if one is None:
            continue
        scaled = one.number > 0.0 and not one.exchanged
        said = one.said + scanned.or_unit(spec, model, one.channels) * scaled
        yield one._replace(said=said)
    for k, channel in enumerate(channels):
        sources = averaged(setup.spec, channel.name)
        if n := len(sources):
            name = f"one of {' and '.join(sources)}, of which {channel.name} is the mean,"
            yield from _of_one(channels, units, k, (n, name))


def _carried(one: Reading, channels: Sequence[Channel], measured: Sequence[str]) -> Reading | None:
    """A reading with what is derived from the channels that it moves; None: it moves what is
    derived, which nobody recorded, alone, or leaves it behind. Where the model takes several that
    are derived from a channel, and not that one, it is for `evertwin.gauges.units.rescaled`.

    Args:
        measured: of each channel, the recorded one that it is, or is computed of.
    """
    leads = [measured.index(name) for name in measured]
    columns, factors, shifts = list(one.columns), one.factors.copy(), one.shifts.copy()
    moved = one.moved
    for k, lead in enumerate(leads):
        if lead == k or not (moved[k] or moved[lead]):
            continue
        if not moved[lead] or channels[lead].name != measured[lead]:
            return None
        factors[k] = factors[lead]
        shifts[k] = shifts[lead] if channels[k].unit == channels[lead].unit else 0.0
        if one.exchanged:
            order = [j for j, first in enumerate(leads) if first == lead].index(k)
            others = [j for j, first in enumerate(leads) if first == one.columns[lead]]
            if order >= len(others) or channels[others[order]].unit != channels[k].unit:
                return None
            columns[k] = others[order]
    whole = len(set(columns)) == len(columns)
    return one._replace(columns=tuple(columns), factors=factors, shifts=shifts) if whole else None


def _of_one(
    channels: Sequence[Channel], units: Sequence[str], k: int, one_of: tuple[int, str]
) -> Iterator[Reading]:
    """One of so many, called so, of which channel ``k`` is the mean."""
    (n, name), c, own = one_of, len(channels), tuple(range(len(channels)))
    for one in _mistakes(channels[k], units[k]):
        number = (n - 1 + one.number) / n
        if number <= 0.0:
            continue
        factors, shifts = np.ones(c), np.zeros(c)
        factors[k], shifts[k] = 1.0 / number, -one.shift / n / number
        yield Reading(own, factors, shifts, (channels[k].name,), number, _said((name,), one))
    for j in own:
        if j == k or channels[j].unit != channels[k].unit or channels[k].kind == "angle":
            continue
        mixed = np.eye(c)  # what it holds in place of the other, and what is in that one's place
        mixed[k], mixed[j] = np.eye(c)[j], n * np.eye(c)[k] - (n - 1) * np.eye(c)[j]
        names = channels[j].name, channels[k].name
        said = f"{channels[j].name} and {name} look exchanged"
        yield Reading(own, np.ones(c), np.zeros(c), names, 1.0, said, mixed)


def recorded(setup: Setup) -> tuple[str, ...]:
    """Unit that each input, then each output, is recorded in; empty where nobody says so."""
    channels = (*setup.model.inputs, *setup.model.outputs)
    return tuple(unit_told(setup.spec, one) for one in channels)


def _mistakes(channel: Channel, unit: str) -> Iterator[Mistake]:
    for one in mistaken(unit, channel.unit):
        if channel.kind != "angle" or one.number in (SIGN, TURN, 1.0 / TURN):
            yield one


def _said(names: tuple[str, ...], one: Mistake) -> str:
    shown = " and ".join(names)
    if one.number == SIGN:
        return f"the sign of {shown} looks turned"
    look = "looks" if len(names) == 1 else "look"
    if one.scale:
        return f"{shown} {look} recorded in {one.said}"
    return f"{shown} {look} {one.number:.4g} times what it is, as {one.said} would make it"
