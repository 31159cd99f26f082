"""How widely a simulation has to be drawn until it holds what the machine did.

Domain randomisation (Tobin et al., IROS 2017) draws anew what a simulation does not know: its
parameters (friction, mass, gains), how late inputs act, noise. All of it is drawn ``width`` times
as widely as it is known: a parameter by the deviation that its fit found, else by 5 % of its value;
a lag of the inputs by a quarter of a row; noise by that of the measurement, and a quarter more. At
width 0 there is the simulation as it is, with the noise of the measurement.

A measured value is held where it lies inside the middle 95 % of the draws of its row. The stop
rule: the smallest width at which nothing says that less than 95 % are held, asked of every output.
It is sought in every other stretch of the rows, and counted in the others. What more width costs is
the interval score (Gneiting and Raftery, JASA 2007): the length of the set, and 40 times how far
what it misses lies outside; the least is the best. Where no width holds the machine, numbers are
not what is wrong: the form is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy

from evertwin.ahead.basis import Basis, draws
from evertwin.errors import DataError
from evertwin.features.images.confusions import design_effect, wilson
from evertwin.features.images.randomisation import SHARE
from evertwin.fold import Block, take
from evertwin.models import Model, observed, remembers
from evertwin.models.batch import Batch, mapped
from evertwin.rows.feed import Data
from evertwin.sync.horizon.horizon import residuals, restarts
from evertwin.types import Bools, Float64, Inputs, Int64, Json, Outputs, PerOutput, Vector

WIDTHS = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0)
DRAWS, LAGS = 160, 8
"""Draws, and how many lags are shared among them."""
UNKNOWN, LATE, NOISIER = 0.05, 0.25, 0.25
"""Deviation of a parameter without a fit, in its value; of the lag, in rows; more noise."""
STRETCHES, ROWS = 60, 20_000
"""Stretches that the rows are cut into; rows that are looked at, at most."""
TAIL = (1 - SHARE) / 2


class Held(NamedTuple):
    """One output at one width.

    >>> Held("x", 1.0, 0.9, 0.8, 0.96, 0.2, 1.5).wide
    True
    """

    output: str
    width: float
    share: float
    """Of the measured values inside the simulated 95 %."""
    low: float
    """95 % interval."""
    high: float
    size: float
    """Mean length of the set, in the output's unit."""
    cost: float
    """Mean interval score, over the least of all widths: 1 is the best."""

    @property
    def wide(self) -> bool:
        """Nothing says that it holds too little."""
        return self.high >= SHARE


@dataclass(frozen=True)
class Widening:
    """What came of it.

    >>> Widening(1.0, (), ()).found
    True
    """

    width: float
    """The smallest that holds the machine; NaN: none does."""
    held: tuple[Held, ...]
    """Each output at each width, in the stretches that the width was not sought in."""
    spread: tuple[tuple[str, float], ...]
    """Deviation of each parameter at width 1, in its unit."""

    @property
    def found(self) -> bool:
        """Does any width hold the machine?"""
        return bool(np.isfinite(self.width))

    def to_dict(self) -> dict[str, Json]:
        """Plain content."""
        held: list[Json] = [{**one._asdict(), "wide": one.wide} for one in self.held]
        return {
            "schema": "evertwin.randomise/1", "width": self.width, "share_asked": SHARE,
            "spread": dict(self.spread), "held": held,
        }  # fmt: skip

    def __str__(self) -> str:
        if self.found:
            spread = ", ".join(f"{n} ± {self.width * s:.3g}" for n, s in self.spread)
            said = f"Width {self.width:g} holds the machine (1 σ: {spread})."
        else:
            short = [one for one in self.held if one.width == WIDTHS[-1] and not one.wide]
            worst = ", ".join(f"{o.output} {100 * o.share:.0f} %" for o in short)
            said = f"No width holds the machine ({worst or 'not every output at once'}): its form"
            said += " is another, or something acts that the model has not."
        name = max(len(one.output) for one in self.held)
        lines = [said, "", f"  {'':{name}}  width    held  95 % set     cost"]
        for c in sorted(self.held, key=lambda one: one.output):
            held = f"{100 * c.share:4.1f} %"
            lines.append(f"  {c.output:{name}}  {c.width:5g}  {held}  {c.size:8.3g}  {c.cost:7.3g}")
        return "\n".join(lines)


def widened(basis: Basis, data: Data = None, seed: int = 1) -> Widening:
    """Draws the live version ever more widely beside recordings.

    Raises:
        DataError: too few rows are measured.
    """
    model, p = basis.model, basis.p
    one = _spread(model, p, basis.sigma)
    blocks = _fewer(basis.rows(data))
    noise = _noise(blocks)
    low, high, known = [], [], []
    for width in WIDTHS:
        ends = [_ends(basis, block, (one, noise), (width, seed)) for block in blocks]
        low.append(np.concatenate([end[0] for end in ends]))
        high.append(np.concatenate([end[1] for end in ends]))
        known.append(np.isfinite(low[-1]) & np.isfinite(high[-1]))
    whole = np.logical_and.reduce(known)
    stretch = np.arange(len(whole)) * STRETCHES // max(len(whole), 1)
    sought, counted = stretch % 2 == 0, stretch % 2 == 1
    names = [n for k, n in enumerate(model.outputs.names) if whole[:, k].sum() >= STRETCHES]
    if not names:
        raise DataError(f"expected {STRETCHES} measured rows or more, got {int(whole.sum())}")
    places = [model.outputs.index(name) for name in names]
    both = [
        [[_held(names[i], width, (low[w][:, k], high[w][:, k]), (whole[:, k] & half, stretch))
          for i, k in enumerate(places)] for w, width in enumerate(WIDTHS)]
        for half in (sought, counted)
    ]  # fmt: skip
    width = next((w for w, row in zip(WIDTHS, both[0], strict=True) if all(h.wide for h in row)),
                 float("nan"))  # fmt: skip
    least = np.min([[h.cost for h in row] for row in both[1]], axis=0)
    held = tuple(
        h._replace(cost=h.cost / max(best, 1e-300))
        for row in both[1] for h, best in zip(row, least.tolist(), strict=True)
    )  # fmt: skip
    spread = tuple(
        (name, float(s)) for name, s in zip(model.parameters.names, one, strict=True) if s > 0
    )
    return Widening(width, held, spread)


