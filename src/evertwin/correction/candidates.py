"""Every term that could be tried: its structure, where its numbers start, and within what bounds.

The list depends on nothing but the channels, the kinds that are allowed and the ranges in the data,
so that one procedure serves every machine.

>>> from evertwin.fold import make_block
>>> import numpy as np
>>> from evertwin.machines.mobile import Robot1D
>>> rows = make_block(t=np.arange(9) * 10**9, u=np.arange(9.0)[:, None], y=np.zeros((9, 1)))
>>> [(c.term.kind, c.term.variant) for c in propose(Robot1D(), (rows,), ("law",), ("v",), 2.0)]
[('law', ''), ('law', 'clamp'), ('law', 'dead zone')]
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from evertwin.correction.ranges import (
    LEVELS,
    changes_within,
    inputs_of,
    propose_levels,
    quiet_level,
    reach_of,
)
from evertwin.fold import Block
from evertwin.models import Model
from evertwin.models.form import Term

__all__ = ["GRID", "SIMPLE", "Candidate", "propose"]

GRID = 21
"""Nodes of a surface along each channel."""
SIMPLE, SHAPED, FREE = 1, 2, 3
"""Tiers: one or two numbers; a law with a shape; a table or a surface. Climbed in this order."""
THRESHOLDS = 12
"""Start thresholds that are tried for a dead zone."""
MEMORY = 250
"""Most changes of the input that a lag remembers."""


@dataclass(frozen=True)
class Candidate:
    """A term and where its fit starts.

    >>> Candidate(Term("lag", "*"), SIMPLE, ((0.1, 0.2),), (0, 0), (1, 1), (0.05, 0.05)).linear
    False
    """

    term: Term
    tier: int
    starts: tuple[tuple[float, ...], ...]
    """Start values of the term's parameters, in order."""
    low: tuple[float, ...]
    high: tuple[float, ...]
    typical: tuple[float, ...]
    """Size of a considerable change, per parameter."""
    fixed: tuple[int, ...] = ()
    """Parameters that stay at their start value: the fit cannot slide them."""

    @property
    def linear(self) -> bool:
        """Does the effective input depend linearly on the parameters?"""
        return self.term.kind in ("table", "surface")

    @property
    def key(self) -> tuple[str, str, str]:
        """Kind and channels: what is tried once per round."""
        return self.term.kind, self.term.channel, self.term.source


def propose(
    model: Model,
    windows: Sequence[Block],
    kinds: Sequence[str],
    channels: Sequence[str],
    horizon: float,
    quantum: float = 0.0,
) -> tuple[Candidate, ...]:
    """All candidates, simplest first.

    Args:
        kinds: kinds of term that may be tried.
        channels: inputs (for ``state``: states) that may be corrected; empty: all inputs.
        horizon: length of a prediction [s]: no lag is sought beyond it.
        quantum: step of a table's levels; 0: proposed from the data.
    """
    names = model.inputs.names
    chosen = [c for c in channels if c in names] or ([] if channels else list(names))
    reach = {c: reach_of(inputs_of(windows, names.index(c))) for c in names}
    chosen = [c for c in chosen if reach[c] > 0.0]
    found: list[Candidate] = []
    if "lag" in kinds and chosen:
        found.append(_lag(windows, horizon))
    for c in chosen:
        others = [o for o in names if o != c and reach[o] > 0.0]
        u = inputs_of(windows, names.index(c))
        if "coupling" in kinds:
            for o in others:
                found += _couplings(c, o, reach[c], reach[o])
        if "law" in kinds:
            found += _laws(c, u, reach[c])
        if "table" in kinds and u.min() < u.max():
            found.append(_table(c, propose_levels(u, LEVELS, quantum), reach[c]))
        if "surface" in kinds:
            found += [_surface(c, o, windows, names) for o in others]
    if "state" in kinds:
        span = max(float(w.t[-1] - w.t[0]) * 1e-9 for w in windows)
        found += [_state(c, span) for c in channels if c in model.states.names]
    return tuple(sorted(found, key=lambda candidate: candidate.tier))


