"""The inverse of a drive's map: which set-point gives the speed that is wanted.

The live version is simulated with each set-point held until it has settled; the rate of its output
over the set-points is the map. Its inverse need not exist: below a start threshold nothing moves,
or nothing moves that slowly, and a cap is not passed. Then the nearest speeds that can be had are
told. Beyond the recordings nobody knows the map: what only a set-point from there would give is
told as not known, unless more changes nothing, as above a cap. So the other inputs are held at zero
only where the recordings have that, else at their median, and this is said.

Which input is set follows from what moves the output most over its recorded range. A unit does not
tell: a room is as warm in kelvin as what is heated in it.

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
from dataclasses import dataclass, replace
from functools import cached_property

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
"""Rows that a set-point is held for at least, and at most until it has settled: slower ones take
longer rows, as far as the model computes the same over them."""
REACH = 10.0
"""Longest time to settle that an answer is given for, in lengths of the recordings."""
RIVAL = 0.5
"""Share of what the strongest input moves, from which on another may be meant as well."""
SETTLED = 0.01
"""Change of the rate from one quarter of this time to the next that is none, as a share."""
STAYS = 0.05
"""The same from there to the longest time: a slow drift has not settled."""
SAME = 1e-3
"""Share of an output's range by which longer rows may change it."""
FEW = 5
"""Set-points by which inputs are compared."""
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
    """None: this speed cannot be had, or is ``outside``."""
    gives: float
    """Rate that the simulation settles at; NaN where there is no set-point."""
    gives95: tuple[float, float]
    """95 % interval of what the machine will do."""
    nearest: tuple[float | None, float | None] | None
    """Next lower and next higher speed that can be had, where this one cannot."""
    outside: bool = False
    """Is it beyond what recorded set-points give? Then nobody knows whether it can be had."""
    model_alone: float | None = None
    """The set-point that the model would give it at, there; None: at none that was looked at."""

    def to_dict(self) -> dict[str, Json]:
        """Plain content."""
        nearest: Json = self.nearest
        return {"wanted": self.wanted, "set_point": self.set_point, "gives": self.gives,
                "gives95": self.gives95, "nearest": nearest, "outside": self.outside,
                "model_alone": self.model_alone}  # fmt: skip


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
        UsageError: no output measures this, or several inputs may be meant.
        DataError: there are no recordings, or the input never varies in them.
    """
    model, rows = basis.model, basis.rows(data)
    drive, (low, high) = _driven(basis, rows, unit, names)
    told, given = drive.columns
    u = np.unique(np.r_[np.linspace(low, high, POINTS), 0.0])
    u = u[(u >= low) & (u <= high)]
    drive, steps = drive.settled(basis.p, u, REACH * sum(float(np.sum(b.dt[1:])) for b in rows))
    off, alone = _off(basis, rows, drive, steps)
    ask = _Map(basis, drive, steps, u, np.array([drive.rate(basis.p, x, steps) for x in u]), off)
    return Inverse(
        (model.inputs.names[told], model.outputs.names[given]), model.inputs.channels[told].unit,
        unit, basis.champion, u, ask.rates, tuple(ask.answer(speed) for speed in wanted),
        "; ".join(one for one in (_said(basis, drive), alone) if one), drive.direct,
    )  # fmt: skip


@dataclass(frozen=True)
class _Map:
    """What recorded set-points settle at, and what is asked of it."""

    basis: Basis
    drive: _Drive
    steps: int
    u: Vector
    rates: Vector
    off: float
    """Standard deviation of what the simulation leaves out."""

    def answer(self, speed: float) -> SetPoint:
        """What to set for one speed."""
        p, rates, none = self.basis.p, self.rates, (np.nan, np.nan)

        def rate(one: float) -> float:
            return self.drive.rate(p, one, self.steps)

        found = crossing(rate, self.u, rates, speed)
        if found is None:
            lower, higher = rates[rates < speed], rates[rates > speed]
            nearest = (float(lower.max()) if len(lower) else None,
                       float(higher.min()) if len(higher) else None)  # fmt: skip
            if None not in nearest:
                return SetPoint(speed, None, np.nan, none, nearest)
            wide, there = self.around
            past = there.max() - rates.max() if len(lower) else rates.min() - there.min()
            outside = bool(past > CLOSE * float(np.ptp(rates)))
            alone = crossing(rate, wide, there, speed) if outside else None
            return SetPoint(speed, None, np.nan, none, nearest, outside, alone)
        gives = rate(found)
        scatter = np.std([self.drive.rate(q, found, self.steps) for q in self.drawn])
        half = 1.96 * float(np.hypot(scatter, self.off))
        return SetPoint(speed, found, gives, (gives - half, gives + half), None)

    @cached_property
    def drawn(self) -> Float64[np.ndarray, "k np"]:
        """Parameter vectors as credible as the version's."""
        basis = self.basis
        if not basis.sigma.any():
            return basis.p[None]
        return draws(basis.model, basis.p, basis.sigma, DRAWS, seed=7)

    @cached_property
    def around(self) -> tuple[Vector, Vector]:
        """Set-points as far beyond the recorded ones as those reach, and what they settle at."""
        low, high = self.u[0], self.u[-1]
        wide = np.linspace(2.0 * low - high, 2.0 * high - low, POINTS)
        return wide, np.array([self.drive.rate(self.basis.p, x, self.steps) for x in wide])


