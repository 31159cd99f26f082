"""How far poses are off a reference.

*Relative error*: over each stretch of a given length (along the reference, to the first pose beyond
it), the step that the poses tell against the step that the reference tells; it does not depend on
where the map lies. *Absolute trajectory error*: of all places, after the best fit of one trajectory
onto the other (Sturm et al., IROS 2012). Segments are maps of their own, which begin anywhere: a
stretch lies within one, and each is fitted by itself.

>>> way = np.column_stack([np.arange(0, 30, 0.5), np.zeros(60), np.zeros(60)])
>>> bent = way * [1.01, 1.0, 1.0]
>>> found = trajectory_error(bent, way)
>>> round(found.relative[10.0].way, 3), round(found.relative[10.0].turn, 3)
(0.1, 0.0)
>>> two, cut = way + 5.0 * (np.arange(60) > 30)[:, None], np.arange(60) > 30
>>> trajectory_error(two, way).absolute > 1.0, trajectory_error(two, way, cut).absolute < 1e-9
(True, True)
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from evertwin.signals.planar import between, wrapped
from evertwin.types import Float64, Vector

LENGTHS = (1.0, 10.0)
"""Of the stretches [m]."""


class Off(NamedTuple):
    """Error over stretches of one length; root mean squares.

    >>> Off(0.03, 0.02, 0.01, 10).stretches
    10
    """

    way: float
    """[m]"""
    median: float
    """Of the same [m]."""
    turn: float
    """[rad]"""
    stretches: int


class TrajectoryError(NamedTuple):
    """How far poses are off.

    >>> TrajectoryError({}, 0.1, 5).absolute
    0.1
    """

    relative: Mapping[float, Off]
    """By length [m]."""
    absolute: float
    """[m]"""
    poses: int
    """That were compared."""


def trajectory_error(
    poses: Float64[np.ndarray, "n 3"], reference: Float64[np.ndarray, "n 3"],
    segment: np.ndarray | None = None,
) -> TrajectoryError:  # fmt: skip
    """Compares poses with the reference's at the same times, where both are told.

    Args:
        poses: x, y [m], heading [rad]; NaN: none was told.
        reference: the same.
        segment: of each pose, (n,); None: one.
    """
    told = np.isfinite(poses).all(axis=1) & np.isfinite(reference).all(axis=1)
    own = (np.zeros(len(told)) if segment is None else segment)[told]
    poses, reference = poses[told], reference[told]
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(reference[:, :2], axis=0).T))])
    relative = {length: _over((poses, reference, own), way, length) for length in LENGTHS}
    parts = [own == one for one in np.unique(own)]
    squares = [_squares(poses[part], reference[part]) for part in parts if part.sum() > 1]
    absolute = float(np.sqrt(np.mean(np.concatenate(squares)))) if squares else float("nan")
    return TrajectoryError(relative, absolute, len(poses))


def _over(told: tuple[np.ndarray, ...], way: np.ndarray, length: float) -> Off:
    poses, reference, segment = told
    end = np.searchsorted(way, way + length)
    start = np.flatnonzero(end < len(way))
    start = start[segment[start] == segment[end[start]]]
    end = end[start]
    if not len(start):
        return Off(np.nan, np.nan, np.nan, 0)
    off = between(poses[start], poses[end]) - between(reference[start], reference[end])
    size, turn = np.hypot(off[:, 0], off[:, 1]), wrapped(off[:, 2])
    rms = (float(np.sqrt(np.mean(v * v))) for v in (size, turn))
    far, twisted = rms
    return Off(far, float(np.median(size)), twisted, len(start))


def _squares(poses: np.ndarray, reference: np.ndarray) -> Vector:
    """Squared distances after the best fit [m²]."""
    a, b = (
        poses[:, :2] - poses[:, :2].mean(axis=0),
        reference[:, :2] - reference[:, :2].mean(axis=0),
    )
    u, _, v = np.linalg.svd(a.T @ b)
    turn = u @ np.diag([1.0, np.sign(np.linalg.det(u @ v))]) @ v
    return np.asarray(np.sum((a @ turn - b) ** 2, axis=1))
