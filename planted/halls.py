"""Halls drawn by seed: tables on legs, and what may be taken for one; and what a lidar sees there.

Between and beside the tables stand chairs (partly under them), solid boxes, round pillars and thin
posts; people walk about. The robot drives a lane around the middle. Lidar, rate and speed are
drawn, too. A table may be moved on the way.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.signals.planar import between
from evertwin.sources.columns.scans import Lidar, Scans
from planted.rooms import box, ranges

LANE = 1.4
"""Distance of the lane's middle from the walls [m]."""
CLEAR = 0.75
"""Of anything from the lane's middle [m]."""


class Hall(NamedTuple):
    """What stands in a hall."""

    size: np.ndarray
    """Width, depth [m]; the origin is its middle."""
    walls: np.ndarray
    """Of the hall and of solid boxes, (k, 4)."""
    rounds: np.ndarray
    """Pillars, posts, legs of chairs: x, y, radius (m, 3) [m]."""
    tables: np.ndarray
    """x, y, heading, length and width around the legs, radius of the legs (n, 6)."""


class Sight(NamedTuple):
    """A drive through a hall."""

    scans: Scans
    poses: np.ndarray
    """True ones (n, 3), in the hall."""
    before: np.ndarray
    """Tables (n, 6) at first."""
    after: np.ndarray
    """In the end; the same rows."""
    moved: int
    """Row of the table that was moved; -1: none."""
    when: int
    """Scan from which on it stands elsewhere."""


def legs(table: np.ndarray) -> np.ndarray:
    """Middles and radii of a table's legs, (4, 3)."""
    x, y, turn, length, width, radius = table
    half = 0.5 * np.array([length, width]) - radius
    own = half * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    c, s = np.cos(turn), np.sin(turn)
    at = own @ np.array([[c, s], [-s, c]]) + [x, y]
    return np.column_stack([at, np.full(4, radius)])