def _lag(windows: Sequence[Block], horizon: float) -> Candidate:
    """Delay up to a quarter of the horizon, time constant up to the horizon."""
    delay, tau = 0.25 * horizon, horizon
    capacity = min(changes_within(windows, delay) + 2, MEMORY)
    term = Term("lag", "*", levels=(float(capacity),))
    starts = tuple((a * horizon, b * horizon) for a, b in ((0.02, 0.1), (0.1, 0.3)))
    return Candidate(
        term, SIMPLE, starts, (0.0, 1e-3 * horizon), (delay, tau), (0.05 * horizon,) * 2
    )


def _couplings(c: str, o: str, reach: float, other: float) -> Iterator[Candidate]:
    slip = reach / other
    for variant in ("proportional", "magnitude"):
        yield Candidate(
            Term("coupling", c, o, variant), SIMPLE, ((0.0,),), (-3 * slip,), (3 * slip,),
            (0.1 * slip,),
        )  # fmt: skip
    cap, grip = 1 / reach, 1 / (reach * other)
    yield Candidate(
        Term("coupling", c, o, "grip"), SHAPED, ((1.0, 0.3 * cap, 0.3 * grip),), (0.2, 0.0, 0.0),
        (3.0, 10 * cap, 30 * grip), (0.1, 0.3 * cap, 0.3 * grip),
    )  # fmt: skip


def _laws(c: str, u: np.ndarray, reach: float) -> Iterator[Candidate]:
    low, high = (0.2, -0.5 * reach, 0.2 * reach), (3.0, 0.5 * reach, 5.0 * reach)
    typical = (0.1, 0.05 * reach, 0.2 * reach)
    slopes = [(1.0, 0.0, 1.5 * reach), (1.0, 0.0, 0.8 * reach)]
    yield Candidate(Term("law", c), SHAPED, tuple(slopes), low, high, typical)
    quiet = quiet_level(u)
    levels = (quiet,) if quiet > 0.0 else ()
    clamps = tuple((share * reach, *slope) for share in (0.1, 0.3) for slope in slopes)
    bounds = (0.0, *low), (0.6 * reach, *high), (0.05 * reach, *typical)
    yield Candidate(Term("law", c, variant="clamp", levels=levels), SHAPED, clamps, *bounds)
    zones = tuple((threshold, *slope) for threshold in _thresholds(u, reach) for slope in slopes)
    if zones:
        yield Candidate(Term("law", c, variant="dead zone"), SHAPED, zones, *bounds, fixed=(0,))


def _thresholds(u: np.ndarray, reach: float) -> list[float]:
    """Where a dead zone may end: the commands themselves if they are few, else shares of them."""
    size = np.unique(np.abs(u).round(12))
    size = size[(size > 0.0) & (size < 0.6 * reach)]
    if len(size) > THRESHOLDS:
        size = np.unique(np.quantile(size, np.linspace(0.03, 0.97, THRESHOLDS)))
    return [float(v) for v in size]


def _table(c: str, levels: np.ndarray, reach: float) -> Candidate:
    n = len(levels)
    span = 3.0 * reach
    return Candidate(
        Term("table", c, levels=tuple(float(v) for v in levels)), FREE,
        (tuple(float(v) for v in levels),), (-span,) * n, (span,) * n, (0.05 * reach,) * n,
    )  # fmt: skip


def _surface(c: str, o: str, windows: Sequence[Block], names: tuple[str, ...]) -> Candidate:
    grids = []
    for name in (c, o):
        most = float(np.abs(inputs_of(windows, names.index(name))).max())
        grids.append(tuple(float(v) for v in np.linspace(-most, most, GRID)))
    n, span = GRID * GRID, 3.0 * grids[0][-1]
    return Candidate(
        Term("surface", c, o, levels=grids[0], levels2=grids[1]), FREE, ((0.0,) * n,),
        (-span,) * n, (span,) * n, (0.02 * span,) * n,
    )  # fmt: skip


def _state(c: str, span: float) -> Candidate:
    """An extra state at several speeds of exchange: the window's length sets the scale."""
    fast = [1.0 / (span / part) for part in (3.0, 30.0, 300.0)]
    starts = tuple((rate, rate, 0.0) for rate in fast)
    most = 100.0 * fast[-1]
    return Candidate(
        Term("state", c), SHAPED, starts, (0.0, 0.0, -np.inf), (most, most, np.inf),
        (0.3 * fast[1], 0.3 * fast[1], 1.0),
    )  # fmt: skip
