"""What every look ahead starts from: the live version, what is known of it, and the newest rows.

What the machine will be told are the inputs of the rows to come: either planned (rows of a file),
or the newest stretch again (``repeat``: production goes on as it was), or the last value for ever
(``hold``).

>>> from evertwin.fold import make_block
>>> rows = make_block(t=np.arange(4) * 10**9, u=[[1.0], [2.0], [3.0], [4.0]], y=np.zeros((4, 1)))
>>> coming(rows, 5.0, "repeat").u.ravel().tolist()
[2.0, 3.0, 4.0, 2.0, 3.0]
>>> coming(rows, 2.0, "hold").u.ravel().tolist()
[4.0, 4.0]
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from evertwin.errors import DataError, UsageError
from evertwin.fold import Answer, Block, Event, take
from evertwin.ledger.versions import Versions
from evertwin.models import Model
from evertwin.models.form import Version
from evertwin.refit.recordings.screening import screened
from evertwin.rows.channels import unit_told
from evertwin.rows.feed import Data, Feed
from evertwin.setup.setup import Setup
from evertwin.store import Store
from evertwin.types import Float64, Inputs, Intervals, Outputs, ParameterVector, StateVector, Vector

ENOUGH = 100
"""Rows since the machine changed that tell how far a prediction of it is off."""


@dataclass(frozen=True)
class Basis:
    """The live version and its surroundings.

    >>> Basis.__name__
    'Basis'
    """

    setup: Setup
    versions: Versions
    store: Store
    champion: int

    @property
    def version(self) -> Version:
        """The live version."""
        return self.versions[self.champion]

    @property
    def model(self) -> Model:
        """Its model."""
        return self.versions.model(self.champion)

    @property
    def p(self) -> ParameterVector:
        """Its parameter values, (np,)."""
        return self.version.p

    @property
    def sigma(self) -> ParameterVector:
        """Standard deviations of its values as their fits found them, (np,); 0 where none has."""
        return known_sigmas(self.store, self.version)

    @property
    def recorded(self) -> dict[str, str]:
        """The units in which channels are recorded."""
        channels = (*self.model.inputs, *self.model.outputs)
        return {one.name: unit_told(self.setup.spec, one) for one in channels}

    def rows(self, data: Data = None) -> tuple[Block, ...]:
        """The rows of recordings, one block a task, without obvious errors.

        Raises:
            DataError: there is none.
        """
        feed = Feed(self.setup.spec, self.setup.model)
        blocks = tuple(feed.blocks(data))
        if not blocks:
            raise DataError("expected recordings to look ahead from, got none: name them with data")
        return screened(self.setup, self.model, self.p, blocks).rows

    def alike(self, rows: Sequence[Block]) -> tuple[Block, ...]:
        """Of these rows those of the machine as it is now: since the newest change that the log
        tells of, if it is in them and `ENOUGH` follow it."""
        changed = [e for e in self.store.read("event") if isinstance(e, Event)]
        stamps: list[Any] = [e.evidence.get("time") for e in changed if e.kind == "changed"]
        for k, block in enumerate(rows):
            at = int(np.searchsorted(block.t, stamps[-1])) if stamps else len(block.t)
            if at < len(block.t) and block.t[at] == stamps[-1]:
                new = (take(block, at, len(block.t)), *rows[k + 1 :])
                if sum(len(one.t) for one in new) >= ENOUGH:
                    return new
        return tuple(rows)


def known_sigmas(store: Store, version: Version) -> ParameterVector:
    """Standard deviation of each value of a version, from the fit that found it; else 0."""
    found: dict[tuple[str, float], float] = {}
    for record in store.read("answer"):
        content: Any = record.content if isinstance(record, Answer) else {}
        fit: Mapping[str, Any] = content.get("fit") or {}
        for name, item in fit.get("parameters", {}).items():
            low, high = item["interval95"]
            half = math.inf if None in (low, high) else (high - low) / (2 * 1.96)
            found[name, item["value"]] = half if math.isfinite(half) else 0.0
    pairs = zip(version.names, version.values, strict=True)
    return np.array([found.get(pair, 0.0) for pair in pairs], dtype=np.float64)


def draws(
    model: Model, p: ParameterVector, sigma: ParameterVector, count: int, seed: int
) -> Float64[np.ndarray, "k np"]:
    """Parameter vectors that are as credible as ``p``, inside their bounds, (count, np)."""
    rng = np.random.default_rng(seed)
    spread = p + sigma * rng.standard_normal((count, len(p)))
    low, high = model.parameters.low, model.parameters.high
    return np.where(sigma > 0.0, np.clip(spread, low, high), p)


def through(
    model: Model, starts: Sequence[StateVector], ps: Float64[np.ndarray, "k np"], u: Inputs,
    dt: Intervals,
) -> Float64[np.ndarray, "k n ny"]:  # fmt: skip
    """Outputs under each parameter vector from its own state, (k, n, ny)."""
    if hasattr(model, "simulate_batch"):
        batch: Outputs = model.simulate_batch(np.stack(list(starts)), u, dt, ps)
        return batch
    return np.stack([model.simulate(x, u, dt, p)[1] for x, p in zip(starts, ps, strict=True)])


Mode = Literal["repeat", "hold"]
LARGEST = 1_000_000
"""Most rows of a forecast."""


class Future(NamedTuple):
    """Inputs and intervals of rows to come.

    >>> Future(np.zeros((2, 1)), np.ones(2)).t.tolist()
    [1.0, 2.0]
    """

    u: Inputs
    dt: Intervals

    @property
    def t(self) -> Vector:
        """Time from now at the end of each row [s]."""
        return np.cumsum(self.dt)


def coming(last: Block, horizon: float, mode: Mode) -> Future:
    """The rows of the next ``horizon`` [s] after a recorded block.

    Raises:
        UsageError: the horizon is no duration above zero, or far too long for the rate.
        DataError: the block holds a single row, so no rate.
    """
    if not 0.0 < horizon < np.inf:
        raise UsageError(f"horizon: expected a duration above 0 s, got {horizon}")
    step = usual_step(last)
    u = known_inputs(last)
    dt = last.dt[1:][np.isfinite(last.u[1:]).all(axis=1)]
    if mode == "hold":
        n = _count(horizon / step)
        return Future(np.repeat(u[-1:], n, axis=0), np.full(n, step))
    back = np.cumsum(dt[::-1])
    n = min(int(np.searchsorted(back, horizon * (1 - 1e-9))) + 1, len(u))
    u, dt = u[len(u) - n :], dt[len(dt) - n :]
    _count(horizon / float(dt.mean()))
    times = _count(horizon / float(dt.sum()))
    u, dt = np.tile(u, (times, 1)), np.tile(dt, times)
    stop = int(np.searchsorted(np.cumsum(dt), horizon * (1 - 1e-9))) + 1
    return Future(np.ascontiguousarray(u[:stop]), dt[:stop])


def known_inputs(last: Block) -> Inputs:
    """Those of the rows of a recorded block that have all of theirs, without its first.

    Raises:
        DataError: none has.
    """
    u = last.u[1:]
    known = np.isfinite(u).all(axis=1)
    if not known.any():
        raise DataError("forecast: no row of the last task has all its inputs")
    return np.asarray(u[known])


def usual_step(last: Block) -> float:
    """How far rows of a recorded block are apart, as a rule [s].

    Raises:
        DataError: it holds a single row.
    """
    if len(last.t) < 2:
        raise DataError("forecast: expected at least two rows to know the rate, got one")
    return float(np.median(last.dt[1:]))


def _count(size: float) -> int:
    rows = max(float(np.ceil(size * (1 - 1e-9))), 1.0)
    check_count(rows)
    return int(rows)


def check_count(rows: float) -> None:
    """Refuses more rows to come than can be simulated.

    Raises:
        UsageError: there are too many.
    """
    if not rows <= LARGEST:
        raise UsageError(
            f"horizon: {rows:.7g} rows at this rate, expected {LARGEST} at most: shorten it"
        )
