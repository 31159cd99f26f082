"""Is a channel off by a constant since a change, as an offset of its sensor would have it?

An output may be, by a share too where it leapt, and an input that jumped as it never had: commands
jump as they did.

Where an output leapt, so that its samples overruled the simulation, and the deviation goes with a
constant of about that size since then, tuning gets no say: no number of a machine makes what it
stores leap from one row to the next, so what tuning explains afterwards it explains by accident.
Only a machine quick enough to have leapt, with the numbers that are learned from the rows since
then, is compared as any other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from evertwin.errors import TooFew
from evertwin.fold import Mark
from evertwin.gauges.changes.change import split
from evertwin.gauges.changes.unseen_inputs import elsewhere
from evertwin.gauges.rows import in_words
from evertwin.gauges.rows.gauge_rows import LEAST, Rows, residual, unchanged
from evertwin.gauges.rows.sensor_change import SensorChange, unmeasured
from evertwin.gauges.rows.unlike import changes
from evertwin.gauges.shifts.constant import BLOCKS, SIDES, Constant, beside, left_with
from evertwin.gauges.shifts.input_shift import of_inputs, shifted_inputs
from evertwin.gauges.shifts.off_by import Column
from evertwin.rows.channels import measured
from evertwin.rows.ring import called
from evertwin.signals import Channel, wrap
from evertwin.types import Bools, Outputs, ParameterVector, Vector

HELD = 8
"""Rows for which a channel may be held before what it says is believed."""
NEAR = 25
"""Rows about a change within which an offset sets in."""
KINDS = ("an offset", "a scale")
ALIKE = 1.5
"""What leaves so many times as much explains it about as well."""
SURE = 2.0
"""Standard errors by which the better one leads."""
FIRST = 0.6
"""Share of the rows that both learn on."""
HALF = 0.5
"""Share of the deviation that an offset takes away on unseen rows at least."""
WORSE = 2.0
"""So many times as much is left of rows behind its end, were it still off."""
OF_NOISE = 5.0
"""Size of a constant from which its step stands out [of the steps from row to row]."""
OFTEN = 4
"""Leaps of an output from which on it is the model that is rough."""
AT_ONCE = 1e-9
"""Horizon [s] of predictions from each row to the next."""
SHARE = 0.1
"""What a share is tried with, where nothing leapt by a known size."""
TRIED = 100
"""Rows before a leap on which is tried how far the model misses without one."""


def offset(rows: Rows) -> SensorChange | None:
    """A constant on one channel that explains unseen rows as well as tuning does, or better; that
    these are outside what the version was judged on, where no record of an input speaks for itself.

    Raises:
        TooFew: an output leapt, and rows are too few to tell.
    """
    nu = len(rows.setup.model.inputs)
    for (k, *_), _ in measured(rows.setup.spec, rows.setup.model.inputs).values():
        place = _jump(rows, k)  # what is derived has no offset of its own
        found = _constant(replace(rows, begins=place), ((k, False),)) if place else None
        if found is not None:
            return found
    shifts = shifted_inputs(rows)
    if shifts and shifts[0].sure:
        return of_inputs(rows, shifts)
    found = elsewhere(rows) or leapt(rows)
    if found is not None:
        return found
    watched = np.flatnonzero(rows.setup.watched).tolist()
    columns = [(nu + k, False) for k in watched if not _has_offset(rows, k)]
    found = _constant(rows, columns + [(nu + k, True) for k in watched if _follows(rows, k)])
    return of_inputs(rows, shifts, found) if shifts else found


@unmeasured()
def leapt(rows: Rows) -> SensorChange | None:
    """A constant, or a share, by which an output leapt and has been off since then.

    Raises:
        TooFew: it leapt, and rows are too few to tell.
    """
    nu = len(rows.setup.model.inputs)
    watched = np.flatnonzero(rows.setup.watched).tolist()
    leaps = [(replace(rows, begins=place), k) for k in watched for place in _leaps(rows, k)]
    for some, k in leaps:
        leap = _leap(some, nu + k, rows.whole.full(rows.whole.start))
        turns = bool(rows.setup.model.outputs.angles[k])  # a share of it is another after a turn
        found = _constant(some, [(nu + k, False), (nu + k, True)][: 2 - turns], leap)
        if found is not None:
            return found
    return None


def _constant(
    rows: Rows, columns: Sequence[tuple[int, bool]], leap: float = 0.0
) -> SensorChange | None:
    """``columns``: and whether each is off by a share. ``leap``: of the one column, where the rows
    begin; tuning gets no say then.

    Raises:
        TooFew: it leapt, and is off by about that, on rows that are too few to tell.
    """
    at = np.arange(rows.count)
    scored = rows.scored(rows.since) & (at < rows.stop)
    places = np.flatnonzero(scored)
    if len(places) < 2 * LEAST:
        if leap:
            _wait(rows, columns, leap, scored)
        return None
    cut = int(places[round(FIRST * len(places))])
    seen, unseen = scored & (at < cut), scored & (at >= cut)
    found = [
        (left, k, shift, scaled)
        for k, scaled in columns
        for left, shift in (_shifted(rows, (k, scaled), seen, leap),)
        if left is not None
        and (leap or _stepped(rows, k, _size(rows, (k, scaled), shift)))
        and all(
            rows.total(left, part) < HALF * rows.total(rows.before, part)
            for part in ((seen, unseen) if leap else (unseen,))
        )
    ]
    if not found:
        return None
    left, k, shift, scaled = min(found, key=lambda one: rows.total(one[0], unseen))
    rival = _fit_of(rows, cut)
    if rival is None or (leap and _quick(rows, k, leap)):
        return None
    places = np.flatnonzero(unseen)
    lead = _lead(rows, left, rival, places)
    near = leap or (scaled and rows.total(left, unseen) <= ALIKE * rows.total(rival, unseen))
    if lead < -SURE and not near:
        return None
    grown = np.maximum(at - rows.since, 0)[:, None] / rows.count
    if not leap and _lead(rows, left, rows.growing(grown, at < cut), places) < -SURE:
        return None  # it goes on changing, as no constant does
    channel = (*rows.setup.model.inputs, *rows.setup.model.outputs)[k]
    share = 100.0 * (1.0 - rows.total(left, unseen) / rows.total(rows.before, unseen))
    stop = rows.stop if _over(rows, (k, scaled), shift) else rows.count
    row, until = called(rows.row(rows.since)), rows.until(stop)
    both = {s: _sized(rows, (k, s), by, scored, leap) for _, j, by, s in found if j == k}
    alike = max(one.left for one in both.values()) <= ALIKE * both[scaled].left
    both = both if alike else {scaled: both[scaled]}
    if not (leap or any(one.told for one in both.values())):
        return None
    size, what = _told(rows, channel, both, rows.values[scored, k])
    known = (
        f"{channel.name} looks off by {size} from {row}{until}: as {what} of its sensor "
        f"this explains {share:.0f} % of the deviation on rows that it was not learned on, "
    )
    # rows since then alone do not tell what jumped
    jumped = leap or scaled or k < len(rows.setup.model.inputs)
    lasts = rows.goes_on(rows.since, stop) if jumped else None
    if lead > SURE:
        return SensorChange(
            channel.name, 1.0, f"{known}more than tuning does; nothing is learned from it",
            rows.refused((channel.name,), rows.since, stop), lasts,
        )  # fmt: skip
    why = "and no number of the model makes it leap so" if leap else "and tuning no less"
    said = f"{known}{why}: sensor or machine, that cannot be told from these rows; "
    return SensorChange(channel.name, 1.0, f"{said}nothing is learned until it can", None, lasts)


def _told(
    rows: Rows, channel: Channel, both: Mapping[bool, Constant], read: Vector
) -> tuple[str, str]:
    """The size of an offset, or a scale, or of either where one explains about as much, in words;
    and which of them it is."""
    sizes = {
        scaled: f"{100.0 * one.size:+.3g} ± {100.0 * SIDES * one.error:.2g} %" if scaled
        else in_words.about(rows.setup, channel, one.size, SIDES * one.error)
        for scaled, one in sorted(both.items())
    }  # fmt: skip
    size, what = " or ".join(sizes.values()), " or ".join(KINDS[scaled] for scaled in sizes)
    if len(sizes) > 1:
        level = in_words.level(rows.setup, channel, float(np.nanmedian(read)))
        size += f" (which of the two cannot be told while {channel.name} stays near {level})"
    return size, what


def _wait(rows: Rows, columns: Sequence[tuple[int, bool]], leap: float, scored: Bools) -> None:
    """Rows too few to be learned on and judged by, which an offset explains.

    Raises:
        TooFew: it does.
    """
    if not scored.any() or rows.stop != rows.count:
        return
    lefts = [_shifted(rows, one, scored, leap)[0] for one in columns]
    off, k = HALF * rows.total(rows.before, scored), columns[0][0]
    explains = any(left is not None and rows.total(left, scored) < off for left in lefts)
    if explains and not _quick(rows, k, leap):
        name = (*rows.setup.model.inputs, *rows.setup.model.outputs)[k].name
        said = f"an offset of {name} from a machine that changed"
        raise TooFew(f"{np.count_nonzero(scored)} rows do not tell {said}")


def _leaps(rows: Rows, k: int) -> list[int]:
    """Positions from which on samples of output ``k`` overruled the simulation, the largest step
    first; none where they do often."""
    nu = len(rows.setup.model.inputs)
    mark = np.concatenate([one.mark[:, nu + k] for one in rows.windows])
    places = []
    for place in np.flatnonzero(mark == Mark.OVERRULED).tolist():
        while place > 0 and mark[place - 1] in (Mark.CONTESTED, Mark.ERROR, Mark.ABSENT):
            place -= 1
        places.append(place)
    size = np.nan_to_num(np.abs(rows.steps[:, nu + k]))
    sizes = {place: float(size[place - 1]) for place in places if place > 0}
    # what the model then pulls back to where it was is overruled again, without a step
    large = [one for one, step in sizes.items() if step > HALF * max(sizes.values())]
    known = [place for place in large if LEAST <= place <= rows.count - LEAST]
    return sorted(known, key=lambda one: -sizes[one]) if len(large) < OFTEN else []


def _leap(rows: Rows, k: int, p: ParameterVector) -> float:
    """By how much column ``k``, an output, leapt beyond the model where the rows begin; within two
    rows, as it does where a row lies between two samples."""
    off = _missed(rows, k, p, rows.since)[rows.since :][:2]
    known = off[np.isfinite(off)]
    return float(known[-1]) if len(known) else 0.0


def _missed(rows: Rows, k: int, p: ParameterVector, unseen: int = -1) -> Vector:
    """Measured − predicted of column ``k``, an output, from each row to the next, (n,); the row at
    ``unseen`` tells nothing of the next."""
    found, outputs = list[Vector](), rows.setup.model.outputs
    for window in rows.windows:
        mark = window.mark.copy()
        if 0 <= unseen < len(mark):
            mark[unseen, k] = Mark.CONTESTED
        unseen -= len(mark)
        one = changes(rows.whole.model, p, window._replace(mark=mark), AT_ONCE)
        off = wrap(one.measured - one.predicted, outputs.angles)
        found.append(off[:, k - len(rows.setup.model.inputs)])
    return np.concatenate(found)


def _jump(rows: Rows, k: int) -> int:
    """Position at which an input jumped by far more than it ever did; 0: nowhere."""
    steps = np.nan_to_num(np.abs(rows.steps[:, k]))
    place = int(np.argmax(steps)) + 1 if len(steps) else 0
    rest = np.delete(steps, slice(max(place - 1 - HELD, 0), place + HELD))
    if not LEAST <= place <= rows.count - LEAST or len(rest) < LEAST:
        return 0
    return place if steps[place - 1] > OF_NOISE * rest.max() > 0.0 else 0


def _has_offset(rows: Rows, k: int) -> bool:
    """Does the model have a number that is an offset of this output? Then that takes it up."""
    if len(rows.setup.model.states):
        return False
    columns = rows.problem.jacobian(rows.fit.values)[:, k, :]
    size = np.nanmax(np.abs(columns), axis=0)
    return bool(((size > 0) & (np.nanstd(columns, axis=0) <= 1e-6 * size)).any())


def _follows(rows: Rows, k: int) -> bool:
    """Does output ``k`` of a model with states go by these, and is none of them, so that one number
    of the machine makes it leap by a share as its sensor would?"""
    setup = rows.setup
    return bool(len(setup.model.states) and not (setup.adopts[k] or setup.model.outputs.angles[k]))


def _shifted(
    rows: Rows, one: tuple[int, bool], seen: Bools, leap: float = 0.0
) -> tuple[Outputs | None, float]:
    """Residual with the constant, or the share, on a column that fits the rows ``seen`` best, and
    it; where that leapt, one of about that size."""
    k, scaled = one
    nu = len(rows.setup.model.inputs)
    usual = np.abs(np.diff(rows.values[:, k]))
    shift, step = 0.0, float(rows.sizes[k - nu] if k >= nu else np.nanmax(usual))
    if scaled and not leap:
        step = SHARE
    elif scaled:
        true = float(rows.values[rows.since, k] - rows.zeros[k]) - leap
        leap = step = leap / true if true else np.nan
        if not leap > -1.0:  # a sign that turned is a reading of its own
            return None, 0.0
    here = rows.before
    for _ in range(3):
        there = left_with(rows, one, shift + step)
        slope = (there - here) / step
        known = seen[:, None] & np.isfinite(slope) & np.isfinite(here)
        a = np.where(known, slope / rows.sizes, 0.0)
        b = np.where(known, here / rows.sizes, 0.0)
        if not np.sum(a * a) > 0:
            return None, 0.0
        shift -= float(np.sum(a * b) / np.sum(a * a))
        if leap:
            shift = leap * min(max(shift / leap, HALF), 1.0 + HALF)
        here = left_with(rows, one, shift)
    return here, shift


def _sized(rows: Rows, one: Column, shift: float, seen: Bools, leap: float) -> Constant:
    """How large the constant is by the rows ``seen``, which tell about ``shift``, and by how far it
    leapt, each as sure as it is; its standard error; and squares that are left."""
    found = beside(rows, one, shift, seen)
    if not leap or one[1]:
        return found
    p, variance = rows.whole.full(rows.whole.start), found.error**2
    off = _missed(rows, one[0], p)[max(rows.since - TRIED, 0) : rows.since]
    off = np.abs(off[1:] + off[:-1])  # an input that comes late makes few far larger than most
    own = (float(np.nanmax(off)) / SIDES) ** 2 if np.isfinite(off).any() else np.inf
    share = variance / (variance + own) if variance < np.inf else float(own < np.inf)
    size = found.size + share * (leap - found.size)
    return Constant(size, float(np.sqrt(share * own)) if share else found.error, found.left)


def _size(rows: Rows, one: Column, shift: float) -> float:
    """By how much a constant, or a share, made a column jump where it begins."""
    read = float(rows.values[rows.since, one[0]] - rows.zeros[one[0]])
    return read * shift / (1.0 + shift) if one[1] else shift


def _over(rows: Rows, one: tuple[int, bool], shift: float) -> bool:
    """Do the rows on which the version holds again say so, or would they look the same with the
    channel still off, as a share of next to nothing does?"""
    left = left_with(rows, one, shift, rows.count)
    later = (np.arange(rows.count) >= rows.stop)[:, None]
    known = later & np.isfinite(left) & np.isfinite(rows.before)
    return rows.total(left, known) > WORSE * rows.total(rows.before, known)


def _stepped(rows: Rows, k: int, shift: float) -> bool:
    """Did what is measured jump by the constant where it begins? One that came at once has to;
    one that is lost in the noise from row to row cannot be asked."""
    steps = rows.steps[:, k]
    usual = steps[: max(rows.since - NEAR, 0)]
    if np.count_nonzero(np.isfinite(usual)) < LEAST:
        return _began(rows, k, shift)
    size = float(np.sqrt(np.nanmean(np.square(usual))))
    near = steps[max(rows.since - NEAR, 0) : rows.since + NEAR]
    if k < len(rows.setup.model.inputs):  # of what jumped, the jump is the offset
        return bool(abs(shift / near[np.nanargmax(np.abs(near))] - 1.0) < HALF)
    seen = np.abs(near / shift - 1.0) < HALF
    return bool(abs(shift) < OF_NOISE * size or seen.any())


def _began(rows: Rows, k: int, shift: float) -> bool:
    """The same of a constant that is there from the first row on: did what is measured jump by it
    on the rows before, of which the version held on the first?"""
    if sum(len(one.t) for one in rows.earlier) < 2 * LEAST:
        return True
    posed = rows.pose(rows.earlier)
    left = rows.squares(unchanged(posed))
    if not np.mean(left[: len(left) // 2]) < HALF * np.mean(rows.squares(rows.before)):
        return True
    blocks = (*rows.earlier, *rows.windows)
    values = np.concatenate([np.concatenate([one.u, one.y], axis=1)[:, k] for one in blocks])
    steps = np.diff(values[np.isfinite(values)])
    size = float(np.sqrt(np.mean(np.square(steps[: len(left) // 2]))))
    seen = np.abs(steps / shift - 1.0) < HALF
    return bool(abs(shift) < OF_NOISE * size or seen.any())


def _fit_of(rows: Rows, cut: int) -> Outputs | None:
    """Residual, on the rows behind ``cut`` too, of what tuning learns before it."""
    found = rows.tuned_on(split(rows.problem.windows, max(cut - rows.fitted, 0))[0])
    if found is None:
        return None
    posed = rows.pose(rows.problem.windows).tuning(found.names)  # some may be left out
    return rows.placed(residual(posed, found.values))


def _quick(rows: Rows, k: int, leap: float) -> bool:
    """Would the machine leap so by itself, as it is where the rows begin and since then?"""
    found = rows.tuned_on(split(rows.windows, max(rows.since, rows.fitted))[1])
    return found is not None and abs(leap - _leap(rows, k, found.p)) > HALF * abs(leap)


def _lead(rows: Rows, left: Outputs, rival: Outputs, places: np.ndarray) -> float:
    """By how many standard errors ``left`` is the better one of both."""
    more = rows.squares(rival) - rows.squares(left)
    parts = [float(np.mean(more[block])) for block in np.array_split(places, BLOCKS) if len(block)]
    error = float(np.std(parts, ddof=1) / np.sqrt(len(parts))) if len(parts) > 1 else np.inf
    return float(np.mean(parts)) / error if error > 0 else 0.0
