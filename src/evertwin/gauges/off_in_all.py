"""What a sensor would have to be off by for all that was learned since somebody said what looks the
same: against the version before that, not the one that has followed the sensor ever since."""

from __future__ import annotations

import numpy as np

from evertwin.fold import Block
from evertwin.gauges import in_words
from evertwin.gauges.gauge_rows import Rows, unchanged
from evertwin.gauges.output_shift import SHARE, STEPS
from evertwin.ledger.caveats import caveats_of, instead
from evertwin.types import Outputs, Vector


def in_all(rows: Rows, alike: str, before: str) -> str:
    """A caveat, with what its sensor is off by in all.

    Args:
        rows: posed by the version of which nothing was said.
        alike: what is said of a version that came after it.
        before: reason of that version.
    """
    old = caveats_of(before)
    for channel, said in caveats_of(alike).items():
        if channel in old:
            size = _size(rows, channel, scaled="%" in said)
            return alike.replace(said, instead(said, size, old[channel]))
    return alike


def _size(rows: Rows, channel: str, *, scaled: bool) -> str:
    outputs = rows.setup.model.outputs
    last = _last(rows, outputs.index(channel), scaled=scaled)
    by = in_words.difference(rows.setup, outputs.channels[outputs.index(channel)], last)
    return f"{100 * last:+.3g} %" if scaled else by


def _last(rows: Rows, k: int, *, scaled: bool) -> float:
    """What an output is off by at the last row, in SI or as a share, of a machine that stayed as it
    was: before the rows that are tuned a constant, on these as it goes in a line."""
    zero = float(rows.zeros[len(rows.setup.model.inputs) + k])

    def left_with(by: Vector) -> Outputs:
        found, at = list[Block](), 0
        for window in rows.windows:
            y, own = window.y.copy(), by[at : at + len(window.t)]
            y[:, k] = zero + (y[:, k] - zero) / (1.0 + own) if scaled else y[:, k] - own
            found.append(window._replace(y=y))
            at += len(own)
        left = unchanged(rows.pose(tuple(found))).copy()
        left[:, k] *= 1.0 + by if scaled else 1.0
        return left

    step = SHARE if scaled else 5.0 * float(rows.sizes[k])
    at = np.arange(rows.count) - rows.fitted
    ramp = np.clip(at / max(rows.count - rows.fitted, 1), 0.0, 1.0)
    lines = np.stack([at < 0, at >= 0, ramp], axis=1).astype(np.float64)
    by, left = np.zeros(rows.count), rows.before
    slope = (left_with(by + step) - left) / step
    for _ in range(STEPS):
        by = by + lines @ rows.least(slope[:, :, None] * lines[:, None, :], left)
        left = left_with(by)
    return float(by[-1])
