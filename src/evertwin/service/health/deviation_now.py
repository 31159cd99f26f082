"""Is the live version within what is asked now? Judged on its newest rows, whatever is on trial.

>>> on = np.ones((4, 1), dtype=bool)
>>> rows = Seen(np.full((4, 1), 0.3), on, on[0], np.ones(1))
>>> rows.beyond(0.1, 4).tolist(), rows.beyond(0.5, 4).tolist()
([True], [False])
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from evertwin.fold.marks import Mark
from evertwin.outcome import View
from evertwin.outcome.result import OutputFigures
from evertwin.service.health.past_tense import past
from evertwin.setup.setup import FEW, Setup
from evertwin.types import Bool, Outputs, PerOutput

Judged: TypeAlias = Literal["held", "off", "not yet", "nothing asked"]
LOOKS = 8
"""Looks at what is past in as many rows as it is judged on."""
MOST = 4096
"""Newest rows that it is judged on at most."""


class Seen(NamedTuple):
    """The newest rows of the live version. See the module for an example."""

    off: Outputs
    """What predictions were off by, (n, ny)."""
    counts: Bool[np.ndarray, "n ny"]
    """Where it counts."""
    asked: Bool[np.ndarray, " ny"]
    """Outputs that are held to the requirement."""
    size: PerOutput
    """What the requirement is a share of."""

    @property
    def samples(self) -> np.ndarray:
        """Per output."""
        return np.asarray(self.counts.sum(axis=0))

    @property
    def deviation(self) -> PerOutput:
        """Rms of each output that is asked, as the requirement has it; NaN: not known."""
        squares = np.where(self.counts, self.off, 0.0) ** 2
        with np.errstate(invalid="ignore", divide="ignore"):
            rms = np.sqrt(squares.sum(axis=0) / self.samples) / self.size
        return np.where(self.asked & (self.samples > 0), rms, np.nan)

    def beyond(self, limit: float, whole: int) -> np.ndarray:
        """Outputs that are off by more over a window of ``whole`` rows, were those perfect that
        have not come yet."""
        left = max(1.0, whole / max(len(self.off), 1))
        return np.asarray(self.deviation > limit * np.sqrt(left))


class Now(NamedTuple):
    """What came of it.

    >>> Now("not yet").reason
    ''
    """

    judged: Judged
    reason: str = ""
    """The output that is off most, in words; empty where none is."""
    signal: str = ""
    first: int = 0
    """First row that it was judged on."""
    since: int = 0
    """Stamp of that row [ns]."""
    time: int = 0
    """Stamp of the newest [ns]."""


def off_now(setup: Setup, view: View, live: int, figures: Mapping[str, OutputFigures]) -> Now:
    """Judges the newest rows of the version ``live``.

    Args:
        setup: at the rate of the data.
        view: at least `rows_of` rows, if there are so many.
        live: number of the live version.
        figures: what it came to so far.
    """
    if not np.isfinite(setup.requirement):
        return Now("nothing asked")
    others = np.flatnonzero(view.version != live)
    begin = int(others[-1]) + 1 if len(others) else 0
    rows = slice(max(begin, _first(view, len(view.row), rows_of(setup))), None)
    if not len(view.row[rows]):
        return Now("not yet")
    off, size = view.off[rows], np.ones(len(setup.watched))
    counts = np.isfinite(off) & setup.moving(view.inputs[rows]) & (view.mark[rows] != Mark.EXTERNAL)
    if setup.relative:
        size = np.array([figures[name].size for name in setup.model.outputs.names])
    # of rows long past some stand for all
    whole = rows_of(setup) * len(off) // int(view.row[-1] - view.row[rows][0] + 1)
    seen = Seen(off, counts, setup.watched, size)
    about = int(view.row[rows][0]), int(view.t[rows][0]), int(view.t[-1])
    if seen.samples.max() < min(FEW, whole):
        return Now("not yet", "", "", *about)
    if not seen.beyond(setup.requirement, whole).any():
        return Now("held" if len(off) >= whole else "not yet", "", "", *about)
    worst = int(np.nanargmax(seen.deviation))
    name = setup.model.outputs.names[worst]
    is_off, limit = (setup.shown(worst, v) for v in (seen.deviation[worst], setup.requirement))
    return Now("off", f"{name} is off by {is_off} (limit {limit})", name, *about)


def looked_back(
    setup: Setup, view: View, figures: Mapping[str, OutputFigures]
) -> list[tuple[int, Now]]:
    """How the version of each time did, from look to look over all rows; with the newest row of
    each."""
    found, whole = [], rows_of(setup)
    ends = np.arange(view.row[0], view.row[-1] + 1, max(whole // LOOKS, 1))[1:]
    for end in np.searchsorted(view.row, ends).tolist():
        part = View(*(column[_first(view, end, whole) : end] for column in view))
        found.append((int(part.row[-1]), off_now(setup, part, int(part.version[-1]), figures)))
    return found


def _first(view: View, end: int, whole: int) -> int:
    """Where ``whole`` rows before place ``end`` begin."""
    return int(np.searchsorted(view.row, view.row[end - 1] - whole, side="right")) if end else 0


def told_now(headline: str, now: Now, *, beyond: bool) -> str:
    """What came of all rows, where the newest say otherwise: both, each in its tense.

    Args:
        headline: what came of all rows since the live version came.
        now: how it does on the newest.
        beyond: was it off by more than is asked over all of them?

    >>> told_now("The twin fits its machine now.", Now("off", "x is off by 3 cm"), beyond=False)
    'Now x is off by 3 cm. Over all rows since it went live: The twin fitted its machine then.'
    """
    if (now.judged == "held" and beyond) or (now.judged == "off" and not beyond):
        within = "On its newest rows the twin is within what is asked"
        first = f"Now {now.reason}" if now.judged == "off" else within
        return f"{first}. Over all rows since it went live: {past(headline)}"
    return headline


def rows_of(setup: Setup) -> int:
    """Rows that it is judged on."""
    return min(setup.enough, MOST)
