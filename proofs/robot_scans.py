"""A robot that tells its pose from scans improves its model: `python -m proofs.robot_scans [RUNS]`.

The experiment of `proofs.robot` on the embedded robot, which drives rounds in a hall, by the twin
files as they are shipped: with the pose from the scans (`twins/robot_live.toml`) and, on the same
recording, with the true pose as the world says it (`twins/robot_pose.toml`). Each run is another
seed of commands and noise, the drives by turns: 3 s standing, a sweep over all speeds, then random
commands, 1000 s in all. Counted are the position updates (2 cm) of the first model and of the last
champion over the last 100 rows, and how far the pose is off the true one. `wheels`: also with the
wheels' odometry and the gyro beside the scans.

Asked for: updates more than on true poses ≤ 1 per 100 at the median and ≤ 3 at 90 %; start
threshold 6 ± 1 cm/s and cap 16 ± 1 cm/s in 95 %.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from evertwin import RunResult, Twin, TwinSpec
from evertwin.config.spec import ChannelSpec, SourceSpec, TimeSpec
from evertwin.worlds.drive import WORLDS
from evertwin.worlds.live.recorder import main as record
from planted.twins import shipped
from proofs._verdict import ended

SECONDS, LAST = 1000, 100
START, CAP, WITHIN = 6.0, 16.0, 1.0
"""Of every drive [cm/s], and how near a figure must be."""


@dataclass(frozen=True)
class Count:
    """Of one run."""

    before: int
    after: int
    start: float
    cap: float
    """As learned [cm/s]; NaN: not."""
    place: float
    heading: float
    """How far the pose is off the true one, rms [m], [rad]."""
    told: float
    """Share of the rows with a pose."""


def with_wheels(spec: TwinSpec) -> TwinSpec:
    """The twin with odometry and gyro beside its scans."""
    assert spec.perception is not None
    time, units = TimeSpec("t", "s"), {"x": "m", "y": "m", "heading": "rad"}
    places = {f"wheel_{name}": ChannelSpec(name, unit) for name, unit in units.items()}
    odom = SourceSpec("odom", places, match="*odom*", time=time)
    imu = SourceSpec("imu", {"gyro": ChannelSpec("gyro", "rad/s")}, match="*imu*", time=time)
    rule = replace(spec.perception, wheels=tuple(places), gyro="gyro")
    return replace(spec, source=(*spec.source, odom, imu), perception=rule)


def count(result: RunResult, truth: np.ndarray) -> Count:
    """The figures of one run; ``truth``: x, y, heading at its rows."""
    trace = result.trace
    before, after = (int((trace[name][-LAST:] == 1).sum()) for name in ("first_update", "update"))
    told = result.to_dict()["parameters"]
    assert isinstance(told, dict)
    start, cap = (100 * float(told.get(f"law.v.{name}", {"value": np.nan})["value"])
                  for name in ("threshold", "cap"))  # fmt: skip
    off = trace["measured"] - truth[: len(trace["measured"])]
    off = off[np.isfinite(off).all(axis=1)]
    turn = np.angle(np.exp(1j * off[:, 2]))
    place, heading = np.sqrt(np.mean(off[:, :2] ** 2) * 2), np.sqrt(np.mean(turn**2))
    return Count(before, after, start, cap, place, heading, len(off) / len(trace["t"]))


def run(spec: TwinSpec, folder: Path, *topics: str) -> Count:
    """The twin on what was recorded."""
    truth = np.genfromtxt(folder / "run-pose.csv", delimiter=",", skip_header=1)[:, 2:5]
    with Twin(spec) as twin:
        return count(twin.run([folder / f"run-{one}.csv" for one in topics]),
                     truth * (0.01, 0.01, 1.0))  # fmt: skip


def named(one: Count) -> bool:
    """Are threshold and cap right?"""
    return abs(one.start - START) <= WITHIN and abs(one.cap - CAP) <= WITHIN


def told(name: str, counts: list[Count]) -> str:
    """One line."""
    before, after = (np.array([getattr(c, key) for c in counts]) for key in ("before", "after"))
    off = [np.sqrt(np.mean([getattr(c, key) ** 2 for c in counts])) for key in ("place", "heading")]
    return (
        f"{name:16} updates per {LAST}: {np.median(before):5.1f} -> {np.median(after):5.1f} "
        f"[{np.quantile(after, 0.1):.0f}, {np.quantile(after, 0.9):.0f}]; 6 and 16 ± 1: "
        f"{sum(map(named, counts))} of {len(counts)}; pose off by {100 * off[0]:.2f} cm, "
        f"{off[1]:.4f} rad; in {100 * np.mean([c.told for c in counts]):.1f} % of the rows"
    )


def main() -> int:
    """A line for each run, then for each way; exit code 1 where something asked is missed."""
    words = [one for one in sys.argv[1:] if one != "wheels"]
    runs = int(words[0]) if words else 6
    ways = {"true": (shipped("robot_pose"), ("command", "pose")),
            "scans": (shipped("robot_live"), ("command", "scan"))}  # fmt: skip
    if "wheels" in sys.argv:
        wheels = with_wheels(shipped("robot_live"))
        ways["scans and wheels"] = wheels, ("command", "scan", "odom", "imu")
    counts: dict[str, list[Count]] = {name: [] for name in ways}
    worlds = sorted(WORLDS)
    for seed in range(1, runs + 1):
        world = worlds[seed % len(worlds)]
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            record(["robot", "--seed", str(seed), "--world", world, "--seconds", str(SECONDS),
                    "--record", str(folder / "run.csv")])  # fmt: skip
            for way, (spec, topics) in ways.items():
                counts[way].append(run(spec, folder, *topics))
        shown = "; ".join(
            f"{way} {found[-1].before} -> {found[-1].after}, {found[-1].start:.1f} and "
            f"{found[-1].cap:.1f} cm/s" for way, found in counts.items()
        )  # fmt: skip
        print(f"seed {seed}, {world}: {shown}", flush=True)
    for way, found in counts.items():
        print(told(way, found))
    more = np.array([a.after - b.after for a, b in zip(counts["scans"], counts["true"])])
    middle, high = np.median(more), np.quantile(more, 0.9)
    print(f"scans less true: median {middle:+.1f}, 90 % {high:+.1f} per {LAST} ({runs} runs)")
    share = np.mean([named(one) for one in counts["scans"]])
    return ended({
        "median difference ≤ 1": middle <= 1, "90 % of the differences ≤ 3": high <= 3,
        "thresholds named in 95 %": share >= 0.95,
    })  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
