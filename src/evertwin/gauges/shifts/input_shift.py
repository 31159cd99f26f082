"""Is a measured input off by what came at once or grew, as an offset or a drift of its sensor is?

What an input would have to be off by for the version as it is to hold again goes with what a
parameter explains as well: a supply pressure that reads 20 % too much looks like a gain that is
20 % too small. The input's own record tells them apart. Where its sensor drifts, the record leaves
its usual course by just that; where the machine changed, it does not. So the course (an
autoregression of the rows before) is held against the record as it is and without the shift:

* the record is likelier without the shift: it is the sensor;
* it is likelier as it is: it is the machine, and tuning has it;
* neither: sensor or machine, that cannot be told from these rows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from evertwin.errors import TooFew
from evertwin.gauges.changes.change import split
from evertwin.gauges.changes.noise import CHANCE
from evertwin.gauges.rows import in_words
from evertwin.gauges.rows.gauge_rows import LEAST, Rows
from evertwin.gauges.rows.sensor_change import SensorChange, unmeasured
from evertwin.gauges.shifts.course import AT_ONCE, CLEAR, evidence, shape_of
from evertwin.gauges.shifts.off_by import left_with, undone
from evertwin.models.kernels.kernel import CONTINUE
from evertwin.rows.channels import is_held, measured
from evertwin.rows.ring import called
from evertwin.types import Bools, Outputs, Vector

PARTS = 24
"""Parts of the rows at whose edges a shift may begin to grow, and end."""
SECANTS = 2
"""Steps towards the size."""
NEARLY, ABOUT = 0.98, 0.9
"""Share of what is explained that a step has to explain for nothing more to be asked; the same of
one that is seen in the record."""
HALF, OF_NOISE = 0.5, 5.0
"""Share of its size by which that may differ, and how many times the record's usual step it is."""
EXPLAINED = 0.5
"""Share of the squared deviation that a shift leaves at most."""
LITTLE = 0.8
"""The same before any number of the machine is tuned beside it."""
CLEARLY = 2.0
"""What leaves so many times as much, to first order, is not looked at further."""
ALIKE = 1.5
"""What leaves so many times as much explains it as well."""
NO_WORSE = 1.1
"""So many times what tuning leaves a shift may leave."""
BUSY = 0.5
"""Share of rows at which a channel changes that is measured, though nobody says so."""


class Shift(NamedTuple):
    """What an input is off by.

    >>> Shift(1, np.zeros(3), 0, np.zeros((3, 1)), 4.0).sure
    True
    """

    column: int
    by: Vector
    """At each row, (n,)."""
    first: int
    """Position of the first row that is off."""
    left: Outputs
    """Residual of the version without it, (n, ny)."""
    evidence: float
    """Logarithm of the likelihood ratio of the input's own record, for its sensor."""

    @property
    def sure(self) -> bool:
        """Does the record speak for the sensor?"""
        return self.evidence > CLEAR


class Profile(NamedTuple):
    """How an input pulls the residual, and how that goes with what is off, at each row, (n,).

    >>> Profile(np.array([0.0, -2.0]), np.ones(2)).fitted(np.array([0.0, 1.0]))
    (2.0, 2.0)
    """

    product: Vector
    """Σ pull·off over outputs."""
    power: Vector
    """Σ pull²."""

    @classmethod
    def of(cls, pull: Outputs, off: Outputs) -> Profile:
        """Of residuals, outputs by their sizes; 0 where nothing is known."""
        return cls(np.sum(pull * off, axis=1), np.sum(pull * pull, axis=1))

    def fitted(self, shape: Vector) -> tuple[float, float]:
        """Size of a shift of this ``shape``, and the squares that it takes away; beside a constant,
        by which the version as it is was off before."""
        a, b = float(self.power.sum()), float(shape @ self.power)
        c = float(np.square(shape) @ self.power) - (b * b / a if a > 0.0 else 0.0)
        d = float(shape @ self.product) - (b * float(self.product.sum()) / a if a > 0.0 else 0.0)
        return (-d / c, d * d / c) if c > 1e-12 * a else (0.0, 0.0)


class Guess(NamedTuple):
    """A shift to first order.

    >>> Guess._fields
    ('column', 'shape', 'span', 'size', 'slope', 'left')
    """

    column: int
    shape: Vector
    """From 0 to 1, (n,)."""
    span: tuple[int, int]
    """Positions at which it begins and is complete."""
    size: float
    slope: Outputs
    """What a shift of size 1 makes of the residual, (n, ny)."""
    left: float
    """Share of the squared deviation that is left."""


