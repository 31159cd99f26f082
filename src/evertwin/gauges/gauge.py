"""Is it the machine that changed, or the gauge that reads it? Hypotheses, tested against tuning.

Of a version that held, what changed may be the machine's numbers, and it may be a channel: in
another unit, its sign turned, off by a constant, or no longer answering. Each is a prediction of
the same rows, so each is judged as the fit is, in what was recorded:

* a *reading* (`evertwin.gauges.units.misread`) is undone from a row on. No number is fitted; it is
  told where it leaves next to nothing of the deviation, the rows are then as they were before, and
  tuning, with all its numbers, does no better. Where a machine often changes as much (a factor
  below two, an input), tuning has to do clearly worse;
* a sensor that *no longer answers* stays where it is while the machine is predicted to move as it
  did before, when it answered;
* an *offset* of an output, or of an input that jumped, has one number. It and the fit learn it on
  the first rows, and are compared on the rest, block by block: who is better there is believed.
  Where neither is, it cannot be told, and nothing is learned until it can.

At rest nothing is claimed: a hypothesis has to explain a deviation.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from evertwin.errors import TooFew
from evertwin.fold import Windows
from evertwin.gauges.changes.change import split
from evertwin.gauges.frozen.silent import silent
from evertwin.gauges.rows.gauge_rows import LEAST, Rows
from evertwin.gauges.rows.reading import Reading, possible
from evertwin.gauges.rows.sensor_change import SensorChange, unmeasured
from evertwin.gauges.shifts.offset import HELD, NEAR, offset
from evertwin.gauges.units.kinematic import contradicted
from evertwin.gauges.units.misread import ALIKE, PIECES, misread
from evertwin.gauges.units.unit_change import unit_change
from evertwin.models import Model
from evertwin.rows.ring import called
from evertwin.setup.setup import Setup
from evertwin.signals import wrap
from evertwin.signals.mistaken import SIGN
from evertwin.types import Outputs, ParameterVector, Vector

LEFT = 0.1
"""Largest share of the deviation's square that a reading leaves."""
NEARLY = 0.05
"""The same of channels that leapt together, of which no more is asked: two are right then."""
LIKE_TUNING = 1.1
"""So many times what tuning leaves a reading may leave, where no machine changes as much."""
CLEARLY = 2.0
"""So many times what a reading leaves tuning has to leave, where a machine may change as much; and
the largest such factor."""
RARELY = 5.0
"""The same of a twin that was off as much before, of which little is told."""
RESTORED = 4.0
"""Mean square, undone, over that of the rows before, at most."""
FEW = 300
"""Rows on which every reading is tried first."""
HALF = 0.5
"""Share of the squared deviation that a reading leaves on these, at most."""
JUMP = 2.0
"""Times the largest step before from which a step is a jump."""
LEVEL = 0.9
"""Quantile of a channel's size that is its level."""
VARIES = 0.3
"""Spread of an input by which the machine is driven, at least [of its usual one]."""


def at_once(
    rows: tuple[Setup, Model, ParameterVector, Windows], whole: Windows
) -> tuple[SensorChange | None, TooFew | None]:
    """What became of a channel, before anything is tuned; or that the rows are too few to tell.

    Args:
        rows: with the version's numbers, of the machine as it is now.
        whole: these rows and those before.

    Raises:
        TooFew: of a static map, of which tuning beside it tells no more.
    """
    old = sum(len(one.t) for one in whole) - sum(len(one.t) for one in rows[-1])
    history, _ = split(whole, old)
    try:
        return unit_change(*rows) or misread(*rows, history=history), None
    except TooFew as error:
        if not len(rows[1].states):
            raise
        return None, error


@unmeasured()
def misgauged(rows: Rows, silent_input: SensorChange | None = None) -> SensorChange | None:
    """What became of a channel, and is not to be learned; None: it is the machine.

    Args:
        rows: of a machine that held.
        silent_input: an input that has not changed for long, told where no reading explains more.

    Raises:
        TooFew: an output stays where it is, while no input has changed that would move it.
    """
    return _reading(rows) or silent_input or silent(rows) or offset(rows)


@unmeasured()
def reread(rows: Rows) -> SensorChange | None:
    """The reading that sets in within rows of a machine that never held: what was off before may
    stay."""
    return _reading(rows)


