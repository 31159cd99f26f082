"""Are stamps in another unit of time than they are read in?

Milliseconds read as seconds make every speed a thousand times too small, of all inputs alike: as
the stamps are read no output follows, and in the other unit all do. Numbers of the model may be
tuned to such rows, as a gain on its bound is; they leave far more.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from evertwin.config import TwinSpec
from evertwin.fold import Block, Windows
from evertwin.gauges.rows.sensor_change import SensorChange
from evertwin.gauges.rows.unlike import Changes, changes
from evertwin.gauges.units.misread import ANSWERED, LEFT, ROWS, WRONG, newest_rows
from evertwin.models import Model
from evertwin.setup.setup import Setup
from evertwin.sources.clocks.stamps import LONG, UNITS, seconds_of
from evertwin.types import ParameterVector

LAST = 2.0**62
"""The latest stamp [ns]."""


class Other(NamedTuple):
    """Another unit that stamps may be in.

    >>> Other("ms", "s").text
    'ms read as s'
    """

    unit: str
    read: str

    @property
    def factor(self) -> float:
        """By which the times between rows would be longer."""
        return (seconds_of(self.unit) or 0.0) / (seconds_of(self.read) or 1.0)

    @property
    def text(self) -> str:
        """What it stands for."""
        return f"{self.unit} read as {self.read}"


def stretched(window: Block, factor: float) -> Block:
    """The rows, ``factor`` times as far apart."""
    t = window.t[0] + np.minimum(np.rint((window.t - window.t[0]) * factor), LAST)
    return window._replace(t=t.astype(np.int64), dt=window.dt * factor)


def stamped_in(spec: TwinSpec) -> str:
    """The unit that all stamps are read in; empty: they are dates, or each source has its own."""
    units = {source.time.unit for source in spec.source}
    return units.pop() if len(units) == 1 and seconds_of(*units) else ""


def others(read: str) -> Iterator[Other]:
    """The other units of time; none where stamps are no numbers.

    >>> [one.unit for one in others("s")]
    ['ms', 'us', 'ns', 'min', 'h']
    """
    return (Other(unit, read) for unit in (*UNITS, *LONG) if read not in ("", unit))


def of_the_clock(
    setup: Setup, model: Model, p: ParameterVector, windows: Windows, tuned: ParameterVector
) -> SensorChange | None:
    """The unit that stamps are in, of a machine that never held; None: the one they are read in.

    Args:
        setup: of the twin.
        model: its model, with ``p`` as it was told.
        p: parameters, (np,).
        windows: rows.
        tuned: parameters that were tuned to them, (np,).
    """
    rows = newest_rows(windows, ROWS)
    if not len(model.states) or not rows:
        return None

    def asked(p: ParameterVector, some: list[Block]) -> Changes:
        found = [changes(model, p, one, setup.horizon) for one in some]
        parts = ([one.measured for one in found], [one.predicted for one in found])
        return Changes(*(np.concatenate(part) for part in parts))

    as_read, fitted = asked(p, rows), asked(tuned, rows).mismatch
    if not (as_read.mismatch > WRONG).all():
        return None
    for other in others(stamped_in(setup.spec)):
        seen = asked(p, [stretched(one, other.factor) for one in rows])
        answered = np.count_nonzero(seen.known) >= ANSWERED * np.count_nonzero(as_read.known)
        near = np.square(seen.mismatch) <= LEFT * np.square(np.minimum(as_read.mismatch, fitted))
        if answered and near.all():
            share = 1.0 - float(np.square(seen.mismatch / as_read.mismatch).mean())
            said = (
                f"the stamps look like {other.text}: so the model explains {100 * share:.0f} % of "
                "the deviation, which no tuning does; check the unit of [[source]] time, nothing "
                "is learned"
            )
            return SensorChange("", 1.0 / other.factor, said)
    return None