def _off(basis: Basis, rows: Sequence[Block], drive: _Drive, steps: int) -> tuple[float, str]:
    """Standard deviation of what the simulation leaves out after so long, and what it lacks."""
    long = steps * drive.dt
    try:
        known = spread(basis.model, basis.p, basis.alike(rows), long)
    except DataError:
        return 0.0, ALONE
    off = float(known.sigma(np.array([long]))[0, drive.columns[1]])
    return off / (1.0 if drive.direct else long), ""


def _driven(
    basis: Basis, rows: Sequence[Block], unit: str, names: tuple[str, str]
) -> tuple[_Drive, tuple[float, float]]:
    """The output that is wanted, the input that is set, and how far that was recorded.

    Raises:
        UsageError: no output measures this, or several inputs may be meant.
        DataError: the input never varies in the recordings.
    """
    model, u = basis.model, np.concatenate([block.u for block in rows])
    given = _output(model, unit, names[1])
    dt = float(np.median(np.concatenate([block.dt[1:] for block in rows])))
    drive = _Drive(model, (0, given), dt, compatible(model.outputs.channels[given].unit, unit),
                   _median(u))  # fmt: skip
    at = [model.inputs.index(names[0])] if names[0] else list(range(u.shape[1]))
    known = {k: u[np.isfinite(u[:, k]), k] for k in at}
    range_of = {k: (float(x.min()), float(x.max())) for k, x in known.items() if len(x)}
    range_of = {k: (low, high) for k, (low, high) in range_of.items() if low < high}
    if not range_of:
        said = ", ".join(model.inputs.names[k] for k in at)
        raise DataError(f"setpoint: {said} never varies in the recordings: nothing tells its map")
    moved = {k: drive.of(k).moved(basis.p, *ends) for k, ends in range_of.items()}
    strongest = max(moved, key=lambda k: moved[k])
    rivals = [model.inputs.names[k] for k, by in moved.items() if by >= RIVAL * moved[strongest]]
    if len(rivals) > 1:
        raise UsageError(
            f"setpoint: {model.outputs.names[given]} moves alike by {', '.join(rivals)} over what "
            "was recorded: name one with --input"
        )
    return drive.of(strongest), range_of[strongest]


def _median(u: Float64[np.ndarray, "n nu"]) -> Float64[np.ndarray, " nu"]:
    """What each input is held at while another is set: zero where recordings have it."""
    held = np.zeros(u.shape[1])
    for k, column in enumerate(u.T):
        known = column[np.isfinite(column)]
        if len(known) and not known.min() <= 0.0 <= known.max():
            held[k] = np.median(known)
    return held


def _said(basis: Basis, drive: _Drive) -> str:
    """The inputs that are not held at zero, in words."""
    said = list[str]()
    for k, channel in enumerate(basis.model.inputs):
        if k != drive.columns[0] and drive.beside[k]:
            unit = basis.recorded.get(channel.name) or channel.unit
            said.append(f"{channel.name} at {float(from_si(drive.beside[k], unit)):.4g} {unit}")
    return f"held beside it: {', '.join(said)}" if said else ""


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

    def output(self, p: ParameterVector, u: float, steps: int) -> Vector:
        """The output after each row of a held set-point."""
        told = np.tile(self.beside, (steps, 1))
        told[:, self.columns[0]] = u
        _, y = self.model.simulate(self.model.initial(p), told, np.full(steps, self.dt), p)
        return np.asarray(y[:, self.columns[1]])

    def _way(self, change: Vector) -> Vector:
        turns = self.model.outputs.angles[self.columns[1]]
        return np.asarray(wrapped(change) if turns else change)

    def course(self, p: ParameterVector, u: float, steps: int) -> Vector:
        """Speed after each row but the first."""
        one = self.output(p, u, steps)
        return one[1:] if self.direct else self._way(np.diff(one)) / self.dt

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

    def of(self, told: int) -> _Drive:
        """The same output by another input."""
        return replace(self, columns=(told, self.columns[1]))

    def moved(self, p: ParameterVector, low: float, high: float) -> float:
        """How far the output moves by set-points in a range."""
        return float(np.ptp([self.rate(p, x, MOST) for x in np.linspace(low, high, FEW)]))

    def settled(self, p: ParameterVector, u: Vector, longest: float) -> tuple[_Drive, int]:
        """This drive in rows so long that all set-points settle in `MOST`, and in how many.

        Raises:
            UsageError: some do not within ``longest`` [s].
        """
        some, drive = u[:: POINTS // 10], self
        while (steps := drive._settles(p, some)) is None or steps * drive.dt > longest:
            slower = replace(drive, dt=2.0 * drive.dt)
            if steps or 0.5 * MOST * slower.dt > longest or not drive._same(slower, p, some):
                raise UsageError(
                    f"setpoint: {self.model.outputs.names[self.columns[1]]} does not settle within "
                    f"{min(MOST * drive.dt, longest):.3g} s of a held set-point: what it settles "
                    "at cannot be told"
                )
            drive = slower
        return drive, steps

    def _same(self, slower: _Drive, p: ParameterVector, u: Vector) -> bool:
        """Does the model compute the same over rows of twice the length?"""
        for one in u:
            here, there = self.output(p, one, MOST)[1::2], slower.output(p, one, MOST // 2)
            if np.abs(self._way(here - there)).max() > SAME * np.ptp(here):
                return False
        return True

    def _settles(self, p: ParameterVector, some: Vector) -> int | None:
        """Rows after which all set-points have settled; None: never."""
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
        return None


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