def _reading(rows: Rows) -> SensorChange | None:
    found = []
    for one in possible(rows.setup, rows.setup.model):
        at = _together(rows, one)
        likely = _alike(rows, one) and _plausible(rows, one, at or rows.since, rows.count)
        if not (likely and (_helps(rows, one) or (at and _helps(rows, one, at)))):
            continue
        first, stop = _span(rows, one)
        first = at if at and abs(at - first) <= NEAR else _onset(rows, one, first)
        inputs = one.factors[: len(rows.setup.model.inputs)]
        if contradicted(rows.setup, rows.windows, (first, stop), inputs) or _tears(
            rows, one, first
        ):
            continue
        left = _plausible(rows, one, first, stop) and _left(rows, one, first, stop)
        if left and one.exact(partial(_in_parts, rows, (first, stop))):
            found.append((left, first, stop, one))
    if not found:
        return None
    found.sort(key=lambda item: item[0])
    least, first, stop, best = found[0]
    said = [one.said for left, _, _, one in found if left <= ALIKE * least][:3]
    return SensorChange(best.channels[0], best.number, (
        f"{', or '.join(said)}, from {called(rows.row(first))}{rows.until(stop)}: read so, "
        f"{100 * (1.0 - least):.1f} % of the squared deviation is gone, which no tuning does "
        "better; nothing is learned from it"
    ), rows.refused(best.channels, first, stop), rows.goes_on(first, stop))  # fmt: skip


def _alike(rows: Rows, one: Reading) -> bool:
    """Are channels exchanged, if any are, of one quantity? Others are asked about at once."""
    model = rows.setup.model
    return len({c.unit for c in (*model.inputs, *model.outputs) if c.name in one.channels}) == 1


def _plausible(rows: Rows, one: Reading, first: int, stop: int) -> bool:
    """Undone on rows [first, stop), do the channels lie where they lie on the others?"""
    apart = np.ones(rows.count, dtype=np.bool_)
    apart[max(first - NEAR, 0) : stop + NEAR] = False
    if np.count_nonzero(apart) < LEAST:
        return True
    model, moved = rows.setup.model, one.moved
    angles = np.concatenate([model.inputs.angles, model.outputs.angles])
    old = wrap(rows.values[:, moved][apart], angles[moved])
    own = wrap(rows.values[first:stop] * one.factors, angles)
    less = (moved & (one.shifts == 0.0) & (np.abs(one.factors) < 1.0))[moved]
    spread, usual = np.nanstd(own[:, moved][:, less], axis=0), np.nanstd(old[:, less], axis=0)
    if (spread < VARIES * usual).any():
        return False  # divided by enough anything is nothing
    new = own / one.factors
    return one.lies_among(old, new) and not one.at_usual_levels(old, new)


def _helps(rows: Rows, one: Reading, first: int = 0) -> bool:
    """Does it explain half of the deviation on a few rows? Most readings explain nothing. What is
    hidden has its history: they are predicted behind all rows before. ``first``: 0 where unknown.
    """
    first = first or _onset(rows, one, rows.risen)
    places = np.flatnonzero(rows.scored(first) & np.isfinite(rows.before).any(axis=1))[:FEW]
    if not len(places):
        return False
    stop = int(places[-1]) + 1
    near, off = rows.of(first, stop)
    after = near.under(one, near.changed(first - off, stop - off, one.undone))
    here = np.zeros(near.count, dtype=np.bool_)
    here[places - off] = True
    known = here[:, None] & np.isfinite(after) & np.isfinite(near.before)
    return near.total(after, known) < HALF * near.total(near.before, known)


def _tears(rows: Rows, one: Reading, first: int) -> bool:
    """Read so, would an output of a model with states leap about row ``first`` as it never did?
    What is recorded in another unit leaps where that begins; read rightly it does not."""
    model, low, high = rows.setup.model, max(first - NEAR, 1), min(first + NEAR + 1, rows.count)
    outputs = np.arange(len(model.inputs), len(one.moved))
    which = outputs[one.moved[outputs] & ~model.outputs.angles]
    near = rows.steps[low - 1 : high - 1, which]
    if not len(model.states) or first < LEAST or one.exchanged or not np.isfinite(near).all():
        return False
    leaps = one.of(rows.values[low:high])[:, which] - rows.values[low - 1 : high - 1, which]
    usual = np.nanmax(np.abs(rows.steps[:, which]), axis=0, initial=0.0)
    return bool((np.abs(leaps).min(axis=0, initial=np.inf) > JUMP * usual).any())


