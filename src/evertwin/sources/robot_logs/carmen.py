"""CARMEN logs: one message a line, told by its first word. Scans, odometry, and poses of others.

    FLASER n r1 … rn  x y theta  odom_x odom_y odom_theta  stamp host logged
    ROBOTLASER1 type start fov step longest accuracy mode n r1 … rn m …  x y theta  odom_x …
    ODOM x y theta speed turn acceleration  stamp host logged

Ranges and poses are in metres and radians. ``FLASER`` says nothing of its angles: a SICK's 180 and
181 beams are a degree apart, 360 and 361 half a degree, others share half a turn; the first looks
to the right (of 181, a log of 180 leaves the last out). Where the first beam and the last see the
same, they are taken to share a whole turn; where walls are straight at another angle, that one. The
largest value that keeps returning means that nothing came back. Logs that went through a mapping
program carry its poses in place of the wheels': so odometry is taken from ``ODOM`` lines, or from
the second pose of each scan where the first, the lidar's, does not go along with it. GMapping sets
odometry back to its own pose at every scan, by an ``ODOM`` line without a stamp: only the steps
between are the wheels', and they are chained anew.

Poses are the lidar's. Where it is on the machine, the two poses of each scan say, or a parameter;
odometry is told of the lidar, too.
"""

from __future__ import annotations

import gzip
import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from evertwin.errors import DataError
from evertwin.signals.planar import between, chained, compose
from evertwin.sources.clocks.stamps import NO_STAMP, texts, to_ns
from evertwin.sources.columns.scans import (
    Lidar,
    Poses,
    Scans,
    at_stamps,
    ceiling,
    increasing,
    mended,
    shuffled,
)
from evertwin.sources.columns.table import WIDEST, Column, Recording
from evertwin.sources.foreign import foreign
from evertwin.sources.numeric.arrays import LARGEST, ArrayTable
from evertwin.sources.robot_logs.straight_walls import beam_step
from evertwin.types import Stamps

SCANS = ("FLASER", "RLASER", "ROBOTLASER1", "ROBOTLASER2", "RAWLASER1", "RAWLASER2")
OFFSETS = {
    b"robot_frontlaser_offset": ("FLASER", 0.0),
    b"robot_rearlaser_offset": ("RLASER", math.pi),
}
"""Parameters that say how far ahead of the robot's middle a lidar is [m], and where it looks."""
APART, LOOSE = 1e-3, 0.02
"""How far two poses differ that are not one, and by how much a fixed step varies [m, rad]."""
NO_RETURN = 81.8
"""From here on a SICK LMS, which most of these logs were made with, states error codes [m]."""

SHARED = (100.0, 240.0, 270.0, 360.0)
"""What beams may share besides half a turn [°]."""
MANY, NEIGHBOURS = 30, 0.9
"""Scans from which on two beams are neighbours: where the ranks of their ranges have this
correlation."""
FLAT = 1.1
"""Ratio of the longest ranges of a scan and the shortest, without the rarest twentieths, up to
which it shows nothing: a lidar that is covered."""


class _Scan(NamedTuple):
    line: int
    ranges: list[float]
    poses: list[float]
    """The lidar's x, y, theta, then the wheels'; may be empty."""
    angles: tuple[float, float, float] | None
    """Start, step [rad], longest range [m]; None: the line does not say."""
    stamp: bytes


class _Odometry(NamedTuple):
    """The wheels' poses that can be relied on."""

    line: np.ndarray
    t: Stamps
    poses: Poses


@dataclass
class _Lines:
    """The messages of a log, by their word."""

    scans: dict[str, list[_Scan]] = field(default_factory=dict)
    odometry: list[tuple[int, list[float], bytes]] = field(default_factory=list)
    damaged: dict[str, list[tuple[int, str]]] = field(default_factory=dict)
    mounts: dict[str, np.ndarray] = field(default_factory=dict)

    def take(self, number: int, line: bytes) -> None:
        word, *cells = line.split() or [b""]
        name = word.decode("ascii", "replace")
        if name == "PARAM" and len(cells) > 1 and cells[0] in OFFSETS:
            lidar, turn = OFFSETS[cells[0]]
            with suppress(ValueError):  # else it says nothing
                self.mounts[lidar] = np.array([math.cos(turn) * _finite(cells[1:2])[0], 0.0, turn])
            return
        if name not in SCANS and name != "ODOM":
            return
        try:
            if name == "ODOM":
                numbers = _finite(cells[:6])
                self.odometry.append((number, numbers, _stamp(cells[6:])))
            else:
                read = _plain if name.endswith("LASER") else _described
                self.scans.setdefault(name, []).append(read(number, cells))
        except (ValueError, IndexError) as error:
            self.damaged.setdefault(name, []).append((number, str(error)))


