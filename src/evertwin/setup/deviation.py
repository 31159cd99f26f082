"""How far predictions were from measurements, from sums over rows.

>>> sums = Sums(np.array([0.01]), np.array([4.0]), np.array([1]))
>>> deviation(sums, relative=True).round(3).tolist()
[0.05]
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.models.form import Size
from evertwin.signals.sizes import STOOD
from evertwin.types import Bool, Outputs, Vector


class Sums(NamedTuple):
    """Sums over the rows with a known residual, per output.

    >>> new_sums(2).residual.tolist()
    [0.0, 0.0]
    """

    residual: Vector
    """Σ residual²."""
    measured: Vector
    """Σ measurement² over the same rows."""
    samples: np.ndarray
    """Rows, int64."""


def new_sums(outputs: int) -> Sums:
    """Empty sums."""
    return Sums(np.zeros(outputs), np.zeros(outputs), np.zeros(outputs, dtype=np.int64))


class Usual(NamedTuple):
    """How large the measurements of moving rows have been since the start, whatever was live.

    >>> new_usual(np.array([False, True])).lowest.tolist()
    [nan, inf]
    """

    measured: Vector
    """Σ measurement², per output."""
    samples: np.ndarray
    """Rows with a residual, int64."""
    lowest: Vector
    """Of a temperature, whose size is its range; NaN of other outputs."""
    highest: Vector
    last: Vector
    """Of the row before."""
    jumps: Vector
    """Σ (change since the row before)², of temperatures."""
    noise: Vector
    """Rms residual that noise alone makes at most; 0: none is known to be above what is asked."""


def new_usual(temperatures: Bool[np.ndarray, " ny"]) -> Usual:
    """Nothing was measured yet."""
    none, unknown = np.zeros(len(temperatures)), np.full(len(temperatures), np.nan)
    far = np.where(temperatures, np.inf, np.nan)
    return Usual(none, none.astype(np.int64), far, -far, unknown, none.copy(), none.copy())


def usual_of(measured: Outputs, temperatures: Bool[np.ndarray, " ny"]) -> Usual:
    """The same of these measurements, (n, ny); NaN where one does not count.

    >>> usual_of(np.array([[3.0], [np.nan], [4.0]]), np.array([False])).measured.tolist()
    [25.0]
    """
    none, known = new_usual(temperatures), ~np.isnan(measured)
    lowest = np.where(known, measured, np.inf).min(axis=0, initial=np.inf)
    highest = np.where(known, measured, -np.inf).max(axis=0, initial=-np.inf)
    return none._replace(
        measured=np.nansum(np.square(measured), axis=0), samples=known.sum(axis=0),
        lowest=np.where(temperatures, lowest, np.nan),
        highest=np.where(temperatures, highest, np.nan),
        jumps=np.where(temperatures, np.nansum(np.square(np.diff(measured, axis=0)), axis=0), 0.0),
    )  # fmt: skip


def begun_with(usual: Usual, names: Sequence[str], sizes: Sequence[Size]) -> Usual:
    """With what outputs of these ``names`` were, where it is known. Consumes ``usual``.

    A machine that stands when a run begins is not off by the noise of its sensors, by what is
    hardly more than that noise.
    """
    for size in sizes:
        if size.output in names:
            k = names.index(size.output)
            usual.measured[k], usual.samples[k] = size.squares, size.rows
            if not np.isnan(usual.lowest[k]):
                usual.lowest[k], usual.highest[k] = size.lowest, size.highest
                usual.jumps[k] = size.jumps
    return usual


@njit(cache=True)
def count_in(k: int, usual: Any, y: float) -> None:
    """One more measurement of an output."""
    measured, samples, lowest, highest, last, jumps, _ = usual
    measured[k] += y * y
    samples[k] += 1
    if lowest[k] == lowest[k]:
        lowest[k], highest[k] = min(lowest[k], y), max(highest[k], y)
        jump = 0.0 if last[k] != last[k] else y - last[k]
        jumps[k] += jump * jump


@njit(cache=True)
def mean_square(k: int, sums: Any, usual: Any) -> float:
    """Mean square of an output's measurements, which its residual is relative to.

    Never less than usual: where a window is short, lacks samples or hardly moves, a few rows near
    zero make no deviation large. Of a temperature it is the square of its range.
    """
    _, samples, lowest, highest, _, jumps, _ = usual
    if lowest[k] == lowest[k] and samples[k] > 0:
        span, noise = highest[k] - lowest[k], jumps[k] / (2.0 * samples[k])
        return float(max(span * span, STOOD * STOOD * noise))
    size = sums[1][k] / sums[2][k]
    return float(max(size, usual[0][k] / usual[1][k]) if usual[1][k] > 0 else size)


def limits(requirement: float, sums: Sums, relative: bool, usual: Usual) -> Vector:
    """What `judged_deviation` is held to per output: what is asked, or what noise lets reach."""
    noise = sums._replace(residual=np.square(usual.noise) * sums.samples)
    found: Vector = np.fmax(requirement, judged_deviation(noise, relative, usual))
    return found


def judged_deviation(sums: Sums, relative: bool, usual: Usual) -> Vector:
    """Rms of the residual per output, relative to what is usually measured or not."""
    base = np.ones(len(sums.samples))
    if relative:
        for k in np.flatnonzero(sums.samples).tolist():
            base[k] = mean_square(k, sums, usual)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio: Vector = np.sqrt(sums.residual / sums.samples / base)
    return ratio


def deviation(sums: Sums, relative: bool, usual: Usual | None = None) -> Vector:
    """Rms of the residual per output, relative to the measurement's or not; NaN without rows."""
    count = np.where(sums.samples > 0, sums.samples, np.nan)
    base = sums.measured if relative else count
    if relative and usual is not None:
        own = [mean_square(k, sums, usual) if n else np.nan for k, n in enumerate(sums.samples)]
        base = np.where(np.isnan(usual.lowest), base, count * own)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio: Vector = np.sqrt(sums.residual / np.where(sums.samples > 0, base, np.nan))
    return ratio