def _spread(model: Model, p: Vector, sigma: Vector) -> Vector:
    """Deviation of each parameter at width 1, (np,); 0 of those that are not tuned."""
    tuned = np.isin(model.parameters.names, model.parameters.editable)
    reach = np.where(p == 0.0, model.parameters.high - model.parameters.low, np.abs(p))
    rough = np.where(np.isfinite(reach), UNKNOWN * reach, 0.0)
    return np.where(sigma > 0, sigma, np.where(tuned, rough, 0.0))


def _fewer(blocks: Sequence[Block]) -> list[Block]:
    """The first rows of the recordings, as many as are looked at."""
    out, left = list[Block](), ROWS
    for block in blocks:
        if left > 0:
            out.append(take(block, 0, min(left, len(block.t))))
            left -= len(block.t)
    return out


def _noise(blocks: Sequence[Block]) -> PerOutput:
    """Standard deviation of each output's noise, by its second differences, (ny,)."""
    second = np.concatenate([np.diff(block.y, n=2, axis=0) for block in blocks])
    with np.errstate(invalid="ignore"):
        found = np.nanmedian(np.abs(second), axis=0) / (0.6745 * np.sqrt(6.0))
    return np.asarray(np.nan_to_num(found))


def _ends(
    basis: Basis, block: Block, known: tuple[Vector, PerOutput], rule: tuple[float, int]
) -> tuple[Outputs, Outputs]:
    """Measured less the ends of the simulated set, (n, ny): held where one is above 0, and the
    other below; NaN where nothing was measured."""
    (one, noise), (width, seed) = known, rule
    model, rng = basis.model, np.random.default_rng([seed, round(10 * width)])
    ps = draws(model, basis.p, width * one, DRAWS, seed)
    lags = scipy.stats.norm.ppf(0.5 + 0.5 * np.arange(LAGS) / LAGS) * LATE * width
    off = np.empty((DRAWS, *block.y.shape))
    for k, lag in enumerate(lags):
        mine = slice(k, None, LAGS)
        off[mine] = _off(basis, block, ps[mine], _late(block.u, lag))
    twice = np.sqrt(2.0) if len(model.states) else 1.0  # what a prediction starts from has it too
    off += rng.standard_normal(off.shape) * twice * noise * (1 + NOISIER * width)
    gone = np.isnan(off).any(axis=0)
    ends = np.quantile(off, (TAIL, 1 - TAIL), axis=0)
    return np.where(gone, np.nan, ends[0]), np.where(gone, np.nan, ends[1])


def _late(u: Inputs, rows: float) -> Inputs:
    """Inputs that act so many rows later."""
    at = np.maximum(np.arange(len(u)) - rows, 0.0)
    first = np.floor(at).astype(int)
    share = (at - first)[:, None]
    return np.asarray((1 - share) * u[first] + share * u[np.minimum(first + 1, len(u) - 1)])


def _off(
    basis: Basis, block: Block, ps: Float64[np.ndarray, "k np"], u: Inputs
) -> Float64[np.ndarray, "k n ny"]:
    """Measured less simulated under each parameter vector, over the twin's horizon."""
    model = basis.model
    if not len(model.states):
        runs = np.stack([mapped(model, u, block.dt, p) for p in ps])
    else:
        seen = observed(model, np.isfinite(block.y).any(axis=0))
        starts = np.stack([seen.initial(p) for p in ps])
        plan = restarts(block, basis.setup.horizon, starts[0], remembers(seen))
        runs = Batch(seen).run(u, block.dt, ps, plan, starts)
    return np.stack([residuals(model, block, y) for y in runs])


def _held(
    name: str,
    width: float,
    ends: tuple[Vector, Vector],
    rows: tuple[Bools, Int64[np.ndarray, " n"]],
) -> Held:
    """One output, in the rows that count; the cost is not yet compared."""
    (use, stretch), (low, high) = rows, ends
    low, high, group = low[use], high[use], stretch[use]
    inside = (low <= 0) & (high >= 0)
    share, independent = float(inside.mean()), float(len(inside))
    if 0 < share < 1:
        independent /= max(design_effect(inside, group), 1.0)
    least, most = wilson(share, independent)
    missed = np.maximum(low, 0.0) + np.maximum(-high, 0.0)
    cost = float(np.mean(high - low + missed / TAIL))
    return Held(name, width, share, least, most, float(np.mean(high - low)), cost)