def _finite(cells: list[bytes]) -> list[float]:
    numbers = [float(cell) for cell in cells]
    if not all(map(math.isfinite, numbers)):
        raise ValueError("a pose that is no number")
    return numbers


def _stamp(cells: list[bytes]) -> bytes:
    """``stamp host logged``: the sender's stamp."""
    if len(cells) < 3:
        raise ValueError(f"{len(cells)} fields where stamp, host and logging time belong")
    return cells[0]


def _cut(cells: list[bytes], at: int) -> tuple[list[float], list[bytes]]:
    """So many numbers as the cell says, and what follows them."""
    count = int(cells[at])
    rest = cells[at + 1 :]
    if not 0 <= count <= min(len(rest), WIDEST):
        raise ValueError(f"{count} values are stated, {len(rest)} fields follow")
    return [float(cell) for cell in rest[:count]], rest[count:]


def _plain(number: int, cells: list[bytes]) -> _Scan:
    ranges, rest = _cut(cells, 0)
    return _Scan(number, ranges, _finite(rest[:6]), None, _stamp(rest[6:]))


def _described(number: int, cells: list[bytes]) -> _Scan:
    start, _, step, longest = _finite(cells[1:5])
    ranges, rest = _cut(cells, 7)
    _, rest = _cut(rest, 0)  # remissions
    posed = len(rest) >= 14  # RAWLASER has none
    poses, rest = (_finite(rest[:6]), rest[11:]) if posed else ([], rest)
    return _Scan(number, ranges, poses, (start, step, longest), _stamp(rest))


def open_carmen(path: Path) -> Recording:
    """The scans of a log and its odometry, as arrays and as tables.

    Raises:
        DataError: too large, damaged from its first line on, or without scans and odometry.
    """
    lines = _Lines()
    for number, line in _numbered(path):
        lines.take(number, line)
    notes = [f"{name}: {len(bad)} lines left out, the first in line {bad[0][0]}: {bad[0][1]}"
             for name, bad in lines.damaged.items()]  # fmt: skip
    odometry, said = _odometry(lines)
    notes += said
    scans = tuple(
        _scans(name, found, (odometry, lines.mounts.get(name)), notes)
        for name, found in lines.scans.items()
    )
    tables = [_poses(path, one, lines.scans[one.name]) for one in scans]
    if lines.odometry:
        names = ["x", "y", "theta", "speed", "turn", "acceleration"]
        values = np.array([row for _, row, _ in lines.odometry])
        stamps = texts([cell for *_, cell in lines.odometry])
        tables.append(_table(path, "ODOM", stamps, dict(zip(names, values.T, strict=True))))
    if not tables:
        raise DataError(f"{path.name}: expected a CARMEN log with scans or odometry, found neither")
    return Recording(path, "carmen", tuple(tables), tuple(notes), scans)


def _numbered(path: Path) -> Iterator[tuple[int, bytes]]:
    size = 0
    with path.open("rb") as file:
        opener = gzip.open if file.read(2) == b"\x1f\x8b" else open
    with foreign(path.name), opener(path, "rb") as file:
        for number, line in enumerate(file, 1):
            size += len(line)
            if size > LARGEST:
                raise DataError(f"{path.name}: more than {LARGEST} bytes: cut the log into parts")
            yield number, line


def _odometry(lines: _Lines) -> tuple[_Odometry | None, list[str]]:
    """The odometry in time, and what was wrong with it."""
    if not lines.odometry:
        return None, ["ODOM: no such lines: this log has no odometry of its own"]
    number = np.array([n for n, *_ in lines.odometry])
    poses = np.array([row[:3] for _, row, _ in lines.odometry])
    t = to_ns(texts([cell for *_, cell in lines.odometry]), "s")
    order = shuffled(t)
    if order is not None:
        t, poses, number = t[order], poses[order], np.sort(number)
    keep = (t != NO_STAMP) & (t != 0)  # 0: nobody set it
    keep[keep] = increasing(t[keep])
    if 2 * keep.sum() < len(t):
        if len(np.unique(t)) > 1:
            return None, [f"ODOM: only {keep.sum()} of {len(t)} stamps increase: not used"]
        return _Odometry(number, np.full(len(t), NO_STAMP), poses), [
            "ODOM: every stamp is the same: placed by the order of the lines"
        ]
    odd = np.flatnonzero(~keep)
    if not len(odd):
        return _Odometry(number, t, poses), []
    at = int(odd[0])
    said = (
        f"ODOM: the stamps of {len(odd)} of {len(t)} lines are not set, repeat or go back, the "
        f"first {t[at] * 1e-9:.6g} s in line {number[at]}: steps onto them are no motion"
    )
    steps = between(poses[:-1], poses[1:])
    steps[~keep[1:]] = 0.0
    return _Odometry(number[keep], t[keep], chained(poses[0], steps)[keep]), [said]


