"""Steps that wear does not take: a part was replaced, a unit changed, a sensor exchanged.

From one row to the next the level moves by many times what its values scatter, and stays there.
Back to where the life began: a new part that nobody wrote down, or another unit. Towards the limit
by exactly the factor of two units: another unit. Both are asked back with their rows. A level that
shifts towards the limit and goes on at its pace may be another sensor or a damage, no row says
which: that is told beside the life; so is a smaller step back, as a filter takes that is cleaned.

>>> from evertwin.prognosis.laws import Limit
>>> pads = 12.0 - 0.3 * (np.arange(50.0) % 30) + 0.05 * np.sin(9.0 * np.arange(50))
>>> pad = Indicator.of("pad", "mm", Limit(3.0, "below"), np.arange(50), pads)
>>> check_steps(pad, "pads.csv", range(2, 52))  # doctest: +ELLIPSIS
Traceback (most recent call last):
...
evertwin.errors.DataError: pads.csv:32: pad: ... was the part replaced ...
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from evertwin.errors import DataError
from evertwin.prognosis.laws import Indicator
from evertwin.prognosis.laws.series.scaled import noise_of, steady
from evertwin.signals.mistaken import mistaken
from evertwin.signals.units import conversion_of, si_unit
from evertwin.types import Vector

FEW = 5
"""Values on each side that a step is seen from."""
WINDOW = 30
"""Values on each side that tell its pace and its scatter."""
SHARE, CLEAR = 0.3, 8.0
"""Of the way from a life's begin to its limit, and of what one value scatters: least of a step."""
LESS = 0.2
"""As `SHARE`, of a step that is told and not asked back."""
ONCE = 0.7
"""Share of a step that lies between two rows."""
BACK, UNDONE, BEYOND = 0.5, 0.7, 1.3
"""A new part: it steps back by that share of the way, and takes back so much of the wear so far;
beyond the begin by so much it is rather another unit."""
SURE, LIKE, BENT = 15.0, 2.5, 0.25
"""As `CLEAR` for a shift that is told; the ratio of its scatters; and the share of it by which its
pace may move the level within the values that it is seen from."""
WITHIN = 0.25
"""Share of the range of the values before a step by which their line may leave it."""
NEAR = 3
"""Rows about a mark that a step beside it belongs to."""
FAR = 10.0
"""Factor of a plain number, of which nobody knows the quantity, from which no damage is likely."""
EXACT, ABOUT = 0.01, 5.0
"""Share of a value by which it may miss what a change of unit makes of it, beside its scatter; and
the factor by which the scatter of few values may."""


class Step(NamedTuple):
    """A level that moves from one row to the next, in the direction of wear.

    >>> Step(30, 1.0, 0.5, 0.01, 0.01, 0.0).size
    -0.5
    """

    row: int
    """First of the new level, among the rows of the series."""
    before: float
    after: float
    scatter: float
    """Standard deviation of one value before it."""
    scattered: float
    """And after it."""
    bent: float
    """By how much the pace after it moves the level from what that before it would."""
    highest: float = -np.inf
    """Level that was there before: a machine that stood still goes on at it."""

    @property
    def size(self) -> float:
        """Towards the limit above 0."""
        return self.after - self.before

    @property
    def returns(self) -> bool:
        """Does it undo what the level once fell by, at the least half of it?"""
        return self.highest - self.before >= 0.5 * self.size

    def in_another_unit(self, sign: float, unit: str) -> bool:
        """Is the new level what a change of unit makes of the old one, told in ``unit``?"""
        old, new = sign * self.before, sign * self.after
        size, zero = conversion_of(unit)
        for one in mistaken(unit, si_unit(unit or "1")):
            factor, read = one.number, (one.of(size * old + zero) - zero) / size
            if factor < 0.0 or (unit in ("", "1") and not one.scale and 1.0 / FAR < factor < FAR):
                continue
            near = EXACT * abs(new) + 3.0 * max(factor * self.scatter, self.scattered) / FEW
            ratio = self.scattered / max(factor * self.scatter, 1e-300)
            if abs(read - new) <= near and 1.0 / ABOUT < ratio < ABOUT:
                return True
        return False


def check_steps(own: Indicator, name: str, lines: Sequence[int]) -> None:
    """Asks back where a life steps back to its begin, or into another unit.

    Args:
        own: the series.
        name: its file.
        lines: the line of each of its rows in that file.

    Raises:
        DataError: with the rows.
    """
    found, (begin, way) = steps(own), _way(own)
    sign = own.limit.sign
    back: list[Step] = []
    units: list[Step] = []
    up = max((one.size for one in found), default=0.0)
    for one in found:
        undone = -one.size / max(one.before - begin, 1e-300)
        idle = 2.0 * up >= -one.size  # it comes and goes
        if -one.size >= BACK * way and undone >= UNDONE and not idle:
            (units if undone > BEYOND else back).append(one)
        elif one.size > 0.0 and not one.returns and one.in_another_unit(sign, own.unit):
            units.append(one)
    for several, asked in (
        (
            units,
            "is it in another unit, or was the part replaced? Correct the rows (delete those "
            "of a stop), or say so",
        ),
        (back, "was the part replaced there? Write replaced (adjusted: the level alone shifted)"),
    ):
        if several:
            one = several[0]
            more = ", ".join(str(lines[other.row]) for other in several[1:])
            also = f", and steps as well at {more}" if more else ""
            raise DataError(
                f"{name}:{lines[one.row]}: {own.name}: expected values that go on from "
                f"{sign * one.before:.4g}, got about {sign * one.after:.4g} from this row on"
                f"{also}: {asked} in a column maintenance"
            )


