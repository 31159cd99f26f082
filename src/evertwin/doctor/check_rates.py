"""Do position and speed of a joint say the same? A factor, a sign, a lag, or nothing in common.

Over stretches of L rows, the way in the position, x, is compared with the integral of the measured
speed, y: integrals, because noise and coarse steps of an encoder vanish in them. L and the lag are
those at which the two agree best. With noise in both, the factor of y = k·x lies between the
regression of y on x and that of x on y (Frisch, 1934), each with a sandwich over neighbouring
stretches; so noise widens the interval and does not shift it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from evertwin.doctor.examination import View
from evertwin.doctor.finding import Finding
from evertwin.fold.block import LARGEST
from evertwin.rows.channels import motions
from evertwin.signals import Layout

TOLERANCE = 0.1
"""A factor that differs from 1 by less does not matter; nor does a lag that makes less of the
speed, as a share of its rms."""
ALIKE, UNLIKE = 0.5, 0.2
"""Share of the variance that both have in common: from where a factor is told, up to where they
have nothing in common."""
LENGTHS = (2, 4, 8, 16, 32, 64, 128, 256, 512)
"""Stretches that are tried [rows]."""
SHIFTS = np.array(
    [0, *(s * k for k in (1, 2, 3, 4, 6, 8, 11, 15, 20, 30, 45, 70) for s in (1, -1))]
)
"""Lags that are tried [rows]."""
FEWEST, MOST = 30, 4_000
"""Stretches that are compared at least and at most."""
SHARE = 8
"""A stretch is so small a part of the longest window at most: windows may repeat one motion, and
one stretch of each would tell the same number again and again, which any line goes through."""
CLEAR = 5.0
"""What moves, moves by so many times its noise over a stretch."""

Piece: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Intervals [s], positions and speeds of neighbouring rows."""


class _Track(NamedTuple):
    """Position and speed of one window."""

    q: np.ndarray
    way: np.ndarray
    """Integral of the speed."""
    speed: np.ndarray
    """As the way within a row."""
    bad: np.ndarray
    """How many rows up to here may not be passed over, cumulated."""


class _Match(NamedTuple):
    """Ways and integrals at one length and one lag, means removed."""

    x: np.ndarray
    y: np.ndarray
    rows: int
    shift: int

    @property
    def common(self) -> float:
        """Share of the variance in common."""
        size = float(self.x @ self.x) * float(self.y @ self.y)
        return float(self.x @ self.y) ** 2 / size if size > 0 else 0.0


@dataclass(frozen=True)
class Agreement:
    """What position and speed have in common.

    >>> Agreement(1.0, (0.99, 1.01), 0.0, 0.01, 1.0, 1.0).common
    1.0
    """

    factor: float
    """Speed per rate of change of the position."""
    interval95: tuple[float, float]
    lag: float
    """How much later the speed is [rows]."""
    sigma: float
    """Its standard error [rows]."""
    at_once: float
    """Share of the variance in common without the lag."""
    common: float
    """And with it."""


def look_rates(view: View, figures: dict[str, Any]) -> Iterator[Finding]:
    """Positions and speeds that contradict each other."""
    found: dict[tuple[str, str], Agreement] = {}
    for layout, columns in _measured(view):
        for k, j in motions(view.setup.spec, layout):
            pieces = [
                (w.dt, values[:, k], values[:, j])
                for w, values in zip(view.windows, columns, strict=True)
            ]
            same = same_motion(pieces, bool(layout.angles[k]))
            if same is not None:
                found[layout.names[k], layout.names[j]] = same
    if found:
        figures["rates"] = {f"{speed} of {position}": a for (position, speed), a in found.items()}
    for (position, speed), agreement in found.items():
        yield from contradiction(position, speed, agreement, view.step)


def _measured(view: View) -> Iterator[tuple[Layout, list[np.ndarray]]]:
    """Layouts whose channels are measured, with their columns: commands are no measurements."""
    yield view.model.outputs, [w.y for w in view.windows]
    if view.setup.static:
        yield view.model.inputs, [w.u for w in view.windows]