def _scans(
    name: str,
    found: list[_Scan],
    moved: tuple[_Odometry | None, np.ndarray | None],
    notes: list[str],
) -> Scans:
    """The scans of one lidar; those with another number of beams are left out.

    ``moved``: odometry, and where a parameter says that the lidar is.
    """
    counts = np.array([len(scan.ranges) for scan in found])
    usual = int(np.bincount(counts).argmax())
    others = int((counts != usual).sum())
    if others:
        notes.append(f"{name}: {others} of {len(found)} scans have not {usual} beams: left out")
    found[:] = [scan for scan in found if len(scan.ranges) == usual]
    raw, said = to_ns(texts([scan.stamp for scan in found]), "s"), []
    order = shuffled(raw)
    if order is not None:
        found[:], moved_rows = [found[k] for k in order], int((np.diff(raw) < 0).sum())
        said.append(f"{moved_rows} of {len(raw)} scans stand out of order, by their stamps, which "
                    "are even: taken in the order of these")  # fmt: skip
        raw = raw[order]
    ranges = np.array([scan.ranges for scan in found]).reshape(len(found), usual)
    longest = math.inf if found[0].angles is None else found[0].angles[2]
    error = NO_RETURN if longest < NO_RETURN + 1 or math.isinf(longest) else math.inf
    longest = min(longest, error, ceiling(ranges))
    ranges[~((ranges > 0) & (ranges < longest))] = np.nan
    t, kept = mended(raw)
    stated = None
    if all(scan.poses for scan in found):
        stated = np.array([scan.poses[:3] for scan in found])
    odometry, mount = moved
    wheels = None if odometry is None else _beside(found, t, bool(kept.any()), odometry)
    wheels, about = _of_lidar(found, wheels, mount)
    step, assumed = _assumed(name, ranges)
    lidar = Lidar.ahead(usual, step, longest)
    if found[0].angles is not None:
        lidar, assumed = Lidar(*found[0].angles[:2], longest), ""
    findings = (*said, *_clock(raw, kept), *about)
    return Scans(
        name, t, ranges, lidar, wheels, stated, bool(kept.any()), findings, assumed=assumed,
        handed=True,
    )  # fmt: skip


def _of_lidar(
    found: list[_Scan], wheels: Poses | None, mount: np.ndarray | None
) -> tuple[Poses | None, list[str]]:
    """Odometry of the lidar at each scan, and what is said of the two poses of each.

    ``wheels``: by ``ODOM`` lines. ``mount``: by a parameter.
    """
    said = []
    if all(scan.poses for scan in found):
        both = np.array([scan.poses for scan in found]).reshape(-1, 2, 3)
        step = between(both[:, 1], both[:, 0])
        fixed = np.median(step, axis=0)
        if np.abs(step).max() < APART:
            said.append(
                "the poses of lidar and odometry are the same in every line: what is called "
                "odometry may be the result of a mapping program, and is not used"
                + ("" if wheels is None else "; the lines of odometry alone are")
            )
        elif np.quantile(np.abs(step - fixed).max(axis=1), 0.95) < LOOSE:
            mount = fixed
            said.append(
                f"the lidar is {fixed[0]:.2f} m ahead and {fixed[1]:.2f} m to the left of the "
                "robot's middle: poses are the lidar's"
                + ("" if wheels is not None else "; what is called odometry goes along with them "
                   "and may be the result of a mapping program: not used")
            )  # fmt: skip
        elif wheels is None:
            wheels = both[:, 1]
            said.append("the second pose of each line, which the first does not go along with, is "
                        "taken for odometry")  # fmt: skip
    if wheels is None or mount is None:
        return wheels, said
    return compose(wheels, np.broadcast_to(mount, wheels.shape)), said