@unmeasured()
def shifted_inputs(rows: Rows) -> list[Shift]:
    """Inputs whose shift explains the rows as well as a machine that changed, and of which their
    own record does not say otherwise; the one that leaves least first, with what does as well."""
    guesses = [one for k in _measured(rows) for one in (_guess(rows, k),) if one is not None]
    least = min((one.left for one in guesses), default=0.0)
    found = [
        one
        for guess in guesses
        if guess.left <= CLEARLY * least
        for one in (_shift(rows, guess),)
        if one is not None
    ]
    found.sort(key=lambda one: rows.total(one.left, _after(rows, 0)))
    least = rows.total(found[0].left, _after(rows, 0)) if found else 0.0
    alike = [one for one in found if rows.total(one.left, _after(rows, 0)) <= ALIKE * least]
    return [one for one in alike if one.sure] or alike


def _measured(rows: Rows) -> list[int]:
    """Columns of inputs that are a sensor's alone; a command is what it is. Of a static map none:
    positions and speeds that come of each other answer for each other."""
    setup, inputs = rows.setup, rows.setup.model.inputs
    if not len(setup.model.states):
        return []
    alone = [columns[0] for columns, _ in measured(setup.spec, inputs).values() if not columns[1:]]
    found = []
    for k in sorted(alone):
        said = setup.spec.signals.get(inputs.names[k])
        busy = np.mean(np.nan_to_num(rows.steps[:, k]) != 0.0) > BUSY
        if not is_held(setup.spec, inputs.names[k], dynamic=True) or (
            busy and (said is None or said.hold is None)
        ):
            found.append(k)
    return found


def _guess(rows: Rows, k: int) -> Guess | None:
    """The shift of input ``k`` as the version as it is tells it."""
    record, n = rows.values[:, k], rows.count
    step = float(np.nanstd(record))
    if not step > 0.0 or n < 2 * PARTS:
        return None
    slope = _slope(rows, k, np.full(n, step)) / step
    off = np.nan_to_num(rows.before / rows.sizes)
    profile, usual = Profile.of(slope / rows.sizes, off), slope / rows.sizes
    first, last = _when(rows, profile, record)
    shape = shape_of(n, first, last)
    size, _ = profile.fitted(shape)
    slope *= shape[:, None]
    for _ in range(SECANTS):  # it need not be small
        if not size:
            return None
        slope = _slope(rows, k, size * shape) / size
        size = _size(off, usual, slope / rows.sizes)
    here = _after(rows, first)[:, None] & np.isfinite(rows.before)
    left = rows.total(rows.before + slope * size, here)
    before = rows.total(rows.before, here)
    if evidence(record, size, (first, last)) < -CLEAR or not left <= LITTLE * before:
        return None
    return Guess(k, shape, (first, last), size, slope, left / before)


def _size(off: Outputs, usual: Outputs, own: Outputs) -> float:
    """How much of ``own`` takes most of ``off`` away, beside as much of ``usual`` as it needs."""
    columns = np.column_stack([usual.ravel(), own.ravel()])
    if not np.isfinite(np.sum(np.square(columns))):  # the model breaks down by as much
        return 0.0
    return -float(np.linalg.lstsq(columns, off.ravel(), rcond=None)[0][1])


def _slope(rows: Rows, k: int, by: Vector) -> Outputs:
    """What input ``k`` less ``by`` adds to the residual; 0 where it is not known, (n, ny)."""
    more = left_with(rows.setup, rows.posed, rows.windows, (k, False), by) - rows.before
    return np.asarray(np.where(np.isfinite(more), more, 0.0))


