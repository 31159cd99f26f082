"""The inverse of a drive's map: which set-point gives the speed that is wanted.

The live version is simulated with each set-point held until it has settled; the rate of its output
over the set-points is the map. Its inverse need not exist: below a start threshold nothing moves,
or nothing moves that slowly, and a cap is not passed. Then the nearest speeds that can be had are
told. Set-points are asked only where the recordings have some: beyond, nobody knows the map. So the
other inputs are held at zero only where the recordings have that, else at their median, and this is
said.

What the set-point will really give is uncertain by the parameters' intervals, and by how far
open-loop runs over the recordings were off after the same time.

>>> u, rate = np.linspace(0.0, 0.2, 101), np.clip(np.linspace(0.0, 0.2, 101), 0.06, 0.16)
>>> crossing(lambda v: min(max(v, 0.06), 0.16), u, rate, 0.1).__round__(6)
0.1
>>> crossing(lambda v: min(max(v, 0.06), 0.16), u, rate, 0.03) is None
True
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from evertwin.ahead.basis import Basis, draws
from evertwin.ahead.spread import spread
from evertwin.errors import DataError, UsageError
from evertwin.fold import Block
from evertwin.models import Model
from evertwin.rows.feed import Data
from evertwin.signals.planar import wrapped
from evertwin.signals.units import compatible, from_si
from evertwin.types import Float64, Json, ParameterVector, Vector

POINTS = 101
"""Set-points that the map is told at."""
LEAST, MOST = 20, 5120
"""Rows that a set-point is held for at least, and at most until it has settled."""
SETTLED = 0.01
"""Change of the rate from one quarter of this time to the next that is none, as a share."""
STAYS = 0.05
"""The same from there to the longest time: a slow drift has not settled."""
CLOSE = 0.005
"""How near a speed must come to be had, as a share of the map's height."""
BISECTIONS = 40
ALONE = (
    "recordings are too short to tell how far open-loop runs are off: intervals are of the "
    "parameters alone"
)
DRAWS = 64


@dataclass(frozen=True)
class SetPoint:
    """What to set for one speed, in SI.

    >>> SetPoint(0.1, 0.11, 0.1, (0.09, 0.11), None).set_point
    0.11
    """

    wanted: float
    set_point: float | None
    """None: this speed cannot be had."""
    gives: float
    """Rate that the simulation settles at; NaN where there is no set-point."""
    gives95: tuple[float, float]
    """95 % interval of what the machine will do."""
    nearest: tuple[float | None, float | None] | None
    """Next lower and next higher speed that can be had, where this one cannot."""

    def to_dict(self) -> dict[str, Json]:
        """Plain content."""
        nearest: Json = self.nearest
        return {"wanted": self.wanted, "set_point": self.set_point, "gives": self.gives,
                "gives95": self.gives95, "nearest": nearest}  # fmt: skip


@dataclass(frozen=True)
class Inverse:
    """The map of a drive, and what to set.

    >>> Inverse.__name__
    'Inverse'
    """

    channels: tuple[str, str]
    """Input and output."""
    unit: str
    """SI unit of the set-points."""
    rate_unit: str
    version: int
    set_points: Vector
    rates: Vector
    """That they settle at."""
    answers: tuple[SetPoint, ...]
    note: str
    """What is held beside it, and what the intervals leave out; empty: nothing."""
    direct: bool = False
    """Is the output what is wanted, and not its rate?"""


def inverse(
    basis: Basis, wanted: Sequence[float], unit: str, names: tuple[str, str], data: Data = None
) -> Inverse:
    """Set-points for wanted speeds on the live version.

    Args:
        basis: the live version.
        wanted: speeds, in SI.
        unit: theirs.
        names: of input and output; empty: by the unit.
        data: recordings that tell range and rate.

    Raises:
        UsageError: no input or output measures this.
        DataError: there are no recordings, or the input never varies in them.
    """
    model, p, rows = basis.model, basis.p, basis.rows(data)
    told, given = _input(model, unit, names[0]), _output(model, unit, names[1])
    seen = np.concatenate([block.u[:, told] for block in rows])
    seen = seen[np.isfinite(seen)]
    name = model.inputs.names[told]
    if not len(seen) or not np.ptp(seen) > 0:
        raise DataError(f"setpoint: {name} never varies in the recordings: nothing tells its map")
    dt = float(np.median(np.concatenate([block.dt[1:] for block in rows])))
    beside, note = _others(basis, rows, told)
    direct = compatible(model.outputs.channels[given].unit, unit)
    drive = _Drive(model, (told, given), dt, direct, beside)
    u = np.unique(np.r_[np.linspace(seen.min(), seen.max(), POINTS), 0.0])
    u = u[(u >= seen.min()) & (u <= seen.max())]
    steps = drive.settles(p, u)
    rates = np.array([drive.rate(p, float(one), steps) for one in u])
    off = 0.0
    try:
        long = steps * dt
        off = float(spread(model, p, basis.alike(rows), long).sigma(np.array([long]))[0, given])
        off /= 1.0 if drive.direct else long
    except DataError:
        note = "; ".join([*([note] if note else []), ALONE])
    ps = draws(model, p, basis.sigma, DRAWS, seed=7) if basis.sigma.any() else p[None]

    def answer(speed: float) -> SetPoint:
        found = crossing(lambda one: drive.rate(p, one, steps), u, rates, speed)
        if found is None:
            lower, higher = rates[rates < speed], rates[rates > speed]
            nearest = (float(lower.max()) if len(lower) else None,
                       float(higher.min()) if len(higher) else None)  # fmt: skip
            return SetPoint(speed, None, np.nan, (np.nan, np.nan), nearest)
        gives = drive.rate(p, found, steps)
        scatter = np.std([drive.rate(q, found, steps) for q in ps])
        half = 1.96 * float(np.hypot(scatter, off))
        return SetPoint(speed, found, gives, (gives - half, gives + half), None)

    return Inverse(
        (name, model.outputs.names[given]), model.inputs.channels[told].unit, unit, basis.champion,
        u, rates, tuple(answer(speed) for speed in wanted), note, direct,
    )  # fmt: skip


