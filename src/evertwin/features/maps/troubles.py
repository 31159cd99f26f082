"""What is wrong with the scans of a lidar, as sentences; and how it is mounted, by its odometry.

>>> from evertwin.sources.columns.scans import Lidar
>>> seen = np.full((6, 20), 2.0) + 0.01 * np.arange(20)
>>> scans = Scans("scan", np.arange(6), seen, Lidar(0.0, 0.1, 30.0))
>>> troubles(scans)
['scans 0 to 5 say number by number the same: a lidar at rest without noise, or a frozen one']
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from evertwin.features.scans.scan_matcher import BLOCKED, MOST_NEAR, STANDING
from evertwin.signals.planar import between, wrapped
from evertwin.sources.columns.scans import Scans
from evertwin.sources.robot_logs.straight_walls import beam_step
from evertwin.types import Float64

SEES = 0.1
"""Share of the beams that come back, below which a scan is named."""
MOST = 5
"""Stretches that are named."""
LEAST = 0.05
"""Way of a step whose direction tells [m]."""
STRAIGHT = 0.05
"""Turn up to which a step is one [rad]."""
ENOUGH = 10
"""Steps that must tell."""
AGREE = 0.8
"""Length of the mean of their directions as unit vectors."""
TURNS = 0.01
"""Turn of a step that tells [rad]."""
BODY, SPREAD = 0.5, 0.03
"""Beams that end nearer than this, and never elsewhere, end on the machine itself [m]."""
ALWAYS, MANY = 0.95, 50
"""In so large a share of the scans, of so many at least."""
PARTLY = 0.1
"""Share of the beams that end near for long from which on a part of a lidar is blocked."""
OTHER, MIDDLE = 0.15, 0.1
"""By how much the scans' way over the wheels' is off 1 to be another scale, and how far it may
differ in the middle half of the steps."""
TURNED, TWISTED = 0.03, 0.25
"""Turn of a step that tells how far turns differ [rad], and how far that may in the middle half."""
ASIDE, FARTHEST, SHIFTS = 0.1, 1.0, 0.1
"""Way from which on a lidar is elsewhere than was said, and up to which; how far it may be from
there by half of the drive [m]."""
CERTAIN, ROUNDS = 6.0, 10
"""The same way in standard deviations; rounds of weighing the steps."""
ASKEW = 0.05
"""Angle from which on a lidar looks elsewhere than was said [rad]."""


def troubles(scans: Scans) -> list[str]:
    """What is wrong with scans."""
    ranges = scans.ranges
    finite = np.isfinite(ranges)
    empty = finite.mean(axis=1) < SEES
    nothing = ~finite.any(axis=1)
    near = (finite & (ranges < BLOCKED)).sum(axis=1) >= MOST_NEAR * np.maximum(finite.sum(1), 1)
    same = np.zeros(len(ranges), dtype=np.bool_)
    same[1:] = [np.array_equal(a, b, equal_nan=True) for a, b in pairwise(ranges)]
    same &= ~empty
    held = [(max(a - 1, 0), b) for a, b in _stretches(same) if b - a + 1 >= STANDING]
    said = [
        (held, "say number by number the same: a lidar at rest without noise, or a frozen one"),
        (_stretches(near & ~empty), f"end nearer than {BLOCKED} m: the lidar is blocked"),
        (_stretches(nothing), "see nothing"),
        (_stretches(empty & ~nothing), f"get fewer than {100 * SEES:.0f} % of their beams back"),
    ]
    return [line for found, what in said for line in _named(found, what)]


def _stretches(flags: np.ndarray) -> list[tuple[int, int]]:
    """First and last of each run."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _named(found: list[tuple[int, int]], what: str) -> list[str]:
    lines = [
        f"scans {a} to {b} {what}" if b > a else f"scan {a}: its beams {what}" for a, b in found
    ]
    more = len(lines) - MOST
    return [*lines[:MOST], f"so do those of {more} more stretches"] if more > 0 else lines