def met(rounds: np.ndarray, pose: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Range of each beam to the nearest circle [m]; infinity where it meets none."""
    if not len(rounds):
        return np.full(len(angles), np.inf)
    off = rounds[:, :2] - pose[:2]
    along = np.stack([np.cos(angles + pose[2]), np.sin(angles + pose[2])])
    ahead = off @ along
    left = off[:, :1] * along[1] - off[:, 1:] * along[0]
    inside = rounds[:, 2:] * rounds[:, 2:] - left * left
    r = ahead - np.sqrt(np.maximum(inside, 0.0))
    return np.min(np.where((inside > 0) & (r > 0), r, np.inf), axis=0)


def free_place(rng: np.random.Generator, size: np.ndarray, reach: float, taken: list) -> np.ndarray:
    """A place off the lane and off what stands there; raises where there is none."""
    for _ in range(200):
        at = rng.uniform(-0.5, 0.5, 2) * (size - 2 * reach)
        lane = 0.5 * size - LANE
        outside = np.abs(at) - lane  # of the lane's rectangle: > 0 between it and the wall
        away = -outside.max() if outside.max() < 0 else np.hypot(*np.maximum(outside, 0))
        if away < CLEAR + reach:
            continue
        if all(np.hypot(*(at - other[:2])) > reach + other[2] + 0.45 for other in taken):
            taken.append(np.array([*at, reach]))
            return at
    raise ValueError("no place left")


def hall(seed: int, tables: int) -> tuple[Hall, list]:
    """A hall with so many tables, some of them in touching pairs; what is taken of the floor."""
    rng = np.random.default_rng([seed, 2])
    size = rng.uniform(8.0, 12.0, 2)
    walls, taken, stand, rounds = [box(0, 0, *size)], [], [], []
    while len(stand) < tables:
        length, width = rng.uniform(0.8, 1.8), rng.uniform(0.55, 0.9)
        radius, turn = rng.uniform(0.015, 0.04), rng.uniform(-np.pi / 2, np.pi / 2)
        pair = len(stand) + 2 <= tables and rng.random() < 0.3
        reach = 0.5 * np.hypot(length, 2 * width if pair else width)
        try:
            at = free_place(rng, size, reach, taken)
        except ValueError:
            break
        inset = rng.uniform(0.0, 0.1)  # of the legs from the plate's edge
        across = (0.5 * width + inset) * np.array([-np.sin(turn), np.cos(turn)])
        for side in (1, -1) if pair else (0,):
            stand.append([*(at + side * across), turn, length, width, radius])
    for table in stand:
        if rng.random() < 0.4:  # a chair, half under it
            c, s = np.cos(table[2]), np.sin(table[2])
            at = np.array(table[:2]) + 0.5 * table[4] * np.array([-s, c])
            rounds += _chair(rng, at, table[2])
    for kind in ("box", "box", "chair", "pillar", "post"):
        if rng.random() < 0.6:
            try:
                at = free_place(rng, size, 0.6 if kind == "box" else 0.3, taken)
            except ValueError:
                continue
            if kind == "box":
                walls.append(box(*at, *rng.uniform(0.3, 0.85, 2), rng.uniform(0, np.pi)))
            elif kind == "chair":
                rounds += _chair(rng, at, rng.uniform(0, np.pi))
            else:
                wide = rng.uniform(0.1, 0.25) if kind == "pillar" else rng.uniform(0.02, 0.05)
                rounds.append([*at, wide])
    return Hall(size, np.concatenate(walls), np.array(rounds).reshape(-1, 3),
                np.array(stand).reshape(-1, 6)), taken  # fmt: skip


def _chair(rng: np.random.Generator, at: np.ndarray, turn: float) -> list[list[float]]:
    side, radius = rng.uniform(0.36, 0.44), rng.uniform(0.01, 0.02)
    return legs(np.array([*at, turn, side, side, radius])).tolist()


def lane(size: np.ndarray, speed: float, rate: float, laps: float) -> np.ndarray:
    """Poses (n, 3) around the hall, with round corners."""
    half, turn = 0.5 * size - LANE, 0.7
    corners = np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]])
    way = []
    for k, corner in enumerate(corners):
        middle = corner * (half - turn)
        angles = np.linspace(-np.pi / 2, 0, 16) + k * np.pi / 2
        way.append(middle + turn * np.column_stack([np.cos(angles), np.sin(angles)]))
    ring = np.concatenate([*way, way[0][:1]])
    at = np.r_[0.0, np.cumsum(np.hypot(*np.diff(ring, axis=0).T))]
    along = np.arange(0.0, laps * at[-1], speed / rate)
    xy = np.column_stack([np.interp(along % at[-1], at, ring[:, j]) for j in (0, 1)])
    heading = np.unwrap(np.arctan2(*np.gradient(xy, axis=0).T[::-1]))
    return np.column_stack([xy, heading + 0.05 * np.sin(along)])


def people(rng: np.random.Generator, size: np.ndarray, count: int, t: np.ndarray) -> np.ndarray:
    """Legs of people that walk to and fro, one still at a time: (n, 2·count, 3)."""
    out = np.zeros((len(t), 2 * count, 3))
    for k in range(count):
        a, b = rng.uniform(-0.42, 0.42, (2, 2)) * size
        length = max(float(np.hypot(*(b - a))), 0.5)
        along, phase = (b - a) / length, rng.uniform(0, 100)
        across = np.array([-along[1], along[0]])
        for foot, side in enumerate((-0.11, 0.11)):
            stride = (t + phase) / 1.1 + 0.5 * foot
            steps = np.floor(stride) + np.clip(2 * (stride % 1) - 1, 0, 1)  # stands, then swings
            way = 1.1 * 0.8 * steps % (2 * length)
            way = np.where(way > length, 2 * length - way, way)
            out[:, 2 * k + foot, :2] = a + way[:, None] * along + side * across
            out[:, 2 * k + foot, 2] = 0.055
    return out


LIDARS = ((360, 1.0, 12.0), (720, 0.5, 20.0), (540, 0.5, 10.0), (1081, 0.25, 30.0))
"""Beams, degrees from one to the next, range [m]."""


def recorded_hall(seed: int, move: bool = False, tables: int | None = None) -> Sight:
    """A drive: one lap, or two if a table is ``move``d between."""
    rng = np.random.default_rng([seed, 3])
    count = int(rng.integers(1 if move else 0, 7)) if tables is None else tables
    place, taken = hall(seed, count)
    beams, step, longest = LIDARS[int(rng.integers(len(LIDARS)))]
    rate, speed = rng.uniform(5, 10), rng.uniform(0.3, 0.6)
    lidar = Lidar(-0.5 * np.radians(step) * (beams - 1), float(np.radians(step)), longest)
    poses = lane(place.size, speed, rate, 2.1 if move else 1.15)
    t = np.arange(len(poses)) / rate
    walkers = people(rng, place.size, int(rng.integers(0, 3)), t)
    after, moved, when = place.tables.copy(), -1, len(poses)
    if move and len(after):
        moved, when = int(rng.integers(len(after))), int(rng.uniform(0.5, 0.6) * len(poses))
        reach = 0.5 * float(np.hypot(*after[moved, 3:5]))
        try:
            after[moved, :2] = free_place(rng, place.size, reach, taken)
            after[moved, 2] = rng.uniform(-np.pi / 2, np.pi / 2)
        except ValueError:  # the hall is full
            moved, when = -1, len(poses)
    angles = lidar.angles(beams)
    seen = np.zeros((len(poses), beams))
    standing = [
        np.concatenate([place.rounds, *(legs(one) for one in tables_)])
        for tables_ in (place.tables, after)
    ]
    for k, pose in enumerate(poses):
        rounds = np.concatenate([standing[int(k >= when)], walkers[k]])
        seen[k] = np.minimum(ranges(place.walls, pose, angles), met(rounds, pose, angles))
    seen += rng.uniform(0.005, 0.015) * rng.normal(size=seen.shape)
    seen[~(seen < longest)] = np.nan
    stamps = np.rint(t * 1e9).astype(np.int64)
    return Sight(Scans("scan", stamps, seen, lidar), poses, place.tables, after, moved, when)


def from_start(poses: np.ndarray, tables: np.ndarray) -> np.ndarray:
    """Tables (n, ≥ 3) in the frame of the first pose, as a map has them."""
    out = tables.copy()
    out[:, :3] = between(np.broadcast_to(poses[0], (len(tables), 3)), tables[:, :3])
    return out