def _others(
    basis: Basis, rows: Sequence[Block], told: int
) -> tuple[Float64[np.ndarray, " nu"], str]:
    """What each input is held at while another is set, and those that are not at zero in words."""
    u = np.concatenate([block.u for block in rows])
    held, said = np.zeros(u.shape[1]), list[str]()
    for k, channel in enumerate(basis.model.inputs):
        known = u[np.isfinite(u[:, k]), k]
        if k == told or not len(known) or known.min() <= 0.0 <= known.max():
            continue
        held[k] = np.median(known)
        unit = basis.recorded.get(channel.name) or channel.unit
        said.append(f"{channel.name} at {float(from_si(held[k], unit)):.4g} {unit}")
    return held, f"held beside it: {', '.join(said)}" if said else ""


@dataclass(frozen=True)
class _Drive:
    """One input and one output of a model."""

    model: Model
    columns: tuple[int, int]
    dt: float
    direct: bool
    """The output is the speed itself; else its rate is."""
    beside: Float64[np.ndarray, " nu"]
    """What the inputs are held at, (nu,); that of the one that is set does not matter."""

    def course(self, p: ParameterVector, u: float, steps: int) -> Vector:
        """Speed after each row but the first."""
        told = np.tile(self.beside, (steps, 1))
        told[:, self.columns[0]] = u
        _, y = self.model.simulate(self.model.initial(p), told, np.full(steps, self.dt), p)
        one = y[:, self.columns[1]]
        if self.direct:
            return one[1:]
        way = np.diff(one)
        turns = self.model.outputs.angles[self.columns[1]]
        return np.asarray((wrapped(way) if turns else way) / self.dt)

    def rate(self, p: ParameterVector, u: float, steps: int) -> float:
        """Speed that a set-point settles at."""
        course = self.course(p, u, steps)
        return float(course[-(len(course) // 4) :].mean())

    def _quarters(
        self, p: ParameterVector, u: Vector, steps: int
    ) -> tuple[Float64[np.ndarray, "set n"], Float64[np.ndarray, "set n"]]:
        """The last quarter of the courses of some set-points, and the one before it."""
        courses = np.stack([self.course(p, float(one), steps) for one in u])
        quarter = courses.shape[1] // 4
        return courses[:, -quarter:], courses[:, -2 * quarter : -quarter]

    def settles(self, p: ParameterVector, u: Vector) -> int:
        """Rows after which all set-points have settled.

        Raises:
            UsageError: some never do: there is no map from set-point to speed.
        """
        some = u[:: POINTS // 10]
        longest, _ = self._quarters(p, some, MOST)
        # the zero of a temperature tells nothing of its size
        warm = self.direct and self.model.outputs.temperatures[self.columns[1]]
        reach = max(float(np.ptp(longest) if warm else np.abs(longest).max()), 1e-12)
        steps = LEAST
        while steps <= MOST:
            last, before = self._quarters(p, some, steps)
            size = reach if warm else max(float(np.abs(last).max()), 1e-12)
            still = np.abs(last.mean(axis=1) - before.mean(axis=1)).max() <= SETTLED * size
            if still and np.abs(last.mean(axis=1) - longest.mean(axis=1)).max() <= STAYS * size:
                return steps
            steps *= 2
        raise UsageError(
            f"setpoint: {self.model.outputs.names[self.columns[1]]} does not settle within {MOST} "
            "rows of a held set-point: there is no map from set-point to speed"
        )


def crossing(
    rate: Callable[[float], float], u: Vector, rates: Vector, wanted: float
) -> float | None:
    """The set-point nearest to zero that gives a speed; None where none does."""
    close = CLOSE * float(np.ptp(rates))
    found = [float(one) for one in u[np.abs(rates - wanted) <= 1e-9]]
    for k in np.flatnonzero(np.diff(np.sign(rates - wanted))):
        low, high = float(u[k]), float(u[k + 1])
        up = rates[k + 1] > rates[k]
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if (rate(middle) < wanted) == up else (low, middle)
        ends = [one for one in (low, high) if abs(rate(one) - wanted) <= close]
        found += ends[:1]
    if not found:
        near = np.abs(rates - wanted)
        found = [float(one) for one in u[(near <= close) & (near == near.min())]]
    return min(found, key=abs, default=None)


def _input(model: Model, unit: str, name: str) -> int:
    if name:
        return model.inputs.index(name)
    for k, channel in enumerate(model.inputs):
        if compatible(channel.unit, unit):
            return k
    raise UsageError(
        f"setpoint: no input in '{unit}' or alike among {', '.join(model.inputs.names)}: name one "
        "with --input"
    )


def _output(model: Model, unit: str, name: str) -> int:
    if name:
        return model.outputs.index(name)
    for per_second in (False, True):
        for k, channel in enumerate(model.outputs):
            if compatible(f"{channel.unit}/s" if per_second else channel.unit, unit):
                return k
    raise UsageError(
        f"setpoint: no output whose value or rate is in '{unit}' or alike among "
        f"{', '.join(model.outputs.names)}: name one with --output"
    )
