"""The rows that hypotheses about a gauge are tested on, and what is off on them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from evertwin.errors import DataError, ModelError
from evertwin.fold import Block, Windows, take
from evertwin.gauges.rows.reading import Reading
from evertwin.gauges.rows.sensor_change import Refused, since_change, unmeasured
from evertwin.models.kernels.kernel import CONTINUE
from evertwin.rows.channels import unit_told
from evertwin.rows.ring import called
from evertwin.setup.setup import Setup
from evertwin.signals.units import conversion_of
from evertwin.tuning import Fit, Problem
from evertwin.tuning.linear.closed import Reduced
from evertwin.types import Bools, Float64, Outputs, Vector

LEAST = 30
"""Rows that tell anything."""
FAR = 1e6
"""Residual of a row that the model has no answer to [of the usual size]."""
AGAIN = 3.0
"""So many times its usual square the residual is where the version does not hold."""


@dataclass(frozen=True)
class Rows:
    """Rows before and since a change, and a fit to those since then.

    >>> Rows.__name__
    'Rows'
    """

    setup: Setup
    pose: Callable[[Windows], Problem]
    """The problem on some rows; it starts at the version as it is."""
    windows: Windows
    """All rows, those before a change too."""
    problem: Problem
    """Tuned: the rows since the change."""
    fit: Fit
    tune: Callable[[Problem], Fit]
    begins: int | None = None
    """Position of the first row that may be otherwise; None: that of the first that is tuned."""
    earlier: Windows = ()
    """Rows before all these, of which nothing is asked but how channels usually go."""
    seen: np.ndarray | None = None
    """Lowest and highest value of each input on rows before those, (2, nu)."""
    stayed: np.ndarray | None = None
    """How long each input stayed where it was, over all rows (`evertwin.rows.stayed`)."""
    given: Vector | None = None
    """What counts as 1 of each output's residual, (ny,); None: its usual size."""

    @cached_property
    def whole(self) -> Problem:
        """The version as it is, on all rows."""
        return self.pose(self.windows)

    def posed(self, windows: Windows) -> Problem:
        """The version as it is, on rows that are read otherwise. A map expects of the same inputs
        the same, whatever was measured."""
        posed = self.pose(windows)
        if posed.static and _alike(windows, self.windows):
            posed.__dict__["mapped"] = self.whole.mapped
        return posed

    @cached_property
    def since(self) -> int:
        """Position of the first row of the machine as it is now."""
        return self.fitted if self.begins is None else self.begins

    @cached_property
    def risen(self) -> int:
        """Position of the first row of another deviation, whatever is known of when that began."""
        return self.since or since_change(self.before[:, self.setup.watched])

    @property
    def fitted(self) -> int:
        """Position of the first row that is tuned."""
        return self.count - sum(len(one.t) for one in self.problem.windows)

    @property
    def count(self) -> int:
        """How many there are."""
        return sum(len(one.t) for one in self.windows)

    @cached_property
    def before(self) -> Outputs:
        """Residual of the version as it is, (n, ny); NaN where a row does not count."""
        return unchanged(self.whole)

    @cached_property
    def tuned(self) -> Outputs:
        """Residual of the fit, (n, ny); NaN before the change."""
        return self.placed(residual(self.problem, self.fit.values))

    def tuned_on(self, windows: Windows) -> Fit | None:
        """What tuning learns from these rows; None: there is no such machine."""
        found = self._tuned_on(windows)
        return None if found is None else found[1]

    def left_on(self, windows: Windows) -> Outputs | None:
        """Residual, on these rows, of what tuning learns from them, (n, ny)."""
        found = self._tuned_on(windows)
        if found is None:
            return None
        posed, fit = found
        return residual(posed if fit.names == posed.names else posed.tuning(fit.names), fit.values)

    def _tuned_on(self, windows: Windows) -> tuple[Problem, Fit] | None:
        try:
            if not windows:
                return None
            posed = self.pose(windows)  # of fewer recordings, each of which has starts of its own
            names = posed.parameters.names
            posed = posed.tuning(tuple(n for n in self.fit.names if n in names))
            if posed.linear and _alike(windows, self.windows):
                posed.__dict__["reduced"] = self._reduced._replace(y=posed.rows.y)
            return posed, self.tune(posed)
        except (DataError, ModelError):
            return None

    @cached_property
    def _reduced(self) -> Reduced:
        """The columns of what is tuned, on all rows: they do not depend on what was measured."""
        return self.whole.tuning(self.fit.names).reduced

    def growing(self, shapes: Float64[np.ndarray, "n k"], seen: Bools | None = None) -> Outputs:
        """Residual of one machine whose numbers go by ``shapes``, to first order, (n, ny); learned
        on the rows ``seen``, by default all."""
        names = tuple(name for name in self.fit.names if name in self.whole.names)
        posed, values = self.whole.tuning(names), np.array([self.fit[name] for name in names])
        left, pull = residual(posed, values), -posed.jacobian(values)
        grown = [pull * shape[:, None, None] for shape in shapes.T]
        columns = np.concatenate([pull, *grown], axis=2)
        return np.asarray(left + columns @ self.least(columns, left, seen))

    def least(
        self, columns: Float64[np.ndarray, "n ny k"], left: Outputs, seen: Bools | None = None
    ) -> Vector:
        """How much of each column takes most of what is left away, (k,)."""
        a, b = columns / self.sizes[:, None], left / self.sizes
        known = np.isfinite(b) & np.isfinite(a).all(axis=2)
        known = known if seen is None else known & seen[:, None]
        if not known.any():
            return np.zeros(columns.shape[2])
        return -np.asarray(np.linalg.lstsq(a[known], b[known], rcond=1e-9)[0])

    @cached_property
    def sizes(self) -> Vector:
        """What counts as 1 of each output's residual: its usual size, (ny,)."""
        if self.given is not None:
            return self.given
        usual = [self.before[: self.since] if self.since >= LEAST else self.before]
        past = _newest(self.earlier, self.count) if self.since < LEAST else ()
        if sum(len(one.t) for one in past) >= LEAST:  # what is off on all of these was less off
            usual.append(unchanged(self.pose(past)))
        with unmeasured():
            sizes = [np.nanmedian(np.abs(one), axis=0) for one in usual]
        sizes = [np.where(np.isfinite(one) & (one > 0), one, np.inf) for one in sizes]
        found = np.min(sizes, axis=0)
        return np.where(np.isfinite(found), found, 1.0)

    @cached_property
    def zeros(self) -> Vector:
        """What each channel records as 0 [SI], (nu + ny,): 273.15 K where it is degrees Celsius."""
        return np.array([zero_of(self.setup, k) for k in range(self.values.shape[1])])

    @cached_property
    def stop(self) -> int:
        """Position from which on the version holds again as before the change; all rows: none."""
        size = self.squares(self.before)
        usual = size[: self.since]
        if len(usual) < LEAST:
            return self.count
        dt = float(np.median(np.concatenate([one.dt for one in self.windows])))
        span = self.setup.horizon / dt if np.isfinite(self.setup.horizon) and dt > 0 else 0
        wide = max(LEAST, min(round(span), len(size) // 8))
        mean = np.convolve(size, np.full(wide, 1.0 / wide), "same")[self.since :]
        off = np.flatnonzero(mean > AGAIN * max(float(np.mean(usual)), 1.0))
        stop = self.since + (int(off[-1]) + 1 if len(off) else 0)
        return self.count if self.count - stop < 2 * wide or not len(off) else stop

    @cached_property
    def values(self) -> Outputs:
        """Inputs and outputs as they were recorded, (n, nu + ny)."""
        sides = [np.concatenate([one.u, one.y], axis=1) for one in self.windows]
        return np.concatenate(sides)

    @cached_property
    def steps(self) -> Outputs:
        """What each column changes by to the next row, (n − 1, nu + ny); NaN between recordings."""
        ends = np.cumsum([len(one.t) for one in self.windows])[:-1]
        steps = np.diff(self.values, axis=0)
        steps[ends - 1] = np.nan
        return steps

    def under(self, one: Reading, windows: Windows) -> Outputs:
        """Residual under a reading, in what was recorded, (n, ny); far off where the model has no
        answer to what is read."""
        posed = self.posed(windows)
        off = unchanged(posed) / self.sizes_under(one)
        lost = np.isfinite(self.before) & posed.rows.used & np.isfinite(posed.rows.y)
        return np.asarray(np.where(lost & ~np.isfinite(off), FAR * self.sizes, off))

    def sizes_under(self, one: Reading) -> Vector:
        """What a residual of each output under a reading is of what was recorded, (ny,); an angle
        is off by half a turn at most in whatever unit it was recorded."""
        outputs = self.setup.model.outputs
        return np.where(outputs.angles, 1.0, one.factors[len(self.setup.model.inputs) :])

    def of(self, first: int, stop: int) -> tuple[Rows, int]:
        """Enough of them to predict rows [first, stop) from, and the position of the first of
        these: of a map those rows, and what its filter looks at on either side."""
        if len(self.whole.model.states):
            return self, 0
        around = self.setup.residual_filter.around if self.whole.filter is not None else 0
        low, high = max(first - around, 0), min(stop + around, self.count)
        windows, at = list[Block](), 0
        for window in self.windows:
            a, b = (min(max(edge - at, 0), len(window.t)) for edge in (low, high))
            at += len(window.t)
            windows += [take(window, a, b)] if a < b else []
        some = replace(self, windows=tuple(windows), given=self.sizes)
        some.__dict__["before"] = self.before[low:high]
        return some, low

    def changed(self, first: int, stop: int, change: Callable[[Block], Block]) -> Windows:
        """The windows, with rows [first, stop) changed."""
        found, at = list[Block](), 0
        for window in self.windows:
            a, b = (min(max(edge - at, 0), len(window.t)) for edge in (first, stop))
            at += len(window.t)
            if a >= b:
                found.append(window)
                continue
            other = change(take(window, a, b))
            columns = {}
            for name in ("u", "y", "mark"):
                new, old = getattr(other, name), getattr(window, name)
                if not np.array_equal(new, old[a:b], equal_nan=name != "mark"):
                    columns[name] = old.copy()
                    columns[name][a:b] = new
            found.append(window._replace(**columns))
        return tuple(found)

    def until(self, stop: int) -> str:
        """The end of rows [.., stop) in words."""
        return f" to {called(self.row(stop - 1))}" if stop < self.count else " on"

    def refused(self, names: tuple[str, ...], first: int, stop: int) -> Refused | None:
        """Rows [first, stop) of outputs that are over: left out from now on. What goes on is asked
        about again, with what tells it from before."""
        if stop >= self.count:
            return None
        outputs = self.setup.model.outputs.names
        known = names if set(names) <= set(outputs) else outputs  # of a wrong input all is wrong
        return Refused(known, self.row(first), self.row(stop - 1))

    def goes_on(self, first: int, stop: int) -> int | None:
        """Number of the first of rows [first, stop), if they are not over."""
        return self.row(first) if stop >= self.count else None

    def scored(self, place: int) -> np.ndarray:
        """Rows from a place on whose prediction began there: none is from a row before, (n,)."""
        rows = np.arange(self.count) >= place
        if len(self.setup.model.states):
            begins = np.flatnonzero((self.whole.restart.code != CONTINUE) & rows)
            rows &= np.arange(self.count) >= (begins[0] if len(begins) else self.count)
        return rows

    def placed(self, residual: np.ndarray) -> Outputs:
        """A residual of the rows since the change among all rows, (n, ny)."""
        out = np.full(self.before.shape, np.nan)
        out[len(out) - len(residual) :] = residual
        return out

    def squares(self, residual: Outputs) -> Vector:
        """Of each row, outputs by their sizes, (n,)."""
        return np.asarray(np.nansum(np.square(residual / self.sizes), axis=1))

    def total(self, residual: Outputs, rows: np.ndarray) -> float:
        """Sum of these squares over rows, (n,) or (n, ny)."""
        rows = rows if rows.ndim == 2 else rows[:, None]
        return float(np.nansum(np.where(rows, np.square(residual / self.sizes), np.nan)))

    def row(self, place: int) -> int:
        """Number of the row at a position."""
        for window in self.windows:
            if place < len(window.t):
                return window.row + place
            place -= len(window.t)
        return self.windows[-1].row + len(self.windows[-1].t) - 1


def _newest(windows: Windows, rows: int) -> Windows:
    """The last so many rows."""
    found = list[Block]()
    for window in reversed(windows):
        n = len(window.t)
        found += [take(window, max(n - rows, 0), n)] if rows > 0 else []
        rows -= n
    return tuple(reversed(found))


def zero_of(setup: Setup, k: int) -> float:
    """What column ``k`` of inputs and outputs records as 0 [SI]."""
    channel = (*setup.model.inputs, *setup.model.outputs)[k]
    return float(conversion_of(unit_told(setup.spec, channel))[1])


def _alike(windows: Windows, others: Windows) -> bool:
    """Are they the same rows, but for what was measured?"""
    return len(windows) == len(others) and all(
        here is there
        for one, other in zip(windows, others, strict=True)
        for name, here, there in zip(one._fields, one, other, strict=True)
        if name not in ("y", "mark")
    )


def residual(problem: Problem, values: Vector) -> Outputs:
    """Measured − predicted, (n, ny); NaN where a row does not count."""
    return np.asarray(np.where(problem.rows.used, problem.residuals(values), np.nan))


def unchanged(problem: Problem) -> Outputs:
    """The same of the version as it is, without a column of what could be tuned."""
    return np.asarray(np.where(problem.rows.used, problem.first, np.nan))
