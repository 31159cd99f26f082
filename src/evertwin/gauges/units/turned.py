"""Is an angle of a machine with states counted from elsewhere, or the other way round?

A base goes where its heading points. A heading that a compass gives (from north on, clockwise), or
one of another frame than its x and y, turns as the machine does, so nothing of its own says so; but
each way that is predicted with it points elsewhere, by one angle, that no number of a machine is.
What tuning then takes up are numbers of no machine: half a gain for a way that is 60° askew.

>>> from evertwin.machines.mobile import Differential
>>> angles_of(Differential())
[2]
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np

from evertwin.fold import Block, Windows, take
from evertwin.gauges.rows.reading import Reading
from evertwin.gauges.rows.scanned import rule_of, turned_by
from evertwin.gauges.rows.sensor_change import SensorChange, unmeasured
from evertwin.gauges.units.misread import ROWS, newest_rows, seen, total
from evertwin.models import Model
from evertwin.rows.channels import unit_recorded
from evertwin.setup.setup import Setup
from evertwin.signals.mistaken import SIGN
from evertwin.signals.units import conversion_of
from evertwin.types import Bools, Float64, ParameterVector, Vector

SHIFTS = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
"""Angles that are tried first [rad]."""
LEAST = 0.1
"""Turn [rad] that a machine which goes askew may make by itself."""
WRONG = 0.1
"""Mismatch of an output from which its way is doubted."""
LEFT = 0.4
"""Share of the squared mismatch that it may leave."""
PIECE = 250
"""Rows that are looked at together."""
FEW = 100
"""Rows that tell it, at least."""


class Numbered(NamedTuple):
    """A model and its parameters.

    >>> Numbered._fields
    ('model', 'p')
    """

    model: Model
    p: ParameterVector


class Turned(NamedTuple):
    """What an angle was counted as.

    >>> Turned("heading", -1.0, 1.5708, 0.99, ("x", "y")).said
    'heading looks counted the other way round, from 90° on, against what x and y do'
    """

    channel: str
    number: float
    """−1 where it is counted the other way round, else 1."""
    shift: float
    """What is added to it after that [rad]."""
    share: float
    """Part of the squared deviation that is gone then."""
    others: tuple[str, ...]
    """What tells it."""

    @property
    def said(self) -> str:
        """In words."""
        degrees = math.degrees(self.shift)
        told = f"against what {' and '.join(self.others)} do"
        if self.number == SIGN:
            return (
                f"{self.channel} looks counted the other way round, from {degrees:.0f}° on, {told}"
            )
        return f"{self.channel}, or the frame it is told in, looks turned by {-degrees:.0f}° {told}"

    def step(self, setup: Setup) -> str:
        """What to write into the twin file, in the unit of the recording."""
        if self.number != SIGN and rule_of(setup.spec, (self.channel, *self.others)):
            return turned_by(setup.spec, self.shift)
        unit = unit_recorded(setup.spec, self.channel) or "rad"
        offset = self.shift / conversion_of(unit)[0]
        scale = "scale = -1, " if self.number == SIGN else ""
        where = f"for {self.channel} in [source.channels], if that is confirmed"
        return f"{scale}offset = {offset:.4g} [{unit}] {where}"

    def told(self, setup: Setup) -> str:
        """What is off, by how much, and what to do."""
        gone = f"read so, {100 * self.share:.1f} % of the squared deviation is gone"
        return f"{self.said}: {gone}: {self.step(setup)}"


def angles_of(model: Model) -> list[int]:
    """Outputs that are angles and states, where there are others that may go by them."""
    outputs, states = model.outputs, model.states.names
    found = np.flatnonzero(outputs.angles).tolist()
    return [k for k in found if outputs.names[k] in states and len(outputs) > 1]


@unmeasured()
def turned(setup: Setup, forms: Sequence[Numbered], windows: Windows) -> Turned | None:
    """How an angle was counted, if that explains next to all that is off; None: it does not.

    Args:
        setup: of the twin.
        forms: models and parameters that may be the machine's: as told, and as tuned.
        windows: rows, of which those that say most are looked at.
    """
    best, model = None, setup.model
    others = ~model.outputs.angles
    rows = liveliest(windows) if angles_of(model) else []
    if sum(len(one.t) for one in rows) < FEW:
        return None
    recorded = [seen(setup, *form, rows).mismatch for form in forms]
    if not max(off[others].max(initial=0.0) for off in recorded) > WRONG:
        return None
    for k, form, number in product(angles_of(model), forms, (1.0, SIGN)):
        left = partial(_left, setup, form, rows, (len(model.inputs) + k, number))
        tried = np.array([left(by) for by in SHIFTS])
        goes_by = others & (np.ptp(tried, axis=0) > 1e-6)
        if not goes_by.any():
            continue
        judged = goes_by.copy()  # what the angle itself does tells its sign, and nothing of a zero
        judged[k] = number == SIGN
        before = min(total(off[judged]) for off in recorded)
        least, shift = _nearest(left, tried, judged)
        share = least / before
        if abs(shift) > LEAST and share < LEFT and (best is None or share < best[0]):
            name, *told = (model.outputs.names[j] for j in (k, *np.flatnonzero(goes_by)))
            best = share, Turned(name, number, shift, 1.0 - share, tuple(told))
    return best[1] if best else None


def liveliest(windows: Windows) -> list[Block]:
    """`ROWS` rows at most, in pieces, that are measured and in which the machine is driven most:
    one that stands tells nothing of where it would go."""
    pieces = [
        take(window, at, min(at + PIECE, len(window.t)))
        for window in windows
        for at in range(0, len(window.t), PIECE)
    ]
    driven = np.array([np.nanmean(np.abs(one.u), axis=0) for one in pieces])
    known = np.array([np.isfinite(one.y).all(axis=1).mean() for one in pieces])
    much = known * np.nansum(driven / np.nanmax(driven, axis=0, initial=1e-300), axis=1)
    best = np.sort(np.argsort(-much, kind="stable")[: ROWS // PIECE])
    return newest_rows([pieces[n] for n in best], ROWS)


def _left(
    setup: Setup, form: Numbered, rows: Sequence[Block], one: tuple[int, float], shift: float
) -> Vector:
    """Mismatch of each output where the angle, column and sign, is counted from there, (ny,)."""
    (column, number), count = one, len(setup.model.inputs) + len(setup.model.outputs)
    factors, shifts = np.ones(count), np.zeros(count)
    factors[column], shifts[column] = number, shift
    reading = Reading(tuple(range(count)), factors, shifts, (), number, "")
    return seen(setup, *form, [reading.undone(window) for window in rows]).mismatch


def _nearest(
    left: Callable[[float], Vector], tried: Float64[np.ndarray, "shifts ny"], judged: Bools
) -> tuple[float, float]:
    """The least that is left of outputs that are ``judged``, and where the angle is counted from
    then [rad]. ``tried``: what is left of each at `SHIFTS`, (n, ny)."""

    def lowest(shift: float, step: float, by: Sequence[float]) -> float:
        # next to its least value the sum goes as the square of the angle
        low, here, high = by
        bend = low - 2.0 * here + high
        return shift + 0.5 * step * (low - high) / bend if bend > 0.0 else shift

    step, sums = float(SHIFTS[1]), [total(one[judged]) for one in tried]
    k = int(np.argmin(sums))
    shift = lowest(step * k, step, (sums[k - 1], sums[k], sums[(k + 1) % len(sums)]))
    step /= 2.0
    near = [total(left(shift + by)[judged]) for by in (-step, 0.0, step)]
    shift = lowest(shift, step, near)
    return total(left(shift)[judged]), math.remainder(shift, 2.0 * math.pi)


def of_an_angle(
    setup: Setup, model: Model, p: ParameterVector, windows: Windows, tuned: ParameterVector
) -> SensorChange | None:
    """The same of a machine that never held, ``p`` as it was told and as it was tuned."""
    found = turned(setup, (Numbered(model, p), Numbered(model, tuned)), windows)
    if found is None:
        return None
    said = f"{found.told(setup)}; nothing is learned from it"
    return SensorChange(found.channel, found.number, said)
