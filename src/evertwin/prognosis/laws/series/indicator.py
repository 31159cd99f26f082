"""A health indicator: what tells how worn a component is, and the limit where its life ends.

An indicator is a series of values over time, cycles or runs: a tuned parameter, a function of
several, a statistic of the residual, a measured series, or a quality figure of the process. Each
value may carry its standard deviation; the series may carry covariates (temperature, load, time
since start), the usage so far, and the maintenance done.

>>> friction = Indicator.of("friction", "Nm", Limit(3.0), [0, 1, 2, 3], [1.0, 1.1, 1.2, 1.3])
>>> float(friction.distance()[-1])
1.7

Influences that multiply an indicator: warm-up raises friction by a share, worn or new.

With w the influence (e^(−t/τ) since the start, a temperature difference, a load) the value follows

    y(t) = g(t)·Π (1 + a_i·w_i)         g smooth in time, a_i constant

and wear is in g alone. A quadratic g and the a_i are found by turns, each a linear least-squares
problem; the product is then divided out, down to a reference of w. What the shares leave open is
kept as a covariate. An influence that only adds is a covariate alone.

>>> t = np.arange(40.0)
>>> warm = np.exp(-np.tile([0.0, 3.0], 20))
>>> y = (10.0 + 0.1 * t) * (1.0 + 0.2 * warm)
>>> cold, shares = without_factors(t, y, {"warm": warm}, {"warm": 0.0})
>>> float(np.abs(cold - 10.0 - 0.1 * t).max().round(6)), round(shares["warm"], 6)
(0.0, 0.2)
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from evertwin.errors import DataError, UsageError
from evertwin.prognosis.laws.series.calendar import Calendar
from evertwin.types import Float64

Direction = Literal["above", "below"]


@dataclass(frozen=True)
class Limit:
    """Where the component counts as worn out.

    >>> Limit(1.4, "below", "data sheet").sign
    -1.0
    """

    value: float
    direction: Direction = "above"
    """The harmful side: life ends when the indicator is above, or below, the value."""
    source: str = "by hand"
    """Where the limit comes from, in words."""

    def __post_init__(self) -> None:
        if not np.isfinite(self.value):
            raise UsageError(f"limit: expected a finite number, got {self.value}")
        if self.direction not in ("above", "below"):
            raise UsageError(f"limit: expected 'above' or 'below', got {self.direction!r}")

    @property
    def sign(self) -> float:
        """+1 where wear grows, −1 where it falls."""
        return 1.0 if self.direction == "above" else -1.0


@dataclass(frozen=True)
class Maintenance:
    """Something done to the component.

    >>> Maintenance(120.0, "replaced", "gearbox replaced").kind
    'replaced'
    """

    at: float
    """When, on the indicator's own clock."""
    kind: Literal["replaced", "adjusted", "failed"] = "replaced"
    """``replaced``: a new life begins. ``adjusted``: the level may jump, wear goes on. ``failed``:
    life ended here, wherever the limit lies."""
    note: str = ""


