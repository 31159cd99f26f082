"""Does an input stay where it is, since about when the machine deviates?

A command may be held for as long as it likes, so an input is doubted only where it has stayed
where it is, to the last digit or to the noise of its sensor, for far longer than it ever did, and
the machine goes on as if it had not: what the input would have to be, for the version as it is to
hold, varies as it did before, and that explains far more than any numbers of the machine do. Of a
machine that became weaker while its command is held, the input that is needed is held, too.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from evertwin.errors import TooFew
from evertwin.gauges.rows.gauge_rows import Rows
from evertwin.gauges.rows.sensor_change import SensorChange, unmeasured
from evertwin.gauges.shifts.off_by import left_with
from evertwin.models.kernels.kernel import CONTINUE
from evertwin.rows.ring import called
from evertwin.rows.stayed import longest
from evertwin.types import Float64, Outputs, Vector

LONGER = 2.0
"""Rows without a change, by those of the longest time without one before."""
LEAST = 30
"""Rows without a change, at least."""
MOVES = 0.5
"""Spread of a watched output since then, at least [of the one before]."""
WIDE = 6.0
"""How far what stays is from where it stays, at most [of its scatter]."""
WHITE = 1.0
"""Mean square of its steps from row to row, at least [of its variance]; 2 of noise alone."""
PARTS, SHORT = 4, 3
"""Parts of a prediction over which what is needed may be another; rows of one at least."""
VARIES = 0.3
"""Spread of what an input would have to be, at least [of its usual one]."""
FEW, ENOUGH = 3, 8
"""Predictions from which on an input may be doubted, and from which on it may be believed."""
EXPLAINED = 0.5
"""Share of what tuning leaves, and of the deviation, that this leaves at most."""
STEPS = 2
"""Steps towards what is needed."""


@unmeasured()
def stuck(rows: Rows, *, reached: bool = False) -> SensorChange | None:
    """The input that no longer changes, of rows that deviate; None: there is none.

    Args:
        rows: before the deviation and since then, tuned.
        reached: does tuning reach what is asked?

    Raises:
        TooFew: it looks so, and it did not change for nearly as long before.
    """
    for k, channel in enumerate(rows.setup.model.inputs.channels):
        before = np.concatenate([np.zeros(0), *(one.u[:, k] for one in rows.earlier)])
        first, most, still = _since(rows.values[:, k], before)
        if still and rows.stayed is not None:
            level = float(np.nanmedian(rows.values[first:, k]))
            most = max(most, longest(rows.stayed[k], level, rows.row(first)))
        count = rows.count - first
        if not first or count < max(LEAST, most):
            continue
        goes_on = _goes_on(rows, k, first)
        if not (still and not reached and _moves(rows, first) if goes_on is None else goes_on):
            continue
        if count < LONGER * most:
            raise TooFew(f"{channel.name} stays where it is, for {count} rows yet")
        stays = "changed" if still else "left its noise"
        return SensorChange(channel.name, 0.0, (
            f"{channel.name} has not {stays} since {called(rows.row(first))}, for {count} rows "
            f"where {most} were the most before, and the machine goes on as if it had: its "
            "signal no longer answers; nothing is learned from it"
        ), None, rows.row(first))  # fmt: skip
    return None


def _since(values: Vector, earlier: Float64[np.ndarray, " m"]) -> tuple[int, int, bool]:
    """Position from which on a channel stays about where it is at the end, but for single rows; the
    longest time that it did before, in rows; and whether it stays to the last digit. ``earlier``:
    what it was before these rows."""
    known = np.flatnonzero(np.isfinite(values))
    record = values[known]
    if len(record) < 2 * LEAST:
        return 0, 0, False
    newest = record[-LEAST:]
    level = float(np.median(newest))
    band = WIDE * 1.4826 * float(np.median(np.abs(newest - level)))
    if not band and np.any(newest != level):  # between two digits
        band = float(np.min(np.abs(newest - level)[newest != level]))
    away = np.abs(record - level) > band
    away[1:-1] &= away[:-2] | away[2:]
    places = np.flatnonzero(away)
    if not len(places):
        return 0, 0, False
    first = int(places[-1]) + 1
    if first >= len(record):
        return 0, 0, False
    if not band:
        past = np.concatenate([earlier[np.isfinite(earlier)], record[:first]])
        changes = np.flatnonzero(np.diff(past)) + 1
        return int(known[first]), int(np.diff([0, *changes.tolist(), len(past)]).max()), True
    stays = record[(first + len(record)) // 2 :]  # it may have come to rest by and by
    if float(np.mean(np.square(np.diff(stays)))) < WHITE * float(np.var(stays)):
        return 0, 0, False  # it still moves, by less
    past = np.concatenate([earlier[np.isfinite(earlier)], record[:first]])
    return int(known[first]), _longest(past, 2.0 * band), False


def _longest(record: Vector, wide: float) -> int:
    """The most rows in turn that lie within a range so ``wide``."""
    best = start = 0
    low, high = list[int](), list[int]()  # positions of the least and the largest, in order
    for k, value in enumerate(record.tolist()):
        while low and record[low[-1]] >= value:
            low.pop()
        while high and record[high[-1]] <= value:
            high.pop()
        low.append(k)
        high.append(k)
        while record[high[0]] - record[low[0]] > wide:
            start = min(low[0], high[0]) + 1
            low, high = ([i for i in some if i >= start] for some in (low, high))
        best = max(best, k - start + 1)
    return best


def _moves(rows: Rows, first: int) -> bool:
    """Does a watched output vary as it did before?"""
    y = rows.values[:, len(rows.setup.model.inputs) :][:, rows.setup.watched]
    now, before = np.nanstd(y[first:], axis=0), np.nanstd(y[:first], axis=0)
    return bool((now >= MOVES * before).any())


def _goes_on(rows: Rows, k: int, first: int) -> bool | None:
    """Would the input have to vary as it did, and does that explain more than tuning does? None:
    there is one prediction, or one a row, which does not tell.

    Raises:
        TooFew: there are few predictions yet.
    """
    begins = np.flatnonzero(rows.whole.restart.code != CONTINUE)
    spans = [(a, b) for a, b in pairwise([*begins.tolist(), rows.count]) if a >= first]
    if not (np.isfinite(rows.setup.horizon) and rows.setup.adopts.any()):
        return None
    found = len(spans) >= FEW and _varies(rows, k, spans, first)
    if not found and len(spans) < ENOUGH:
        raise TooFew(f"{len(spans)} predictions do not tell whether an input still answers")
    return found


def _varies(rows: Rows, k: int, spans: list[tuple[int, int]], first: int) -> bool:
    """The same of these predictions; ``first``: position from which on the input stays."""
    usual = float(np.nanstd(rows.values[:first, k]))
    here = np.zeros(rows.count, dtype=np.bool_)
    here[spans[0][0] :] = True
    needed, left = _needed(rows, k, spans, usual)
    known = np.isfinite(rows.before) & np.isfinite(rows.tuned) & np.isfinite(left) & here[:, None]
    limit = min(rows.total(one, known) for one in (rows.before, rows.tuned))
    enough = np.count_nonzero(known.any(axis=1)) >= LEAST
    varies = np.nanstd(needed[here]) >= VARIES * usual
    return bool(enough and varies and rows.total(left, known) < EXPLAINED * limit)


def _needed(
    rows: Rows, k: int, spans: list[tuple[int, int]], usual: float
) -> tuple[Vector, Outputs]:
    """What has to be added to an input for the version as it is to hold, (n,), and the residual
    then, (n, ny). Each part of a prediction is asked for its own."""
    part = np.full(rows.count, -1)
    for a, b in spans:
        wide = max((b - a + PARTS - 1) // PARTS, SHORT)
        part[a:b] = np.minimum(np.arange(b - a) // wide, PARTS - 1)

    def with_more(by: Vector) -> Outputs:
        return left_with(rows.setup, rows.posed, rows.windows, (k, False), -by)

    slopes = [with_more(np.where(part == m, usual, 0.0)) - rows.before for m in range(PARTS)]
    columns = np.nan_to_num(np.stack(slopes, axis=2) / rows.sizes[:, None])  # (n, ny, parts)
    by, left = np.zeros(rows.count), rows.before
    for _ in range(STEPS):
        off = np.nan_to_num(left / rows.sizes)
        for a, b in spans:
            own = columns[a:b].reshape(-1, PARTS)
            amount = -np.linalg.solve(own.T @ own + np.eye(PARTS), own.T @ off[a:b].ravel())
            by[a:b] += usual * amount[part[a:b]]
        left = with_more(by)
    return by, left