def askew(poses: Float64[np.ndarray, "n 3"], wheels: Float64[np.ndarray, "n 3"]) -> float | None:
    """Angle by which the lidar looks further left than was said [rad]; None: it cannot be told.

    The wheels tell a step in the machine's own frame; the scans tell the same one, turned by what
    is wrong.

    >>> way = np.column_stack([0.1 * np.arange(20), np.zeros(20), np.zeros(20)])
    >>> turned = np.column_stack([np.zeros(20), -0.1 * np.arange(20), np.zeros(20)])
    >>> round(askew(turned, way), 3)
    1.571
    """
    one, other = (between(p[:-1], p[1:]) for p in (poses, wheels))
    far = np.minimum(np.hypot(*one[:, :2].T), np.hypot(*other[:, :2].T))
    straight = np.maximum(np.abs(one[:, 2]), np.abs(other[:, 2])) < STRAIGHT
    tells = (far > LEAST) & straight
    if tells.sum() < ENOUGH:
        return None
    off = np.arctan2(other[tells, 1], other[tells, 0]) - np.arctan2(one[tells, 1], one[tells, 0])
    mean = complex(np.exp(1j * off).mean())
    return float(wrapped(np.angle([mean]))[0]) if abs(mean) > AGREE else None


def lever(
    poses: Float64[np.ndarray, "n 3"], wheels: Float64[np.ndarray, "n 3"]
) -> Float64[np.ndarray, " 2"] | None:
    """How far the lidar is ahead and to the left of where was said [m]; None: not clearly so.

    A lidar beside the middle goes along with every turn: the step that it sees is the wheels' and
    (R - 1) times its place.

    >>> turn = 0.3 * np.sin(np.arange(60.0))
    >>> way = np.column_stack([0.1 * np.arange(60.0), np.zeros(60), turn])
    >>> aside = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(60)])
    >>> lever(way + 0.3 * aside, way).round(2).tolist()
    [0.3, 0.0]
    """
    one, other = (between(p[:-1], p[1:]) for p in (poses, wheels))
    turn, off = other[:, 2], (one - other)[:, :2]
    told = np.isfinite(off).all(axis=1) & (np.abs(turn) > TURNED)
    if told.sum() < 2 * ENOUGH:
        return None
    turn, off, half = turn[told], off[told], int(told.sum()) // 2
    parts = (slice(None), slice(half), slice(half, None))
    (found, spread), *each = (_aside(turn[one], off[one]) for one in parts)
    alike = all(np.hypot(*(part - found)) < SHIFTS for part, _ in each)
    far = float(np.hypot(*found))
    return found if alike and max(ASIDE, CERTAIN * spread) < far < FARTHEST else None


def _aside(turn: np.ndarray, off: np.ndarray) -> tuple[np.ndarray, float]:
    """The lever that explains steps that are off while turning, and its standard deviation [m]."""
    c, s = np.cos(turn) - 1, np.sin(turn)
    a, b = np.concatenate([np.stack([c, -s], 1), np.stack([s, c], 1)]), off.T.ravel()
    found, weight = np.zeros(2), np.ones(len(b))
    for _ in range(ROUNDS):
        square = a.T @ (weight[:, None] * a)
        found = np.linalg.solve(square, a.T @ (weight * b))
        left = b - a @ found
        usual = float(weight @ left**2 / weight.sum())
        weight = 1 / (1 + (left / max(1.5 * np.median(np.abs(left)), 1e-3)) ** 2)  # Cauchy's
    return found, math.sqrt(usual * np.trace(np.linalg.inv(square)))


def scaled(poses: Float64[np.ndarray, "n 3"], wheels: Float64[np.ndarray, "n 3"]) -> str:
    """Whether scans and wheels differ by one factor all along, as a sentence; else empty.

    >>> way = np.column_stack([0.1 * np.arange(20), np.zeros(20), np.zeros(20)])
    >>> scaled(0.5 * way, way)[:54], scaled(way, way)
    ('all along the way by the scans is 0.50 times that by t', '')
    """
    one, other = (np.hypot(*between(p[:-1], p[1:])[:, :2].T) for p in (poses, wheels))
    factor = _factor(one, other, LEAST, MIDDLE)
    if factor is None:
        return ""
    return (
        f"all along the way by the scans is {factor:.2f} times that by the wheels: ranges or "
        "wheels in another unit, or a wrong radius"
    )


def overturned(
    poses: Float64[np.ndarray, "n 3"], wheels: Float64[np.ndarray, "n 3"], step: float
) -> str:
    """The same of their turns: the beams, taken to be ``step`` [rad] apart, are not.

    >>> turn = np.column_stack([np.zeros(30), np.zeros(30), 0.05 * np.arange(30)])
    >>> overturned(0.5 * turn, turn, 0.5)[:49], overturned(turn, turn, 0.5)
    ('all along the scans turn 0.50 times as far as the', '')
    """
    one, other = (between(p[:-1], p[1:])[:, 2] for p in (poses, wheels))
    factor = _factor(one, other, TURNED, TWISTED)
    if factor is None:
        return ""
    return (
        f"all along the scans turn {factor:.2f} times as far as the wheels: beams are "
        f"{abs(np.degrees(step / factor)):.2g}° apart (--step), not {abs(np.degrees(step)):.2g}°; "
        "or the wheels' track is wrong"
    )


