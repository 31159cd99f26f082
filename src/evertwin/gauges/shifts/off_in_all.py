"""What a sensor would have to be off by for all that was learned since somebody said what looks the
same: against the version before that, not the one that has followed the sensor ever since."""

from __future__ import annotations

import numpy as np

from evertwin.gauges.rows import in_words
from evertwin.gauges.rows.gauge_rows import Rows
from evertwin.gauges.shifts.off_by import learned
from evertwin.ledger.caveats import caveats_of, instead


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
            return alike.replace(said, instead(said, size, old[channel])) if size else alike
    return alike


def _size(rows: Rows, channel: str, *, scaled: bool) -> str:
    """What an output is off by at the last row, of a machine that stayed as it was: before the rows
    that are tuned a constant, on these as it goes in a line; empty: by nothing a sensor can be."""
    outputs, nu = rows.setup.model.outputs, len(rows.setup.model.inputs)
    at = np.arange(rows.count) - rows.fitted
    ramp = np.clip(at / max(rows.count - rows.fitted, 1), 0.0, 1.0)
    lines = np.stack([at < 0, at >= 0, ramp], axis=1).astype(np.float64)
    found = learned(rows, (nu + outputs.index(channel), scaled), lines)
    if found is None:
        return ""
    last = float(found[0][-1])
    by = in_words.difference(rows.setup, outputs.channels[outputs.index(channel)], last)
    return f"{100 * last:+.3g} %" if scaled else by
