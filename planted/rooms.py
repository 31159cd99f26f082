"""Floors drawn by seed, and what a lidar sees on them.

A floor is rooms along a corridor that closes to a ring, with doors, boxes and pillars; a robot
drives around it. The lidar's angles, range, noise and rate are drawn, too.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.signals.planar import between, compose
from evertwin.sources.columns.scans import Lidar, Scans


class Floor(NamedTuple):
    """Walls as segments, and the way around."""

    walls: np.ndarray
    """(k, 4): x, y of both ends [m]."""
    way: np.ndarray
    """Corners of the corridor's middle line (m, 2)."""


class Sensor(NamedTuple):
    """A lidar."""

    beams: int = 180
    step: float = np.radians(1.0)
    longest: float = 20.0
    noise: float = 0.01
    """Standard deviation of a range [m]."""
    apart: float = 0.15
    """Way between scans [m]."""


def box(x: float, y: float, w: float, h: float, turn: float = 0.0) -> np.ndarray:
    """Four walls around (x, y), as segments (4, 4)."""
    corners = 0.5 * np.array([[-w, -h], [w, -h], [w, h], [-w, h]])
    c, s = np.cos(turn), np.sin(turn)
    corners = corners @ np.array([[c, s], [-s, c]]) + [x, y]
    return np.hstack([corners, np.roll(corners, -1, axis=0)])


def floor(seed: int) -> Floor:
    """A ring of corridors around a block, rooms outside of it."""
    rng = np.random.default_rng(seed)
    w, h, wide, deep = *rng.uniform(8, 16, 2), rng.uniform(1.8, 2.6), rng.uniform(3, 5)
    walls = [box(0, 0, w, h)]
    outer_w, outer_h = w + 2 * wide, h + 2 * wide
    walls.append(box(0, 0, outer_w + 2 * deep, outer_h + 2 * deep))
    for side in range(4):
        length = outer_w if side % 2 == 0 else outer_h
        off = (outer_h if side % 2 == 0 else outer_w) / 2
        turn = side * np.pi / 2
        ends = np.sort(rng.uniform(-length / 2 + 0.5, length / 2 - 0.5, 4))
        cuts = [-length / 2, ends[0], ends[0] + 0.9, ends[2], ends[2] + 0.9, length / 2]
        pieces = [[a, off, b, off] for a, b in zip(cuts[::2], cuts[1::2]) if b > a]
        pieces += [[x, off, x, off + deep] for x in rng.uniform(-length / 2, length / 2, 3)]
        c, s = np.cos(turn), np.sin(turn)
        ends_ = np.array(pieces).reshape(-1, 2, 2) @ np.array([[c, s], [-s, c]])
        walls.append(ends_.reshape(-1, 4))
        for _ in range(3):
            at = np.array(
                [rng.uniform(-length / 2, length / 2), off + rng.uniform(0.6, deep - 0.5)]
            )
            x, y = at @ np.array([[c, s], [-s, c]])
            walls.append(box(x, y, *rng.uniform(0.3, 1.0, 2), rng.uniform(0, np.pi)))
        at = np.array([rng.uniform(-length / 3, length / 3), off - 0.15])
        x, y = at @ np.array([[c, s], [-s, c]])
        walls.append(box(x, y, 0.25, 0.25, turn))
    half = np.array([w + wide, h + wide]) / 2
    way = half * np.array([[1, -1], [1, 1], [-1, 1], [-1, -1], [1, -1]])
    return Floor(np.concatenate(walls), way)


def ranges(walls: np.ndarray, pose: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Of each beam [m]; infinity where it meets no wall."""
    a, b = walls[:, :2] - pose[:2], walls[:, 2:] - pose[:2]
    d = b - a
    u = np.stack([np.cos(angles + pose[2]), np.sin(angles + pose[2])], axis=1)
    cross = u[:, :1] * d[:, 1] - u[:, 1:] * d[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        r = (a[:, 0] * d[:, 1] - a[:, 1] * d[:, 0]) / cross
        k = (a[:, 0] * u[:, 1:] - a[:, 1] * u[:, :1]) / cross
    return np.min(np.where((r > 0) & (k >= 0) & (k <= 1), r, np.inf), axis=1)


def drive(place: Floor, apart: float, rng: np.random.Generator, laps: float = 1.2) -> np.ndarray:
    """Poses (n, 3) around the floor, ``apart`` from one to the next, swaying a little."""
    corners = np.concatenate([place.way[:-1], place.way[:-1]])
    legs = np.hypot(*np.diff(corners, axis=0).T)
    total = laps * np.hypot(*np.diff(place.way, axis=0).T).sum()
    at = np.arange(0, total, apart)
    way = np.concatenate([[0.0], np.cumsum(legs)])
    xy = np.stack([np.interp(at, way, corners[:, j]) for j in (0, 1)], axis=1)
    wide = max(int(1.0 / apart), 1)
    pad = np.pad(xy, ((wide, wide), (0, 0)), mode="edge")
    kernel = np.ones(2 * wide + 1) / (2 * wide + 1)
    xy = np.stack([np.convolve(pad[:, j], kernel, mode="valid") for j in (0, 1)], axis=1)
    heading = np.unwrap(np.arctan2(*np.gradient(xy, axis=0).T[::-1]))
    sway = 0.1 * np.sin(at / 2.0 + rng.uniform(0, 6))
    return np.column_stack([xy, heading + sway])


PLAIN = Sensor()


def recorded(
    seed: int, sensor: Sensor = PLAIN, laps: float = 1.2, slip: float | None = None
) -> tuple[Scans, np.ndarray]:
    """Scans of a drive and its true poses; with ``slip`` odometry that errs by so much."""
    rng = np.random.default_rng([seed, 1])
    place = floor(seed)
    poses = drive(place, sensor.apart, rng, laps)
    lidar = Lidar(-0.5 * sensor.step * (sensor.beams - 1), sensor.step, sensor.longest)
    angles = lidar.angles(sensor.beams)
    seen = np.array([ranges(place.walls, pose, angles) for pose in poses])
    seen += sensor.noise * rng.normal(size=seen.shape)
    seen[~(seen < sensor.longest)] = np.nan
    t = np.arange(len(poses), dtype=np.int64) * int(sensor.apart / 0.5 * 1e9)
    odometry = None
    if slip is not None:
        steps = between(poses[:-1], poses[1:])
        steps = steps * (1 + slip * rng.normal(size=steps.shape))
        odometry = np.zeros_like(poses)
        for i, step in enumerate(steps):
            odometry[i + 1] = compose(odometry[i], step)
    return Scans("scan", t, seen, lidar, odometry), poses