def _factor(one: np.ndarray, other: np.ndarray, least: float, middle: float) -> float | None:
    """The one factor between steps, where it is not 1; None: there is none, or few tell."""
    tells = np.isfinite(one) & (np.abs(other) > least)
    if tells.sum() < ENOUGH:
        return None
    low, factor, high = np.quantile(one[tells] / other[tells], (0.25, 0.5, 0.75))
    alike = high - low <= middle * factor
    return float(factor) if alike and abs(factor - 1) >= OTHER else None


def mirrored(poses: Float64[np.ndarray, "n 3"], wheels: Float64[np.ndarray, "n 3"]) -> bool:
    """Do the scans turn against the wheels? Then the beams run the other way round.

    >>> turn = np.column_stack([np.zeros(30), np.zeros(30), 0.05 * np.arange(30)])
    >>> mirrored(-turn, turn), mirrored(turn, turn)
    (True, False)
    """
    one, other = (between(p[:-1], p[1:])[:, 2] for p in (poses, wheels))
    tells = np.isfinite(one) & (np.abs(other) > TURNS)
    if tells.sum() < ENOUGH:
        return False
    return float(one[tells] @ other[tells]) < -0.5 * float(other[tells] @ other[tells])


def without_body(scans: Scans) -> Scans:
    """Without the beams that always end on the machine itself."""
    ranges, n = scans.ranges, len(scans.ranges)
    if n < MANY:
        return scans
    with np.errstate(invalid="ignore"):
        middle = np.nanmedian(np.where(np.isfinite(ranges), ranges, np.inf), axis=0)
        held = (np.abs(ranges - middle) < SPREAD).sum(axis=0) >= ALWAYS * n
    body = held & (middle < BODY)
    if not body.any() or body.all():
        return scans
    said = (
        f"{int(body.sum())} beams always end at {middle[body].min():.2f} to "
        f"{middle[body].max():.2f} m: on the machine itself; left out"
    )
    return replace(scans, ranges=np.where(body, np.nan, ranges), findings=(*scans.findings, said))


def without_cover(scans: Scans) -> Scans:
    """Without beams that end right before the lidar for long, where the others see on.

    What does so in a drive goes along with the machine: somebody's hand, dirt, a thing put down.
    """
    ranges = scans.ranges
    with np.errstate(invalid="ignore"):
        near = ranges < BLOCKED
        near[near.sum(axis=1) >= MOST_NEAR * np.isfinite(ranges).sum(axis=1)] = False
    covered = np.zeros_like(near)
    for beam in np.flatnonzero(near.sum(axis=0) >= MANY):
        for first, last in _stretches(near[:, beam]):
            covered[first : last + 1, beam] = last - first + 1 >= MANY
    covered[covered.mean(axis=1) < PARTLY] = False
    if not covered.any():
        return scans
    said = []
    for first, last in _stretches(np.asarray(covered.any(axis=1))):
        beams = np.flatnonzero(covered[first : last + 1].any(axis=0))
        said.append(
            f"{len(beams)} of {ranges.shape[1]} beams, {beams[0]} to {beams[-1]}, end nearer than "
            f"{BLOCKED} m in scans {first} to {last}: a part of the lidar is blocked; left out"
        )
    return replace(
        scans, ranges=np.where(covered, np.nan, ranges), findings=(*scans.findings, *said[:MOST])
    )


def straightened(scans: Scans) -> Scans:
    """With the beams as far apart as walls tell, where they clearly are not as is said."""
    lidar, beams = scans.lidar, scans.ranges.shape[1]
    step = beam_step(scans.ranges, lidar.step)
    if scans.assumed or step == lidar.step:  # what is assumed was chosen so
        return scans
    said = (
        f"walls are straight where beams are {abs(np.degrees(step)):.3g}° apart, not "
        f"{abs(np.degrees(lidar.step)):.3g}° as is said: taken to be so"
    )
    start = lidar.start + 0.5 * (beams - 1) * (lidar.step - step)
    lidar = replace(lidar, start=start, step=step)
    return replace(scans, lidar=lidar, findings=(*scans.findings, said))