def shift_of(own: Indicator) -> Step | None:
    """The one step towards the limit after which wear goes on at its pace; None without."""
    for share in (SHARE, LESS):
        found = [one for one in steps(own, share) if one.size > 0.0 and not one.returns]
        if found:
            return found[0] if len(found) == 1 and _goes_on(found[0], share) else None
    return None


def back_of(own: Indicator) -> Step | None:
    """The one step, to about where the life began, after which wear goes on at its pace."""
    found, (begin, _) = steps(own, LESS), _way(own)
    if len(found) != 1:
        return None
    undone = -found[0].size / max(found[0].before - begin, 1e-300)
    return found[0] if UNDONE <= undone <= BEYOND and _goes_on(found[0], LESS) else None


def _goes_on(one: Step, share: float) -> bool:
    """Is it far beyond what values scatter, and do these go on as before? The more so the smaller a
    step by a ``share`` of the way may be."""
    alike = 1.0 / LIKE < one.scattered / max(one.scatter, 1e-300) < LIKE
    clear = abs(one.size) >= SURE * max(one.scatter, one.scattered)
    return alike and clear and one.bent <= BENT * (share / SHARE) ** 2 * abs(one.size)


def _way(own: Indicator) -> tuple[float, float]:
    """Level at which the current life began, and its distance to the limit."""
    life = own.since_replaced()
    value = own.limit.sign * life.value[np.isfinite(life.value)]
    begin = float(np.median(value[:FEW])) if len(value) else 0.0
    return begin, abs(own.limit.sign * own.limit.value - begin)


def steps(own: Indicator, share: float = SHARE) -> tuple[Step, ...]:
    """The steps of the current life beside which nothing is written, by a ``share`` of the way from
    its begin to the limit and more."""
    begun = max((m.at for m in own.maintenance if m.kind == "replaced"), default=-np.inf)
    rows = np.flatnonzero(np.isfinite(own.value) & (own.at >= begun))
    if len(rows) < 2 * FEW:
        return ()
    at, y = own.at[rows], own.limit.sign * own.value[rows]
    level = np.median(np.lib.stride_tricks.sliding_window_view(y, FEW), axis=1)
    moved = level[FEW:] - level[:-FEW]
    jump = np.diff(y)
    least = max(share * _way(own)[1], 0.5 * CLEAR * float(np.median(np.abs(jump))))
    once = jump[FEW - 1 : len(y) - FEW] * np.sign(moved) >= ONCE * np.abs(moved)
    peaks = np.flatnonzero((np.abs(moved) >= least) & once) + FEW
    found = []
    for k in peaks.tolist():
        close = peaks[slice(*np.searchsorted(peaks, (k - WINDOW, k + WINDOW)))]
        others = close[(close != k) & (2.0 * np.abs(moved[close - FEW]) >= abs(moved[k - FEW]))]
        first = max(0, k - WINDOW, *others[others < k].tolist())
        last = min(len(y), k + WINDOW, *others[others > k].tolist())
        near = at[max(k - NEAR, 0)], at[min(k + NEAR, len(at) - 1)]
        said = any(near[0] <= mark.at <= near[1] for mark in own.maintenance)
        if not said and min(k - first, last - k) >= FEW:
            one = _step(at[first:last], y[first:last], k - first, int(rows[k]))
            if abs(one.size) >= max(least, CLEAR * max(one.scatter, one.scattered)):
                found.append(one._replace(highest=float(level[: k - FEW + 1].max())))
    return tuple(found)


def _step(at: Vector, y: Vector, k: int, row: int) -> Step:
    """The step before value ``k``, by the lines on both sides."""
    old, before = steady(at[:k], y[:k])
    new, end = steady(at[k:], y[k:])
    room = WITHIN * float(np.ptp(y[:k]))  # over a gap a line leaves all that was seen
    before += old * float(at[k] - at[k - 1])
    before = float(np.clip(before, y[:k].min() - room, y[:k].max() + room))
    after = end - new * float(at[-1] - at[k])
    span = min(float(at[-1] - at[k]), float(at[k - 1] - at[0]))
    lines = (y[:k] - old * at[:k], y[k:] - new * at[k:])
    scatter, scattered = (_scatter(part) for part in lines)
    return Step(row, before, after, scatter, scattered, abs(new - old) * span)


def _scatter(rest: Vector) -> float:
    """Standard deviation of one value about its line; of a few values the neighbours tell less."""
    return noise_of(rest) if len(rest) > 2 * FEW else float(np.std(rest, ddof=2))