def _together(rows: Rows, one: Reading) -> int:
    """The row from which on all channels have leapt as they never did, one row apart at most, as a
    measured input is of the time between two rows; 0: there is none."""
    steps = np.nan_to_num(np.abs(rows.steps[:, one.moved]))
    if len(steps) < LEAST:
        return 0
    places = np.argmax(steps, axis=0)
    for k, place in enumerate(places.tolist()):
        rest = np.delete(steps[:, k], slice(max(place - 1, 0), place + 2))
        if not steps[place, k] > JUMP * rest.max(initial=0.0):
            return 0
    apart = int(places.max() - places.min())
    return int(places.max()) + 1 if apart <= 1 and places.max() >= LEAST else 0


def _onset(rows: Rows, one: Reading, first: int) -> int:
    """The row near ``first`` at which the channels jump most, where they do: what is hidden goes
    wrong by each row that is read otherwise than it was recorded."""
    moved = np.flatnonzero(one.moved)
    steps = np.abs(rows.steps[:, moved])
    low, high = max(first - NEAR, 0), min(first + NEAR, len(steps))
    if low < LEAST or high <= low:
        return first
    usual = np.nanmax(steps[:low], axis=0)
    near = np.nan_to_num(steps[low:high] / np.where(usual > 0.0, usual, np.inf)).min(axis=1)
    return low + int(np.argmax(near)) + 1 if near.max() > 1.0 else first


def _span(rows: Rows, one: Reading) -> tuple[int, int]:
    """[first, stop) of the rows that a reading explains best."""
    undone = tuple(one.undone(window) for window in rows.windows)
    gain = rows.squares(rows.before) - rows.squares(rows.under(one, undone))
    sums = np.concatenate([[0.0], np.cumsum(gain)])
    low = np.maximum.accumulate(-sums)  # the least sum so far
    stop = int(np.argmax(sums + low))
    first = int(np.argmin(sums[: stop + 1]))
    rest = rows.count - stop < LEAST
    return first, rows.count if rest else stop


def _left(rows: Rows, one: Reading, first: int, stop: int) -> float:
    """Share of the squared deviation that a reading leaves on its rows, if it is told; or 0."""
    if stop - first < LEAST:
        return 0.0
    mixed = rows.changed(first, stop, one.undone)
    after, scored = rows.under(one, mixed), rows.scored(first) & (np.arange(rows.count) < stop)
    known = np.isfinite(after) & np.isfinite(rows.before) & scored[:, None]
    tuned = known & np.isfinite(rows.tuned)
    count = np.count_nonzero(known.any(axis=1))
    off, left = (rows.total(r, known) for r in (rows.before, after))
    was = _usual(rows, one, first, known)  # what was off before may stay
    more, excess = max(off - was, 0.0), max(left - was, 0.0) if left <= HALF * off else left
    if 0 < count < LEAST and excess <= LEFT * more and _jumped(rows, one, first):
        raise TooFew(f"{count} rows do not tell whether {one.said}")
    if count < LEAST:
        return 0.0
    rival = rows.total(rows.tuned, tuned) / max(rows.total(after, tuned), 1e-300)
    nu = len(rows.setup.model.inputs)
    of_input = (np.flatnonzero(one.factors != 1.0) < nu).any()
    shift = (one.shifts != 0.0).any() and one.number != SIGN
    near = 1.0 / CLEARLY < one.number < CLEARLY and not one.exchanged
    rough = was > LEFT * left and 1.0 / RARELY < one.number < RARELY and not one.exchanged
    usual = of_input or ((near or rough) and not shift)
    worse = CLEARLY if usual else 1.0 / LIKE_TUNING
    if one.exchanged and left > LEFT * off:  # two that drift towards each other are half exchanged
        return 0.0
    nearly = one.exchanged and left <= NEARLY * off and _together(rows, one) > 0
    good = excess <= LEFT * more and (nearly or _restored(rows, one, after, known))
    jumped = (not of_input or rival >= HALF) and _jumped(rows, one, first)
    exact = rival >= 1.0 / LIKE_TUNING  # no number of the machine does better than a unit's
    jumped = bool(jumped or (of_input and exact and _risen(rows, one, first, stop)))
    told = bool(rival >= worse or not tuned.any() or jumped)
    if good and not told and was > LEFT * left:  # tuning took away what was off before, too
        told = bool(_rival(rows, one, stop, tuned) >= worse)
        if told and count < rows.setup.enough:  # few rows are explained by many machines
            raise TooFew(f"{count} rows do not tell whether {one.said}")
    return max(left / off, 1e-12) if good and told else 0.0


