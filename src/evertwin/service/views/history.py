"""What was: a span of time in pixels, with the least and the largest value of each.

A pixel without a value is not listed: absent is a gap, never zero.

>>> span = Span(0, 40, 4)
>>> found = pixels(span, np.array([1, 2, 35]), np.array([3.0, -1.0, 5.0]))
>>> found["pixel"], found["low"], found["high"]
([0, 3], [-1.0, 5.0], [3.0, 5.0])
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from evertwin.errors import UsageError
from evertwin.fold import Mark
from evertwin.models import Model
from evertwin.outcome import View
from evertwin.service.twin.live_twin import off
from evertwin.signals.channels import same_turn
from evertwin.sources.spec import SourceSpec
from evertwin.store import SqlStore

WIDEST = 4096
"""Pixels of an answer."""
PIECES = 6000
"""Stored pieces that one answer reads; of a longer span the twin's own rows are shown."""
BAND = 2.0
"""Standard deviations that the band reaches to either side."""


class Span(NamedTuple):
    """From ``first`` to ``last`` [ns], in ``width`` pixels. See the module for an example."""

    first: int
    last: int
    width: int

    @classmethod
    def of(cls, first: float, last: float, width: int) -> Span:
        """From seconds.

        Raises:
            UsageError: it does not end behind its beginning.
        """
        if not (-9e9 < first < last < 9e9):
            raise UsageError(f"first, last: expected seconds, one after the other: {first}, {last}")
        return cls(int(first * 1e9), max(int(last * 1e9), int(first * 1e9) + width), width)

    def at(self, t: np.ndarray) -> np.ndarray:
        """The pixel of each stamp."""
        length = self.last - self.first
        edges = [self.first + k * length // self.width for k in range(1, self.width)]
        return np.searchsorted(np.array(edges, dtype=np.int64), t, side="right")


def pixels(
    span: Span, t: np.ndarray, low: np.ndarray, high: np.ndarray | None = None
) -> dict[str, Any]:
    """Least and largest value by pixel, of the values that are numbers."""
    high = low if high is None else high
    known = np.isfinite(low) & np.isfinite(high) & (t >= span.first) & (t <= span.last)
    at, least = span.at(t[known]), np.full(span.width, np.inf)
    most = np.full(span.width, -np.inf)
    np.minimum.at(least, at, low[known])
    np.maximum.at(most, at, high[known])
    (there,) = np.nonzero(most > -np.inf)
    return {"pixel": there.tolist(), "low": least[there].tolist(), "high": most[there].tolist()}


def of_rows(view: View, model: Model, span: Span, signals: Sequence[str]) -> dict[str, Any]:
    """Rows by signal: measured, predicted, before (by the first version), residual, band, and off:
    the residual of predictions that reached their horizon."""
    names = model.outputs.names
    residual, wide = off(view.measured, view.predicted, model), BAND * view.band
    predicted, before = (
        same_turn(one, view.measured, model.outputs.angles) for one in (view.predicted, view.first)
    )
    found: dict[str, Any] = {}
    for name in signals:
        k = names.index(name)
        columns = {"measured": view.measured, "predicted": predicted, "before": before,
                   "residual": residual, "off": view.off}  # fmt: skip
        one = {key: pixels(span, view.t, column[:, k]) for key, column in columns.items()}
        one["band"] = pixels(span, view.t, (predicted - wide)[:, k], (predicted + wide)[:, k])
        refused = np.where(view.mark[:, k] >= Mark.CONTESTED, view.measured[:, k], np.nan)
        one["refused"] = pixels(span, view.t, refused)
        found[name] = one
    return found


class Stored(NamedTuple):
    """What a twin's store has, and which source brings what.

    >>> Stored._fields
    ('store', 'sources')
    """

    store: SqlStore
    sources: Sequence[SourceSpec]


def of_samples(stored: Stored, span: Span, name: str) -> dict[str, Any] | None:
    """A signal as its samples are stored; None: no source brings it, or they are too many."""
    carried = [one for one in stored.sources if name in one.channels]
    if len(carried) != 1:
        return None
    place, t, v = list(carried[0].channels).index(name), [], []
    for chunk in stored.store.samples(carried[0].name, span.first, span.last):
        t.append(chunk.t)
        v.append(chunk.v[:, place])
        if len(t) > PIECES:
            return None
    return pixels(span, np.concatenate(t), np.concatenate(v)) if t else None


def looked_back(
    stored: Stored, view: View, model: Model, span: Span, signals: Sequence[str]
) -> Mapping[str, Any]:
    """The answer. What is measured is as stored where that can be read at once."""
    found = of_rows(view, model, span, signals)
    for name in signals:
        samples = of_samples(stored, span, name)
        found[name]["stored"] = samples is not None
        if samples is not None:
            found[name]["measured"] = samples
    return {
        "first": span.first * 1e-9, "last": span.last * 1e-9, "width": span.width,
        "version": pixels(span, view.t, view.version.astype(float)), "signals": found,
    }  # fmt: skip
