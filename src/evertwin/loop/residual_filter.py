"""The one filter over both sides: residual rows are filtered, so measurement and prediction are.

A filter is linear, so filtering ``measured − predicted`` is filtering both with the same filter. It
is symmetric and leaves rows `delay` late; a fit filters its windows with the same one, so there is
one deviation, in the stream and in a fit. Where weights fall on rows that are not known, or beyond
an end, the others count more. Without a filter rows pass at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evertwin.loop.released import Released, Waiting
from evertwin.signals.fir import Symmetric


@dataclass(frozen=True)
class ResidualFilter:
    """A symmetric filter over released rows; None: they pass.

    >>> ResidualFilter(None, outputs=6).delay
    0
    """

    low_pass: Symmetric | None
    outputs: int

    @property
    def delay(self) -> int:
        """Rows by which a row leaves late."""
        return 0 if self.low_pass is None else self.low_pass.delay

    def init(self) -> Waiting:
        """Nothing waits."""
        n = 2 * self.delay if self.low_pass else 0
        row, t, phase = (np.zeros(n, np.int64) for _ in range(3))
        values, moving = np.zeros((n, 4 * self.outputs)), np.zeros((n, self.outputs), np.bool_)
        return Waiting(np.zeros(2, np.int64), row, t, phase, values, moving, np.zeros(n, np.bool_))

    def step(self, state: Waiting, rows: Released) -> tuple[Waiting, Released]:
        """Rows in, rows out ``delay`` later. Consumes ``state``."""
        if self.low_pass is None:
            return state, rows
        return self._leave(state, _joined(state, rows), ends=False)

    def flush(self, state: Waiting) -> tuple[Waiting, Released | None]:
        """The rows that wait leave: their task ends, or another version goes live."""
        if self.low_pass is None or state.kept[0] == state.kept[1]:
            return self.init() if state.kept[0] else state, None
        n = int(state.kept[0])
        kept = Waiting(state.kept, *(column[:n] for column in state[1:]))
        return self._leave(state, kept, ends=True)

    def _leave(self, state: Waiting, rows: Waiting, *, ends: bool) -> tuple[Waiting, Released]:
        assert self.low_pass is not None
        n, done = len(rows.row), int(state.kept[1])
        stop = n if ends else max(n - self.delay, done)
        out = slice(done, stop)
        # What is filtered needs the rows around it alone, so a cut changes no bit.
        first = max(done - self.delay, 0)
        values = self.low_pass.smooth(rows.values[first:])[done - first : stop - first]
        ny = self.outputs
        measured, live, old, other = (
            np.ascontiguousarray(values[:, i * ny : (i + 1) * ny]) for i in range(4)
        )
        left = Released(
            rows.row[out].copy(), rows.t[out].copy(), rows.phase[out].copy(), measured, live, old,
            other, rows.moving[out].copy(), rows.end[out].copy(),
        )  # fmt: skip
        keep = n if ends else max(stop - self.delay, 0)
        count = n - keep
        for waiting, column in zip(state[1:], rows[1:], strict=True):
            waiting[:count] = column[keep:]
            waiting[count:] = 0
        state.kept[:] = count, stop - keep
        return state, left


def _joined(state: Waiting, rows: Released) -> Waiting:
    n = int(state.kept[0])
    values = np.concatenate([rows.measured, rows.live, rows.first, rows.other], axis=1)
    new = (rows.row, rows.t, rows.phase, values, rows.moving, rows.end)
    columns = zip(state[1:], new, strict=True)
    return Waiting(state.kept, *(np.concatenate([old[:n], came]) for old, came in columns))
