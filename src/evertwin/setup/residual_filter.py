"""The one filter over both sides: residual rows are filtered, so measurement and prediction are.

A filter is linear, so filtering ``measured − predicted`` is filtering both with the same filter. It
is symmetric and leaves rows `delay` late; a fit filters its windows with the same one, so there is
one deviation, in the stream and in a fit. Where weights fall on rows that are not known, or beyond
an end, the others count more. Without a filter rows pass at once.

Rows in which something outside acts count in no figure. That is known up to `hold` rows late,
so rows wait for that, too, before they are judged.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evertwin.setup.released import Released, Waiting
from evertwin.signals.fir import Symmetric


@dataclass(frozen=True)
class ResidualFilter:
    """A symmetric filter over released rows; None: they pass.

    >>> ResidualFilter(None, outputs=6).delay, ResidualFilter(None, outputs=6, hold=19).delay
    (0, 19)
    """

    low_pass: Symmetric | None
    outputs: int
    hold: int = 0
    """Rows until it is known that something outside acted on one."""

    @property
    def around(self) -> int:
        """Rows on either side that the filter looks at."""
        return 0 if self.low_pass is None else self.low_pass.delay

    @property
    def delay(self) -> int:
        """Rows by which a row leaves late."""
        return self.around + self.hold

    def init(self) -> Waiting:
        """Nothing waits."""
        n = self.delay + self.around
        row, t, phase = (np.zeros(n, np.int64) for _ in range(3))
        values, moving = np.zeros((n, 4 * self.outputs)), np.zeros((n, self.outputs), np.bool_)
        ends, outside = (np.zeros(n, np.bool_) for _ in range(2))
        return Waiting(np.zeros(2, np.int64), row, t, phase, values, moving, ends, outside)

    def step(self, state: Waiting, rows: Released) -> tuple[Waiting, Released]:
        """Rows in, rows out ``delay`` later. Consumes ``state``."""
        return self._leave(state, _joined(state, rows), ends=False) if self.delay else (state, rows)

    def flush(self, state: Waiting) -> tuple[Waiting, Released | None]:
        """The rows that wait leave: their task ends, or another version goes live."""
        if not self.delay or state.kept[0] == state.kept[1]:
            return self.init() if state.kept[0] else state, None
        n = int(state.kept[0])
        kept = Waiting(state.kept, *(column[:n] for column in state[1:]))
        return self._leave(state, kept, ends=True)

    def _leave(self, state: Waiting, rows: Waiting, *, ends: bool) -> tuple[Waiting, Released]:
        n, done = len(rows.row), int(state.kept[1])
        stop = n if ends else max(n - self.delay, done)
        out = slice(done, stop)
        # What is filtered needs the rows around it alone, so a cut changes no bit.
        first, ny = max(done - self.around, 0), self.outputs
        values = rows.values[first : stop + self.around]
        values = values if self.low_pass is None else self.low_pass.smooth(values)
        values = values[done - first : stop - first]
        measured, live, old, other = (
            np.ascontiguousarray(values[:, i * ny : (i + 1) * ny]) for i in range(4)
        )
        # a row counts where each that it waits for, or that is filtered with it, does
        acts = np.concatenate([[0], np.cumsum(rows.outside)])
        at = np.arange(done, stop)
        outside = acts[np.minimum(at + self.delay + 1, n)] > acts[np.maximum(at - self.around, 0)]
        left = Released(
            rows.row[out].copy(), rows.t[out].copy(), rows.phase[out].copy(), measured, live, old,
            other, rows.moving[out].copy(), rows.end[out].copy(), outside,
        )  # fmt: skip
        keep = n if ends else max(stop - self.around, 0)
        count = n - keep
        for waiting, column in zip(state[1:], rows[1:], strict=True):
            waiting[:count] = column[keep:]
            waiting[count:] = 0
        state.kept[:] = count, stop - keep
        return state, left


def _joined(state: Waiting, rows: Released) -> Waiting:
    n = int(state.kept[0])
    values = np.concatenate([rows.measured, rows.live, rows.first, rows.other], axis=1)
    new = (rows.row, rows.t, rows.phase, values, rows.moving, rows.end, rows.outside)
    columns = zip(state[1:], new, strict=True)
    return Waiting(state.kept, *(np.concatenate([old[:n], came]) for old, came in columns))