def _assumed(name: str, ranges: np.ndarray) -> tuple[float, str]:
    """The step from beam to beam of a lidar that does not say it [rad], and that it does not."""
    n = ranges.shape[1]
    gaps = n if n in (180, 360) else max(n - 1, 1)
    share, why = math.pi, ""
    if _all_around(ranges):
        gaps, share, why = n - n % 2, 2 * math.pi, ", as the first and the last see the same"
    else:
        step = beam_step(ranges, share / gaps, [math.radians(one) / gaps for one in SHARED])
        share, before = step * gaps, share
        why = ", as walls are straight then" if share != before else ""
    return share / gaps, (
        f"{name} says nothing of its angles: {n} beams are taken to share {math.degrees(share):.0f}"
        f"°, {math.degrees(share / gaps):.3g}° apart{why}; evertwin map --step takes others"
    )


def _all_around(ranges: np.ndarray) -> bool:
    """Are the first beam and the last neighbours, scan for scan? By ranks, and without scans that
    show nothing: a few of a covered lidar would say so of any two beams."""
    known = ranges[np.isfinite(ranges[:, [0, -1]]).all(axis=1)]
    short, long = np.nanquantile(known, [0.05, 0.95], axis=1) if len(known) else known.T[:2]
    ends = known[long > FLAT * short][:, [0, -1]]
    if len(ends) < MANY or not (ends.std(axis=0) > 0).all():
        return False
    return bool(np.corrcoef([_ranks(beam) for beam in ends.T])[0, 1] > NEIGHBOURS)


def _ranks(values: np.ndarray) -> np.ndarray:
    """Places in order; equal ones share the mean of theirs."""
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    return (np.cumsum(count) - 0.5 * count)[place]


def _clock(raw: Stamps, kept: np.ndarray) -> Iterator[str]:
    odd = np.flatnonzero(~kept)
    if len(odd) == len(raw):
        same = "every stamp is the same" if len(np.unique(raw)) == 1 else "most stamps go back"
        yield f"{same}: scans are counted, and no rate or speed can be told"
    elif len(odd):
        back = int((np.diff(raw) < 0).sum())
        yield (
            f"{len(odd)} of {len(raw)} stamps repeat or go back ({back} go back, by up to "
            f"{-1e-9 * np.diff(raw).min():.3g} s): placed between their neighbours in the order "
            "of the lines"
        )


def _beside(found: list[_Scan], t: Stamps, timed: bool, odometry: _Odometry) -> Poses:
    """The odometry at each scan: by stamps, else by the order of lines."""
    lines, known, poses = odometry
    if timed and known[0] != NO_STAMP:
        return at_stamps(t, known, poses)
    last = np.searchsorted(lines, [scan.line for scan in found]) - 1
    first, many = np.unique(last, return_index=True, return_counts=True)[1:]
    share = (np.arange(len(last)) - np.repeat(first, many)) / np.repeat(many, many)
    turned = np.column_stack([poses[:, :2], np.unwrap(poses[:, 2])])
    whole = np.maximum(last, 0) + share  # several scans after one line share the step to the next
    out = np.column_stack([np.interp(whole, np.arange(len(lines)), c) for c in turned.T])
    out[last < 0] = np.nan
    return out


def _poses(path: Path, scans: Scans, found: list[_Scan]) -> ArrayTable:
    """What stands beside the ranges of each scan, as a table."""
    names = ["laser.x", "laser.y", "laser.theta", "odom.x", "odom.y", "odom.theta"]
    poses = np.array([scan.poses for scan in found] if scans.stated is not None else [])
    stamps = texts([scan.stamp for scan in found])
    return _table(path, scans.name, stamps, dict(zip(names, poses.T, strict=False)))


def _table(path: Path, name: str, stamps: np.ndarray, values: dict[str, np.ndarray]) -> ArrayTable:
    numbers = (Column(f"{name}.{column}", "number", _UNITS.get(column, "")) for column in values)
    columns = (Column(f"{name}.stamp", "time", "s"), *numbers)
    return ArrayTable(path, columns, (stamps, *values.values()), name)


_UNITS = {"x": "m", "y": "m", "theta": "rad", "speed": "m/s", "turn": "rad/s",
          "acceleration": "m/s**2", "laser.x": "m", "laser.y": "m", "laser.theta": "rad",
          "odom.x": "m", "odom.y": "m", "odom.theta": "rad"}  # fmt: skip
