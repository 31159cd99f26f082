"""A load that comes and goes, told by its mass: `python -m proofs.load [SEEDS]`.

1. `twins/ur10e.toml`, tuned on the runs of February (`Twin.fit`), beside the motion of 31 January
   without, with, and without a load again, as recorded (needs EVERTWIN_DATA).
2. The same twin beside a February run into which a load of 0.5 to 8 kg is put, drawn anew for each
   seed with its centre and the rows at which it is taken up and put down: its torque is added to
   the recorded one (semi-synthetic).
3. `twins/arm_load.toml` beside the embedded arm, which is told to carry 0.5 to 8 kg for a while.

Counted in seconds of motion (any joint faster than 0.05 rad/s) since the load came: when it is
live, and how far the mass of the live version is off 10 s and 30 s after it came; and the seconds
until it is told that it was put down. Other versions live meanwhile: what a load was learned as
wear, or anything else.
"""

from __future__ import annotations

import math
import os
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from evertwin import FitResult, RunResult
from evertwin.fold import take
from planted.twins import opened, with_values
from planted.worlds import record_live
from proofs._verdict import ended, no_data
from proofs.ur10e import files, fitted

ABOVE = 0.05
"""Speed from which a joint moves [rad/s]."""


class Told(NamedTuple):
    """What came of one load."""

    mass: float
    live: float
    """Seconds of motion until it was live; infinite: never."""
    off: tuple[float, float]
    """Error of the live mass after 10 s and 30 s of motion [kg]; NaN: the load was gone by then."""
    over: float
    """Seconds of motion from its end until it was told."""
    others: int
    """Versions that went live while it was on and are no state."""


def told(result: RunResult, mass: float, first: int, last: int) -> Told:
    """What a run told of a load from row ``first`` to row ``last``."""
    trace = result.trace
    moves = (np.abs(trace["input"][:, 6:12]) > ABOVE).any(axis=1)
    t = np.asarray(trace["t"], dtype=np.float64) * 1e-9
    motion = np.cumsum(np.where(moves, np.diff(t, prepend=t[0]).clip(0.0, 0.2), 0.0))
    states = [e for e in result.of_kind("state") if e.row > first]
    here = [e for e in states if e.row <= last]
    gone = [e for e in states if "put down" in e.reason and e.row > last]
    came = [e for e in here if "put down" not in e.reason]
    off = []
    for after in (10.0, 30.0):
        row = int(np.searchsorted(motion, motion[first] + after))
        known = [kilograms(e.reason) for e in here if e.row <= row]
        size = known[-1] if known else 0.0
        off.append(abs(size - mass) if row <= last else math.nan)
    swaps = {e.row for e in result.of_kind("promoted") if first < e.row <= last}
    seconds = [motion[min(e[0].row, len(motion) - 1)] if e else np.inf for e in (came, gone)]
    return Told(
        mass, float(seconds[0] - motion[first]), (off[0], off[1]),
        float(seconds[1] - motion[last]), len(swaps - {e.row for e in states}),
    )  # fmt: skip


def kilograms(reason: str) -> float:
    """The mass that an event names."""
    return 0.0 if "put down" in reason else float(reason.split()[1])


def pair(known: FitResult) -> list[Told]:
    """Part 1."""
    runs = {"unload" in file.stem: file for file in files("load_pair")}
    with with_values("ur10e", known) as twin:
        result = twin.run([f"{runs[True]}@0:12", runs[False], f"{runs[True]}@12:"])
    for event in result.of_kind("state"):
        print(f"   row {event.row}: {event.reason}")
    edges = np.flatnonzero(np.diff(result.trace["task"]))
    return [told(result, 3.05, int(edges[0]), int(edges[1]))]


