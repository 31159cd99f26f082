"""The size of an output, of which a share of it is a share.

It is the rms of what was measured. The zero of a temperature tells nothing of its size: 5 % of
300 K is more than most machines ever warm up by; so a temperature's size is its range.

Source of the convention: a percentage of span, as instruments of the process industry have it.
"""

from __future__ import annotations

import numpy as np

from evertwin.types import Bool, Outputs, PerOutput, Vector

STOOD = 40.0
"""Deviations of the noise that a range has to reach: less tells that the machine stood."""


def mean_square(values: Outputs, empty: float = np.nan) -> PerOutput:
    """Mean square per column over what is not NaN, (ny,); infinite of what diverged, and ``empty``
    where nothing is known.

    >>> mean_square(np.array([[3.0, np.nan], [np.nan, np.nan], [5.0, np.nan]]), empty=0.0).tolist()
    [17.0, 0.0]
    """
    known = ~np.isnan(values)
    count = known.sum(axis=0)
    with np.errstate(over="ignore"):
        total = np.square(np.where(known, values, 0.0)).sum(axis=0)
    return np.asarray(np.divide(total, count, out=np.full(len(count), empty), where=count > 0))


def rms(values: Outputs, empty: float = np.nan) -> PerOutput:
    """Root of `mean_square`.

    >>> rms(np.array([[3.0], [np.nan], [4.0]])).round(3).tolist()
    [3.536]
    """
    return np.asarray(np.sqrt(mean_square(values, empty)))


def rms_of(values: Vector, empty: float = np.nan) -> float:
    """The same of one column, over what is finite.

    >>> rms_of(np.array([3.0, np.inf, 4.0])).__round__(2), rms_of(np.zeros(0), empty=0.0)
    (3.54, 0.0)
    """
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(np.square(known)))) if len(known) else empty


def sizes(y: Outputs, temperatures: Bool[np.ndarray, " ny"]) -> PerOutput:
    """Size of each column over what is known of it; NaN where nothing is, or all is 0.

    >>> y = np.array([[3.0, 300.0], [4.0, 310.0], [3.0, 320.0]] + [[4.0, 320.0]] * 9)
    >>> sizes(y, np.array([False, True])).round(1).tolist()
    [3.9, 115.5]
    """
    return np.array([size(*one) for one in zip(y.T, temperatures.tolist(), strict=True)])


def size(y: Vector, temperature: bool) -> float:
    """The same of one output.

    >>> size(np.array([3.0, np.nan, 4.0]), False).__round__(2)
    3.54
    """
    y = y[~np.isnan(y)]
    if not y.any():
        return float("nan")
    if not temperature:
        return float(np.sqrt(np.mean(np.square(y))))
    noise = np.sqrt(np.sum(np.square(np.diff(y))) / (2 * len(y)))
    return float(max(np.ptp(y), STOOD * noise)) or float("nan")