def _in_parts(rows: Rows, span: tuple[int, int], one: Reading) -> Vector:
    """Squares that a reading leaves of each part of its rows, (parts,)."""
    (first, stop), after = span, rows.under(one, rows.changed(*span, one.undone))
    scored = np.flatnonzero(rows.scored(first)[:stop])
    return np.array([
        rows.total(after, np.isin(np.arange(rows.count), some))
        for some in np.array_split(scored, PIECES)
    ])  # fmt: skip


def _usual(rows: Rows, one: Reading, first: int, known: np.ndarray) -> float:
    """What the version as it is would leave on rows ``known``, read rightly, by how it did before
    row ``first``; in what was recorded."""
    early = np.isfinite(rows.before) & (np.arange(rows.count) < first)[:, None]
    count = np.count_nonzero(early, axis=0)
    if count.max(initial=0) < LEAST:
        return 0.0
    square = np.where(early, np.square(rows.before / rows.sizes), 0.0).sum(axis=0)
    mean = square / np.maximum(count, 1) / np.square(rows.sizes_under(one))
    return float(mean @ np.count_nonzero(known, axis=0))


def _rival(rows: Rows, one: Reading, stop: int, known: np.ndarray) -> float:
    """What tuning leaves of the rows as they were recorded, over what it leaves of them undone."""
    undone = split(rows.changed(rows.fitted, stop, one.undone), rows.fitted)[1]
    found = rows.left_on(undone)
    if found is None:
        return 0.0
    left = rows.placed(found) / rows.sizes_under(one)
    known = known & np.isfinite(left)
    return rows.total(rows.tuned, known) / max(rows.total(left, known), 1e-300)


def _jumped(rows: Rows, one: Reading, first: int) -> bool:
    """Did a channel of a model with states jump, as it had not before, where the reading begins,
    and does it not, undone? No number of such a model makes its outputs jump, so tuning explains
    only what comes after."""
    which = np.flatnonzero(one.moved)
    if not len(rows.setup.model.states) or not len(which) or first < LEAST:
        return False
    near = slice(max(first - NEAR, 1), first + NEAR)
    for k in which.tolist():
        y = rows.values[:, k]
        before = y[: near.start]
        usual = float(np.nanmax(np.abs(rows.steps[: near.start - 1, k]), initial=0.0))
        drift = float(np.nanmax(np.abs(before[HELD:] - before[:-HELD]), initial=0.0))
        steps = np.nan_to_num(np.abs(rows.steps[near.start - 1 : near.stop - 1, k]))
        at = near.start + int(np.argmax(steps))
        left = abs(one.of(rows.values[at : at + 1])[0, k] - y[at - 1])
        least = max(JUMP * usual, drift)
        if not (steps.max() > JUMP * usual and left <= min(least, HALF * steps.max())):
            return False
    return True


def _risen(rows: Rows, one: Reading, first: int, stop: int) -> bool:
    """Is the level of each channel that is read otherwise nearer to so many times what it was than
    to what it was? That a machine got weaker by as much at the same time is less likely."""
    old, new = rows.values[: max(first - NEAR, 0)], rows.values[first:stop]
    which = np.flatnonzero(one.moved)
    if len(old) < LEAST or one.exchanged or (one.shifts[which] != 0.0).any():
        return False
    before, after = (np.nanquantile(np.abs(v[:, which]), LEVEL, axis=0) for v in (old, new))
    number = 1.0 / np.abs(one.factors[which])
    far = (number >= CLEARLY) | (number <= 1.0 / CLEARLY)
    risen = np.log(np.maximum(after, 1e-300) / np.maximum(before, 1e-300)) / np.log(number)
    return bool((far & (risen > HALF)).all())


def _restored(rows: Rows, one: Reading, after: Outputs, known: np.ndarray) -> bool:
    """Undone, are the rows as near to the model as those before, or behind where there are few?"""
    places = np.flatnonzero(known.any(axis=1))
    for usual in (rows.before[: places[0]], rows.before[places[-1] + 1 :]):
        if np.count_nonzero(np.isfinite(usual).any(axis=1)) >= LEAST:
            break
    else:
        return True
    old = np.nanmean(np.square(usual), axis=0)
    own = after * rows.sizes_under(one)
    new = np.nanmean(np.where(known, np.square(own), np.nan), axis=0)
    return bool((new[np.isfinite(new)] <= RESTORED * old[np.isfinite(new)]).all())
