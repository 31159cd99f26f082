"""Is a channel of a machine with states read wrongly: its sign, its unit, its column?

Every reading that a recording may have had (one channel, or all channels of a unit, times a number
that divides two units; two columns exchanged) is undone in turn, and predictions start from what is
measured then. One that takes next to all of the deviation away, which no tuning does, is told of,
with all others that do it as well: a base that is said to go forwards as it goes backwards looks
like one whose x and y have their signs turned. Nothing is learned from such rows.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from evertwin.errors import TooFew
from evertwin.fold import Block, Mark, Windows, take
from evertwin.gauges.rows.reading import Reading, possible
from evertwin.gauges.rows.sensor_change import LEAST, SensorChange, since_change, unmeasured
from evertwin.gauges.rows.unlike import Changes, changes
from evertwin.models import Model
from evertwin.rows.ring import called
from evertwin.setup.setup import Setup
from evertwin.signals import wrap
from evertwin.types import Float64, Outputs, ParameterVector, Vector

WRONG = 0.6
"""Mismatch of an output from which its reading is doubted, and below which all have to come."""
ANSWERED = 0.9
"""Share of the rows predicted as recorded that are predicted under a reading, too, at least."""
LEFT = 0.1
"""Largest share of the squared mismatch that a reading may leave."""
ALIKE = 1.5
"""What leaves so many times as much explains it as well."""
PARTS = (1.0, 0.7, 0.5, 0.35, 0.25)
"""Shares of the rows, the newest, of which one may be of one reading alone."""
ROWS = 2000
"""Newest rows that are looked at."""
BRIEF = 200
"""Newest of them, which a reading has to better first; most better nothing."""
HALF = 0.5
"""Share of their squared mismatch that it may leave."""
PIECES = 3
"""Parts of the rows, each of which has to tell it."""


@unmeasured()
def misread(
    setup: Setup, model: Model, p: ParameterVector, windows: Windows,
    tuned: ParameterVector | None = None, history: Windows = (),
) -> SensorChange | None:  # fmt: skip
    """The reading that the rows since a change speak for; None: none, or a static map's rows.

    Args:
        setup: of the twin.
        model: its model, with ``p`` as it held; or untuned.
        p: parameters, (np,).
        windows: rows; which of the newest have changed is found out.
        tuned: parameters that may explain the rows as well; None: they had held before.
        history: rows before, as they were recorded.

    Raises:
        TooFew: it looks so, on fewer rows than a deviation is judged on.
    """
    if not len(model.initial(p)) or not windows:
        return None
    rows = sum(len(window.t) for window in windows)
    lasting = newest_rows(windows, rows)
    if not lasting:  # each window is one row, as behind gaps all along
        return None
    since = rows - since_change(_deviation(setup, model, p, lasting))
    values = _recorded(windows)
    for count in (since, *(round(part * rows) for part in PARTS)):
        newest = newest_rows(windows, min(count, ROWS))
        new = len(values) - min(count, ROWS)
        found, old = likeliest(setup, model, p, newest), values[:new]
        old = np.concatenate([_recorded(history), old]) if history else old
        if tuned is None and len(old) >= LEAST:  # what is recorded has a history
            found = tuple(o for o in found if o.lies_among(old[:, o.moved], values[new:]))
        found = tuple(o for o in found if not o.at_usual_levels(old[:, o.moved], values[new:]))
        if not found:
            continue
        left = _off(setup, model, p, [found[0].undone(one) for one in newest])
        if tuned is not None and total(_off(setup, model, tuned, newest)) < 2.0 * total(left):
            continue
        if count < min(setup.enough, ROWS):
            raise TooFew(f"{count} rows do not tell a turned sign or crossed columns from others")
        if tuned is None:  # the version held: no number of it is far off

            def off(one: Reading, rows: list[Block] = newest) -> Vector:
                return _in_parts(seen(setup, model, p, [one.undone(block) for block in rows]))

            found = tuple(one for one in found if one.exact(off))
        if not found:
            continue
        share = 1.0 - total(left) / total(_off(setup, model, p, newest))
        names = found[0].channels
        return SensorChange(names[0], found[0].number, (
            f"{', or '.join(one.said for one in found)}, at the latest from "
            f"{called(newest[0].row)} on: read so, {100 * share:.1f} % of the "
            "squared deviation is gone; nothing is learned from it: correct the twin file or the "
            "recording"
        ), None, newest[0].row if tuned is None else None)  # fmt: skip
    return None


def _recorded(windows: Windows) -> Float64[np.ndarray, "n c"]:
    return np.concatenate([np.concatenate([one.u, one.y], axis=1) for one in windows])


def likeliest(
    setup: Setup, model: Model, p: ParameterVector, windows: Sequence[Block]
) -> tuple[Reading, ...]:
    """Readings that explain what is off, the best first, with up to two that do as well."""
    if not windows:
        return ()
    as_recorded = seen(setup, model, p, windows)
    before = as_recorded.mismatch
    if not before.max(initial=0.0) > WRONG:
        return ()
    found, brief = [], newest_rows(windows, BRIEF)
    rough = _off(setup, model, p, brief)
    shows = bool((rough > WRONG)[before > WRONG].all())  # they tell as well, and ten times faster
    for one in possible(setup, model):
        if shows and not total(
            _off(setup, model, p, [one.undone(window) for window in brief])
        ) < HALF * total(rough):
            continue
        undone = seen(setup, model, p, [one.undone(window) for window in windows])
        after = undone.mismatch
        if np.count_nonzero(undone.known) < ANSWERED * np.count_nonzero(as_recorded.known):
            continue  # the model has no answer to what is read: that explains nothing
        good = total(after) < LEFT * total(before) and after.max() < WRONG
        if good and (after <= before + 0.1).all():
            found.append((total(after), one))
    found.sort(key=lambda pair: pair[0])
    return tuple(one for left, one in found if left <= ALIKE * found[0][0])[:3]


def newest_rows(windows: Sequence[Block], rows: int) -> list[Block]:
    """So many rows, every measured value trusted: the arbiter judged by the reading in doubt."""
    found = list[Block]()
    for window in reversed(windows):
        if rows < 2:
            break
        piece = take(window, max(len(window.t) - rows, 0), len(window.t))
        rows -= len(piece.t)
        mark = np.where(
            np.isfinite(np.concatenate([piece.u, piece.y], axis=1)), Mark.OK, piece.mark
        )
        found.insert(0, piece._replace(mark=mark.astype(np.uint8)))
    return found


def _off(setup: Setup, model: Model, p: ParameterVector, windows: Sequence[Block]) -> Vector:
    """Mismatch of each output over all windows, (ny,)."""
    return seen(setup, model, p, windows).mismatch


def _deviation(setup: Setup, model: Model, p: ParameterVector, windows: Sequence[Block]) -> Outputs:
    """Measured − predicted of all windows, (n, ny)."""
    found = seen(setup, model, p, windows)
    return wrap(found.measured - found.predicted, model.outputs.angles)


def seen(setup: Setup, model: Model, p: ParameterVector, windows: Sequence[Block]) -> Changes:
    """Changes over the horizon in all windows."""
    with np.errstate(all="ignore"):
        some = [changes(model, p, window, setup.horizon) for window in windows]
    measured, predicted = (
        np.concatenate([getattr(one, side) for one in some]) for side in ("measured", "predicted")
    )
    return Changes(measured, predicted)


def _in_parts(seen: Changes) -> Vector:
    """Squared mismatch of each part of the rows, (parts,)."""
    some = np.array_split(np.arange(len(seen.measured)), PIECES)
    return np.array(
        [total(Changes(seen.measured[rows], seen.predicted[rows]).mismatch) for rows in some]
    )


def total(off: Vector) -> float:
    """Squared mismatch of all outputs together."""
    return float(np.sum(np.square(off)))