def same_motion(pieces: list[Piece], angle: bool = False) -> Agreement | None:
    """Position and speed over all pieces; None where nothing can be told.

    >>> t = 0.01 * np.arange(1000)
    >>> same = same_motion([(np.full(1000, 0.01), np.sin(t), 3 * np.cos(t))])
    >>> same and round(same.factor, 3)
    3.0
    """
    tracks = [_track(*piece, angle) for piece in pieces]
    sizes = [len(track.q) for track in tracks]
    longest = min(sum(sizes) // FEWEST, max(sizes, default=0) // SHARE)
    noise = _noise([t.q for t in tracks]), _noise([t.speed for t in tracks])
    best: tuple[_Match, _Match] | None = None
    for length in LENGTHS:
        if length > longest:
            break
        still = _match(tracks, length, 0)
        ways = [float(np.sqrt(np.mean(side**2))) if len(side) else 0.0 for side in still[:2]]
        floor = CLEAR * noise[0], CLEAR * noise[1] * math.sqrt(length)
        if len(still.x) < FEWEST or not (ways[0] > floor[0] and ways[1] > floor[1]):
            continue
        late = _shifted(tracks, length, still)
        if best is None or late.common > best[1].common:
            best = still, late
    return None if best is None else _agreement(tracks, *best)


def _track(dt: np.ndarray, q: np.ndarray, speed: np.ndarray, angle: bool) -> _Track:
    known = (np.abs(q) < LARGEST) & (np.abs(speed) < LARGEST)
    filled, rate = np.where(known, q, 0.0), np.where(known, speed, 0.0)
    if angle:
        filled[known] = np.unwrap(filled[known])
    step = np.where(np.arange(len(dt)) > 0, dt, 0.0)
    way = np.cumsum(step * 0.5 * (rate + np.concatenate([rate[:1], rate[:-1]])))
    typical = float(np.median(dt[1:])) if len(dt) > 1 else 0.0
    return _Track(filled, way, rate * typical, np.cumsum(~known | (step > 3 * typical)))


def _noise(columns: list[np.ndarray]) -> float:
    """What neighbouring rows do not share, or the width of a coarse step where that is more."""
    bends = [np.diff(column, 2) for column in columns]
    steps = np.concatenate([np.abs(np.diff(column)) for column in columns])
    changes = steps[steps > 1e-9 * steps.max(initial=0.0)]
    coarse = float(np.min(changes, initial=np.inf)) if len(changes) < 0.9 * len(steps) else 0.0
    whole = np.abs(np.concatenate(bends))
    white = float(np.median(whole)) / 0.6745 / math.sqrt(6) if len(whole) else 0.0
    return max(white, coarse if math.isfinite(coarse) else 0.0)


def _match(tracks: list[_Track], length: int, shift: int) -> _Match:
    """Ways and integrals over neighbouring stretches, the speed taken ``shift`` rows later."""
    margin = int(np.abs(SHIFTS).max()) + 1
    stride = max(length, sum(len(track.q) for track in tracks) // MOST)
    x, y = [], []
    for track in tracks:
        edge = min(margin, len(track.q) // 10)
        if abs(shift) > edge:
            continue
        i = np.arange(edge, len(track.q) - length - edge, stride)
        i = i[track.bad[i + length + edge] == track.bad[i - edge]]
        x.append(track.q[i + length] - track.q[i])
        y.append(track.way[i + length + shift] - track.way[i + shift])
    ways, sums = (np.concatenate(side) if side else np.zeros(0) for side in (x, y))
    if len(ways):
        ways, sums = ways - ways.mean(), sums - sums.mean()
    return _Match(ways, sums, length, shift)


def _shifted(tracks: list[_Track], length: int, still: _Match) -> _Match:
    """The lag at which both agree best: none, unless that says clearly more."""
    best = max((_match(tracks, length, int(s)) for s in SHIFTS), key=lambda one: one.common)
    around = SHIFTS[np.argsort(np.abs(SHIFTS - best.shift))[1:3]]
    for s in range(int(around.min()) + 1, int(around.max())):
        best = max(best, _match(tracks, length, s), key=lambda one: one.common)
    if len(best.x) < len(still.x) or 1 - best.common > 0.5 * (1 - still.common):
        return still
    return best


def _agreement(tracks: list[_Track], still: _Match, late: _Match) -> Agreement:
    x, y = late.x, late.y
    around = [_match(tracks, late.rows, late.shift + s).y for s in (1, -1)]
    slope = 0.5 * (around[0] - around[1]) if len(around[0]) == len(around[1]) == len(x) else y * 0
    lines = _line(np.column_stack([x, slope]), y), _line(y[:, None], x)
    (direct, lag), (reach, sigma) = lines[0]
    (inverse,), (other,) = lines[1]
    low, high = sorted((abs(direct) - 1.96 * reach, 1 / max(abs(inverse) - 1.96 * other, 1e-300)))
    sign = math.copysign(1.0, inverse)
    factor = sign * math.sqrt(abs(direct / inverse)) if inverse else 0.0
    interval = (low, high) if sign > 0 else (-high, -low)
    return Agreement(
        factor, interval, late.shift - float(lag), float(sigma), still.common, late.common
    )


def _line(columns: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least squares, and standard errors that neighbouring stretches may share."""
    bread = np.linalg.pinv(columns.T @ columns)
    value = bread @ (columns.T @ y)
    scores = columns * (y - columns @ value)[:, None]
    sums = np.add.reduceat(scores, np.arange(0, len(y), 5), axis=0)
    return value, np.sqrt(np.diag(bread @ (sums.T @ sums) @ bread))


def contradiction(position: str, speed: str, a: Agreement, step: float) -> Iterator[Finding]:
    """The contradiction, if there is one."""
    low, high = a.interval95
    if a.common < UNLIKE:
        said = f"{speed} has nothing in common with the rate of change of {position}"
        said += f" (correlation {math.sqrt(a.common):.2f} at best)"
        what = f"one of the two columns is of another joint: check {position} and {speed}"
    elif a.common >= ALIKE and not (low < 1 + TOLERANCE and high > 1 - TOLERANCE):
        said = f"{speed} is {a.factor:.4g} times the rate of change of {position} "
        said += f"({low:.4g} to {high:.4g})"
        what = f"check unit, scale and sign of {position} and {speed}, and the unit of time"
    elif _lags(a):
        said = f"{speed} is {1e3 * step * abs(a.lag):.3g} ± {1960 * step * a.sigma:.2g} ms "
        said += f"{'later' if a.lag > 0 else 'earlier'} than the rate of change of {position}"
        what = f"the one of the two that is filtered or sent late: derive {speed} from {position}, "
        what += "or take both from one filter"
    else:
        return
    yield Finding(
        "rate", speed, said, "[source.channels]", what,
        {
            "position": position, "factor": a.factor, "interval95": a.interval95,
            "lag": step * a.lag, "sigma": step * a.sigma, "common": a.common,
        },
    )  # fmt: skip


def _lags(a: Agreement) -> bool:
    """Is a lag sure, and does it make more of the speed than is tolerated?"""
    sure = abs(a.lag) > max(4 * a.sigma, 0.5) and a.common > 0.9
    return sure and a.common - a.at_once > TOLERANCE**2