def planted(known: FitResult, seed: int) -> Told:
    """One load of part 2."""
    rng = np.random.default_rng(seed)
    runs = [file for file in files("identification") if "0sec" in file.stem]
    runs = [file for file in runs if "20sec" not in file.stem]
    with with_values("ur10e", known) as twin:
        block = twin.blocks([runs[rng.integers(len(runs))]])[0]
        names, p = twin.model.parameters.names, twin.model.parameters.values
    mass, centre = rng.uniform(0.5, 8.0), rng.uniform([-0.1, -0.1, -0.05], [0.1, 0.1, 0.15])
    first = int(rng.uniform(500, 900))
    last = first + int(rng.uniform(1200, max(len(block.t) - 1900 - first, 1300)))
    loaded = p.copy()
    loaded[[names.index(f"payload.{k}") for k in ("m", "mx", "my", "mz")]] = mass, *(mass * centre)
    x = np.empty(0)
    with with_values("ur10e", known) as twin:
        with_it, without = (twin.model.simulate(x, block.u, block.dt, q)[1] for q in (loaded, p))
        block, y = take(block, 0, last + 1500), block.y.copy()
        y[first:last] += (with_it - without)[first:last]
        rows = block._replace(y=y[: len(block.t)])
        return told(twin.run(rows), mass, first, last)


def embedded(folder: Path, seed: int) -> Told:
    """One load of part 3."""
    rng = np.random.default_rng(seed)
    mass, first = rng.uniform(0.5, 8.0), rng.uniform(70.0, 130.0)
    for_so_long = rng.uniform(40.0, 120.0)
    order = f"{first:.0f}:payload={mass:.2f} for={for_so_long:.0f}"
    file = folder / f"{seed}.csv"
    record_live("arm", file, round(first) + round(for_so_long) + 60.0, order, seed=seed)
    with opened("arm_load") as twin:
        result = twin.run([file])
    t = np.asarray(result.trace["t"]) * 1e-9
    rows = np.searchsorted(t, [round(first), round(first) + round(for_so_long)])
    return told(result, round(mass, 2), int(rows[0]), int(rows[1]))


def summary(title: str, found: list[Told]) -> bool:
    """Prints a part; does it hold what is asked?"""
    live = np.array([one.live for one in found])
    ten, thirty = (np.array([one.off[k] for one in found]) for k in range(2))
    over = np.array([one.over for one in found])
    late = np.quantile(live, 0.95, method="higher")
    print(
        f"{title}: {len(found)} loads; live after {np.median(live):.1f} s of motion (median), "
        f"{late:.1f} s (95 %)"
    )
    for name, off, limit in (("10 s", ten, 0.7), ("30 s", thirty, 0.2)):
        known = off[np.isfinite(off)]
        if len(known):
            middle, most, good = np.median(known), known.max(), np.mean(known <= limit)
            print(
                f"   after {name}: off by {middle:.3f} kg (median), {most:.3f} (most); "
                f"within {limit} kg: {good:.0%} of {len(known)}"
            )
    print(
        f"   put down told after {np.median(over):.1f} s (median), {over.max():.1f} s (most); "
        f"other versions live meanwhile: {sum(one.others for one in found)}",
        flush=True,
    )
    for one in found:
        if one.off[0] > 0.7 or one.off[1] > 0.2 or not np.isfinite(one.over):
            print(f"   missed: {one}")
    near = [off[np.isfinite(off)] <= limit for off, limit in ((ten, 0.7), (thirty, 0.2))]
    good = min(float(one.mean()) for one in near if len(one))
    return bool(good >= 0.95 and np.isfinite(over).mean() >= 0.95)


def main(seeds: int) -> int:
    """All parts."""
    good = {}
    if "EVERTWIN_DATA" in os.environ:
        known = fitted(files("identification"))
        good["as recorded"] = summary("1. as recorded", pair(known))
        good["planted"] = summary("2. planted", [planted(known, seed) for seed in range(seeds)])
    else:
        no_data()
    with tempfile.TemporaryDirectory() as name:
        found = [embedded(Path(name), seed) for seed in range(seeds)]
    good["embedded"] = summary("3. embedded", found)
    return ended(good)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 30))
