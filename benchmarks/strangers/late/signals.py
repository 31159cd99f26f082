"""Commands as they occur on a plant, and small helpers for drawing numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

Range = tuple[float, float]


def clock(rows: int, rate: float) -> np.ndarray:
    """Time stamps of a recording with `rows` rows at `rate` rows a second."""
    return np.arange(rows) / rate


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number between low and high, even on a logarithmic scale."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def wrong(rng: np.random.Generator, value: float, span: Range = (0.05, 0.30)) -> float:
    """The value with a relative error whose size lies in `span`, of either sign."""
    return float(value * (1.0 + rng.choice([-1.0, 1.0]) * rng.uniform(*span)))


def all_wrong(
    rng: np.random.Generator, values: dict[str, float], span: Range = (0.05, 0.30)
) -> dict[str, float]:
    """Every value of a dict made wrong in the same manner."""
    return {name: wrong(rng, value, span) for name, value in values.items()}


def pick(rng: np.random.Generator, choices: Sequence[str]) -> str:
    """One of the words."""
    return str(choices[int(rng.integers(len(choices)))])


def profile(
    rng: np.random.Generator,
    t: np.ndarray,
    levels: Sequence[float],
    hold: Range,
    ramp: Range = (0.0, 0.0),
    first: float = 0.0,
) -> np.ndarray:
    """Levels that persist for a while, with straight ramps (or steps) between them."""
    times, values = [0.0], [first]
    while times[-1] < t[-1]:
        rest = times[-1] + rng.uniform(*hold)
        choice = [level for level in levels if level != values[-1]]
        target = float(choice[int(rng.integers(len(choice)))])
        times += [rest, rest + max(rng.uniform(*ramp), 1e-9)]
        values += [values[-1], target]
    return np.interp(t, times, values)


def shuttle(
    rng: np.random.Generator,
    t: np.ndarray,
    speeds: Sequence[float],
    move: Range,
    ramp: Range,
    rest: Range,
) -> np.ndarray:
    """Trapezoid moves to and fro with stops; turns back before the travel grows too long."""
    times, values = [0.0, rng.uniform(*rest) + 0.5], [0.0, 0.0]
    place, side, reach = 0.0, 1.0, 1.2 * max(speeds) * move[1]
    while times[-1] < t[-1]:
        side = -side if rng.random() < 0.7 else side
        speed = float(rng.choice(np.asarray(speeds)))
        rise, fall, cruise = rng.uniform(*ramp), rng.uniform(*ramp), rng.uniform(*move)
        if abs(place + side * speed * cruise) > reach:
            side = -float(np.sign(place))
        place += side * speed * (cruise + 0.5 * (rise + fall))
        up = times[-1] + max(rise, 1e-9)
        down = up + cruise
        stop = down + max(fall, 1e-9)
        times += [up, down, stop, stop + max(rng.uniform(*rest), 1e-9)]
        values += [side * speed, side * speed, 0.0, 0.0]
    return np.interp(t, times, values)