@dataclass(frozen=True)
class Indicator:
    """A series of values that tells wear, with its limit. Values that are NaN are absent.

    Raises `DataError` for arrays that do not fit together.

    >>> Indicator.of("capacity", "Ah", Limit(1.4, "below"), [1, 2], [1.86, 1.85]).clock
    'run'
    """

    name: str
    unit: str
    limit: Limit
    at: Float64[np.ndarray, " n"]
    """When, in ``clock``; must not fall."""
    value: Float64[np.ndarray, " values"]
    sigma: Float64[np.ndarray, " sigmas"]
    """Standard deviation of each value; NaN: not known."""
    clock: str = "run"
    """Unit of ``at`` and of the life that is predicted: s, h, cycle, run."""
    covariates: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Linear influences on the value, such as temperature or load, by name."""
    reference: Mapping[str, float] = field(default_factory=dict)
    """Covariates at which the limit holds; absent: their median."""
    usage: Float64[np.ndarray, " works"] | None = None
    """Work done until ``at`` (cycles, load hours …), where wear goes with it; must not fall."""
    maintenance: tuple[Maintenance, ...] = ()
    origin: float | None = None
    """Where on ``at`` the component was new; None: at the first value."""
    notes: tuple[str, ...] = ()
    """What may surprise in how the series was read."""
    calendar: Calendar | None = None
    """Where ``at`` counts from 1970: moments are told as dates."""
    ratio: bool = False
    """Are values and limit logarithms, and differences told as factors?"""

    @classmethod
    def of(
        cls, name: str, unit: str, limit: Limit, at: Sequence[float] | np.ndarray,
        value: Sequence[float] | np.ndarray,
    ) -> Indicator:  # fmt: skip
        """From plain sequences; everything else through `with_`."""
        values = np.asarray(value, dtype=np.float64)
        times = np.asarray(at, dtype=np.float64)
        return cls(name, unit, limit, times, values, np.full(values.shape, np.nan))

    def shown(self, value: float) -> str:
        """A value with its unit, as it is told; a plain number stands alone."""
        if self.ratio:
            return f"a factor of {np.exp(value):.4g}"
        return f"{value:.4g}" if self.unit == "1" else f"{value:.4g} {self.unit}"

    def moment(self, at: float) -> str:
        """A moment on the clock in words: a date where there are dates."""
        return f"{at:.4g} {self.clock}" if self.calendar is None else self.calendar.said(at)

    def with_(self, **changes: object) -> Indicator:
        """A copy with other fields.

        >>> Indicator.of("f", "Nm", Limit(3.0), [0], [1.0]).with_(clock="h").clock
        'h'
        """
        return replace(self, **changes)  # type: ignore[arg-type]

    def __post_init__(self) -> None:
        n = self.at.shape
        arrays = {"value": self.value, "sigma": self.sigma, **self.covariates}
        arrays |= {} if self.usage is None else {"usage": self.usage}
        for name, array in arrays.items():
            if array.shape != n or array.ndim != 1:
                raise DataError(
                    f"indicator {self.name}: expected {name} of shape {n} like its times, "
                    f"got {array.shape}"
                )
        for name, array in {"times": self.at, **arrays}.items():
            clock = name in ("times", "usage")
            if clock and not (np.all(np.isfinite(array)) and np.all(np.diff(array) >= 0.0)):
                raise DataError(
                    f"indicator {self.name}: expected finite {name} that do not fall; sort the "
                    "series by them"
                )

    def distance(self) -> Float64[np.ndarray, " values"]:
        """From each value to the limit; negative once the limit is passed."""
        return self.limit.sign * (self.limit.value - self.value)

    def until(self, moment: float) -> Indicator:
        """What was known at ``moment``: no later value, no later maintenance."""
        return self._take(self.at <= moment, [m for m in self.maintenance if m.at <= moment])

    def seen_at(self, now: float) -> Indicator:
        """The series as it is looked at later: one more row, without a value, at ``now``.

        Lives are told from the last row on. Work goes on as it did.

        >>> old = Indicator.of("f", "Nm", Limit(3.0), [0, 1], [1.0, 1.1])
        >>> old.seen_at(5.0).at
        array([0., 1., 5.])
        """
        if not len(self.at) or now <= self.at[-1]:
            return self
        absent = np.full(1, np.nan)
        usage = self.usage
        if usage is not None:
            span = float(self.at[-1] - self.at[0])
            pace = float(usage[-1] - usage[0]) / span if span > 0.0 else 0.0
            usage = np.append(usage, usage[-1] + pace * (now - self.at[-1]))
        return replace(
            self, at=np.append(self.at, now), value=np.append(self.value, absent),
            sigma=np.append(self.sigma, absent), usage=usage,
            covariates={name: np.append(x, absent) for name, x in self.covariates.items()},
        )  # fmt: skip

    def since_replaced(self) -> Indicator:
        """The current life alone: values after the last replacement."""
        marks = [m.at for m in self.maintenance if m.kind == "replaced"]
        if not marks:
            return self
        begin = max(marks)
        later = [m for m in self.maintenance if m.at > begin]
        return replace(self._take(self.at >= begin, later), origin=begin)

    def lives(self) -> tuple[Indicator, ...]:
        """Every life in the series as a history of its own, the newest last.

        >>> twice = Indicator.of("f", "Nm", Limit(3.0), [0, 1, 2], [1.0, 2.9, 1.1])
        >>> [len(one.at) for one in twice.with_(maintenance=(Maintenance(2.0),)).lives()]
        [2, 1]
        """
        ends = sorted({m.at for m in self.maintenance if m.kind == "replaced"})
        found = []
        for begin, end in itertools.pairwise([-np.inf, *ends, np.inf]):
            own = [m for m in self.maintenance if begin < m.at <= end and m.kind != "replaced"]
            part = self._take((self.at >= begin) & (self.at < end), own)
            found.append(part if begin == -np.inf else replace(part, origin=begin))
        return tuple(one for one in found if np.isfinite(one.value).any())

    @property
    def failed(self) -> float | None:
        """When the current life ended by what was said, not by its limit; None: it did not."""
        marks = [m.at for m in self.since_replaced().maintenance if m.kind == "failed"]
        return min(marks, default=None)

    def rows(self, keep: np.ndarray) -> Indicator:
        """Some of the values, by index or mask; all maintenance."""
        return self._take(keep, self.maintenance)

    def _take(self, keep: np.ndarray, maintenance: Sequence[Maintenance]) -> Indicator:
        return replace(
            self, at=self.at[keep], value=self.value[keep], sigma=self.sigma[keep],
            covariates={name: array[keep] for name, array in self.covariates.items()},
            usage=None if self.usage is None else self.usage[keep],
            maintenance=tuple(maintenance),
        )  # fmt: skip


TURNS = 200
LEAST = 8
"""Values that the shares of influences are found from; with fewer nothing is divided out."""
SMALLEST = 0.05
"""A factor never falls below this."""


def without_factors(
    at: Float64[np.ndarray, " n"], value: Float64[np.ndarray, " n"],
    factors: Mapping[str, Float64[np.ndarray, " n"]], reference: Mapping[str, float],
) -> tuple[Float64[np.ndarray, " n"], dict[str, float]]:  # fmt: skip
    """The values as they would be at the reference, and the share of each influence.

    Args:
        at: time of each value.
        value: the values; NaN stays NaN.
        factors: influences by name.
        reference: influence under which values are compared; absent: its median.
    """
    names = list(factors)
    w = np.stack([factors[name] for name in names], axis=1)
    known = np.isfinite(value) & np.isfinite(w).all(axis=1)
    if known.sum() < LEAST + len(names):
        return np.where(known, value, np.nan), {}
    centre = np.array([reference.get(n, float(np.median(factors[n][known]))) for n in names])
    moved = (w - centre)[known]
    span = float(np.ptp(at[known])) or 1.0
    x = (at[known] - at[known][0]) / span
    basis = np.stack([np.ones_like(x), x, x * x], axis=1)
    y, shares = value[known], np.zeros(len(names))
    for _ in range(TURNS):
        factor = np.maximum(np.prod(1.0 + moved * shares, axis=1), SMALLEST)
        level = basis @ np.linalg.lstsq(basis * factor[:, None], y, rcond=None)[0]
        before = shares.copy()
        for k in range(len(names)):
            others = np.prod(1.0 + np.delete(moved * shares, k, axis=1), axis=1) * level
            slope = others * moved[:, k]
            size = float(slope @ slope)
            shares[k] = float(slope @ (y - others)) / size if size > 0.0 else 0.0
        if np.abs(shares - before).max() < 1e-12:
            break
    out = np.full(len(value), np.nan)
    out[known] = y / np.maximum(np.prod(1.0 + moved * shares, axis=1), SMALLEST)
    return out, dict(zip(names, shares.tolist(), strict=True))


def divided(
    indicator: Indicator, factors: Mapping[str, Float64[np.ndarray, " n"]],
    reference: Mapping[str, float],
) -> Indicator:  # fmt: skip
    """The indicator without influences that multiply it.

    Args:
        indicator: the history.
        factors: influences by name, one value for each of the history.
        reference: influence under which the limit holds; absent: its median.

    >>> from evertwin.prognosis.laws.series.indicator import Limit
    >>> warm = np.tile([1.0, 0.0], 10)
    >>> raw = Indicator.of("f", "Nm", Limit(20.0), np.arange(20), 10.0 * (1.0 + 0.2 * warm))
    >>> divided(raw, {"warm": warm}, {"warm": 0.0}).value.round(6).tolist()[:3]
    [10.0, 10.0, 10.0]
    """
    if not factors:
        return indicator
    value, _ = without_factors(indicator.at, indicator.value, factors, reference)
    return indicator.with_(
        value=value, covariates={**indicator.covariates, **factors},
        reference={**indicator.reference, **reference},
    )  # fmt: skip