def _shift(rows: Rows, guess: Guess) -> Shift | None:
    """The shift, one machine tuned beside it on all rows; None: two machines are likelier, one
    before and one since the change."""
    (first, last), k = guess.span, guess.column
    left = rows.left_on(undone(rows.setup, rows.windows, (k, False), guess.size * guess.shape))
    if left is None:
        return None
    known = np.isfinite(left)
    own = np.where(known, guess.slope / rows.sizes, 0.0)
    more = _size(np.where(known, left / rows.sizes, 0.0), 0.0 * own, own)
    left, size = left + guess.slope * more, guess.size + more
    rival, early = rows.tuned, split(rows.windows, rows.fitted)[0]
    if first < rows.fitted and (then := rows.left_on(early)) is not None:
        rival = np.concatenate([then, rival[len(then) :]])
    both = _after(rows, first)[:, None] & np.isfinite(left) & np.isfinite(rival)
    if np.count_nonzero(both.any(axis=1)) < LEAST:
        return None
    ours, theirs = rows.total(left, both), rows.total(rival, both)
    # where no change was found, theirs is one machine, too
    least = EXPLAINED * (rows.total(rows.before, both) if rows.fitted else theirs)
    told = evidence(rows.values[:, k], size, (first, last))
    if ours > NO_WORSE * theirs:  # it may do as well by chance, which is not to be sure
        told = min(told, CLEAR)
    if ours > least or ours > _no_worse(rows, both) * theirs or told < -CLEAR:
        return None
    lines = guess.shape, np.linspace(-1.0, 1.0, rows.count)
    grown = min(rows.total(rows.growing(shape[:, None]), both) for shape in lines)
    few = abs(told) <= CLEAR and rows.count - first < rows.setup.enough
    if few and ours <= _no_worse(rows, both) * grown:
        name = rows.setup.model.inputs.names[k]
        raise TooFew(f"{rows.count - first} rows do not tell a shift of {name} from the machine")
    if ours > (CLEARLY if told > CLEAR else NO_WORSE) * grown:
        return None
    return Shift(k, size * guess.shape, first, left, told)


def _no_worse(rows: Rows, both: np.ndarray) -> float:
    """So many times what two machines leave a shift may leave: a few leave more to chance."""
    begins = (rows.whole.restart.code != CONTINUE) & both.any(axis=1)
    return max(NO_WORSE, 1.0 + CHANCE * math.sqrt(2.0 / max(int(np.count_nonzero(begins)), 1)))


def _when(rows: Rows, profile: Profile, record: Vector) -> tuple[int, int]:
    """When a shift that explains most begins, and when it is complete."""
    n = rows.count
    edges = sorted({*np.linspace(0, n, PARTS, endpoint=False).astype(int).tolist(), rows.since})
    spans = [
        (a, b) for a in edges for b in (*edges, n - 1) if a <= b and LEAST <= a <= n - LEAST
    ]  # fmt: skip

    def gain(span: tuple[int, int]) -> float:
        return profile.fitted(shape_of(n, *span))[1]

    best, wide = max(spans, key=gain), n // PARTS
    about = min((a for a, b in spans if a == b), key=lambda a: abs(a - best[1]))
    near = range(max(about - wide, LEAST), min(about + wide, n - LEAST) + 1)
    gains = {a: gain((a, a)) for a in near}
    most = max(gains.values())
    if most < NEARLY * gain(best):
        return best
    # where several do about as well, the record says where it stepped
    steps = np.nan_to_num(np.diff(record, prepend=record[0]))
    size = profile.fitted(shape_of(n, *(2 * (max(gains, key=gains.__getitem__),))))[0]
    stands = np.abs(steps - size) < HALF * abs(size)
    stands &= abs(size) > OF_NOISE * np.median(np.abs(steps))
    good = [a for a, one in gains.items() if one >= (ABOUT if stands[a] else NEARLY) * most]
    first = min(good, key=lambda a: abs(steps[a] - size))
    return first, first


def _after(rows: Rows, first: int) -> Bools:
    return np.asarray(np.arange(rows.count) >= first)


def of_inputs(
    rows: Rows, found: Sequence[Shift], other: SensorChange | None = None
) -> SensorChange:
    """What is said of them; ``other``: an output's offset that explains the rows, too."""
    best, names = found[0], rows.setup.model.inputs.names
    looks = ", or ".join(_said(rows, one) for one in found)
    if best.sure:
        return SensorChange(names[best.column], 1.0, (
            f"{looks}: its own record leaves its usual course by as much, and no tuning explains "
            "these rows better; nothing is learned from it"
        ), None, rows.row(best.first))  # fmt: skip
    if other is not None:
        looks = f"{other.said.partition(': as an offset')[0]}, or {looks}"
    return SensorChange(names[best.column] if other is None else other.channel, 1.0, (
        f"{looks}; a machine that changed explains these rows no better: sensor or machine, that "
        "cannot be told from these rows; nothing is learned until it can"
    ))  # fmt: skip


def _said(rows: Rows, one: Shift) -> str:
    channel = rows.setup.model.inputs.channels[one.column]
    grown = int(np.argmax(np.abs(one.by))) - one.first > AT_ONCE
    size = in_words.difference(rows.setup, channel, float(one.by[-1]))
    since = f"from {called(rows.row(one.first))} on"
    if grown:
        return f"{channel.name} looks off by what has grown to {size} {since}"
    return f"{channel.name} looks off by {size} {since}"
