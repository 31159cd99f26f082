"""Contacts and pushes told from the machine: `python -m proofs.external [SEEDS] [DAYS]`.

Parts 1 to 3 need EVERTWIN_DATA. `twins/ur10e.toml`, tuned on the 30 s run of 10 February and the
50 s run of 12 February (`Twin.fit`), then beside other recordings as shipped (`Twin.run`):

1. Two recordings in which a person pushes the standing arm.
2. Every recording without a load, of all days, by the tuned twin and by the description alone;
   and `twins/emps.toml` beside its own. Counted are events `external`: all of them are false.
3. Contacts: a torque of 4 to 8 times the rms of the joint's residual, 0.3 to 1 s long, on a joint,
   in a run and at a time while it moves, drawn anew for each seed. Told: an event whose rows hold
   rows of it. In time: a row of it is marked within 0.2 s of its first. Learned: versions that went
   live more than without it.
4. `twins/arm.toml` beside whole days of the embedded arm, 1,252 cycles each, no one near.
"""

from __future__ import annotations

import math
import os
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from evertwin import FitResult, RunResult, Twin
from evertwin.fold import Mark
from planted.twins import opened, with_values
from planted.worlds import record_arm
from proofs._verdict import ended, no_data
from proofs.ur10e import PAIR, files, fitted

GAIN = np.array([14.87, 13.26, 11.13, 10.62, 11.03, 11.47])
"""Torque of a joint per motor current [Nm/A]."""
ABOVE = 0.05
"""Speed from which a joint moves [rad/s]."""
LEAD, AFTER = 20.0, 4.0
"""Seconds of a run before and after its contact."""
DAY = 1252
"""Cycles of 69 s."""
Columns = Mapping[str, np.ndarray]


def beside(values: FitResult | None, **sections: Any) -> Twin:
    """The arm with the values of a fit, or as described."""
    if values is None:
        return opened("ur10e", **sections)
    return with_values("ur10e", values, **sections)


def pushes(known: FitResult) -> bool:
    """Part 1."""
    print("1. a person pushes the standing arm")
    told = []
    for file in files("push"):
        with with_values("ur10e", known) as twin:
            result = twin.run([file])
        found = result.of_kind("external")
        told.append(bool(found) and not result.of_kind("promoted"))
        for event in found:
            print(f"   {file.stem} row {event.row}: {event.reason}")
    return all(told) and len(told) == 2


def calm(known: FitResult) -> int:
    """Part 2: false events."""
    print("2. recordings without a load: events, seconds")
    false = 0
    runs = files("identification", "jointwise", "autumn")
    runs += [file for file in files("load_pair") if "unload" in file.stem]
    for name, values in (("tuned", known), ("description", None)):
        seconds, found = 0.0, 0
        for file in runs:
            with beside(values, **STILL) as twin:
                result = twin.run([file])
            seconds += _span(result)
            for event in result.of_kind("external"):
                print(f"   {name} {file.stem} row {event.row}: {event.reason}")
                found += 1
        print(f"   UR10e, {name}: {found} in {seconds:.0f} s of {len(runs)} recordings")
        false += found
    with opened("emps") as twin:
        result = twin.run()
    found = len(result.of_kind("external"))
    print(f"   EMPS: {found} in {_span(result):.0f} s")
    return false + found


STILL = {"anomaly": {"requirement": math.inf}}
"""The version stays the one that is asked about."""


def _span(result: RunResult) -> float:
    t = result.trace["t"]
    return float(t[-1] - t[0]) * 1e-9


def recorded(file: Path) -> dict[str, np.ndarray]:
    """Columns of a recording by name, torques in Nm."""
    rows = np.genfromtxt(file, delimiter=",")
    columns = {"t": rows[:, 0] - rows[0, 0]}
    for k in range(6):
        columns |= {f"q{k + 1}": rows[:, 1 + k], f"qd{k + 1}": rows[:, 7 + k]}
        columns[f"tau{k + 1}"] = GAIN[k] * rows[:, 13 + k]
    return columns


def sizes(known: FitResult, file: Path) -> np.ndarray:
    """Rms of each joint's residual while it moves, before any filter."""
    with with_values("ur10e", known, **STILL) as twin:
        trace = twin.run([file]).trace
    moving = np.abs(trace["input"][:, 6:12]) > ABOVE
    return np.sqrt(np.nanmean(np.where(moving, trace["residual"], np.nan) ** 2, axis=0))


def touched(
    columns: Columns, rms: np.ndarray, rng: np.random.Generator
) -> tuple[Columns, Columns, float, float]:
    """A stretch of a run without and with a contact; seconds at which it begins and ends."""
    joint = int(rng.integers(6))
    t, v = columns["t"], np.abs(columns[f"qd{joint + 1}"])
    moves = t[v > ABOVE]
    moves = moves[(moves > moves[0] + 4.0) & (moves < moves[-1] - 1.0)]
    start = float(rng.choice(moves))
    stop = start + float(rng.uniform(0.3, 1.0))
    level = float(rng.uniform(4.0, 8.0) * rms[joint] * rng.choice([-1, 1]))
    part = (t > start - LEAD) & (t < stop + AFTER)
    cut = {name: column[part] for name, column in columns.items()}
    inside = (cut["t"] >= start) & (cut["t"] <= stop)
    pushed = cut | {f"tau{joint + 1}": cut[f"tau{joint + 1}"] + level * inside}
    return cut, pushed, start - cut["t"][0], stop - cut["t"][0]


def contacts(known: FitResult, seeds: int) -> dict[str, bool]:
    """Part 3."""
    runs = [file for file in files("identification") if file.stem not in PAIR]
    told = in_time = learned = 0
    kept = {file: (recorded(file), sizes(known, file)) for file in runs}
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        columns, rms = kept[runs[int(rng.integers(len(runs)))]]
        cut, pushed, start, stop = touched(columns, rms, rng)
        results = []
        for data in (pushed, cut):
            with with_values("ur10e", known) as twin:
                results.append(twin.run(data))
        t = (results[0].trace["t"] - results[0].trace["t"][0]) * 1e-9
        inside = (t >= start) & (t <= stop)
        rows = np.flatnonzero(inside)
        told += any(
            event.evidence["first"] <= rows[-1]
            and (event.evidence["last"] < 0 or event.evidence["last"] >= rows[0])
            for event in results[0].of_kind("external")
        )
        marked = (results[0].trace["mark"] == Mark.EXTERNAL).any(axis=1)
        in_time += bool(marked[inside & (t <= start + 0.2)].any())
        learned += len(results[0].of_kind("promoted")) > len(results[1].of_kind("promoted"))
    print(
        f"3. contacts, {seeds} seeds: told {100 * told / seeds:.1f} %, marked within 0.2 s "
        f"{100 * in_time / seeds:.1f} %, versions that went live by them: {learned}"
    )
    return {"95 % of contacts": told >= 0.95 * seeds, "never tuned over": learned == 0}


def days(count: int) -> float:
    """Part 4: false events a day."""
    found = 0
    for day in range(count):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name) / "arm"
            record_arm(folder, "--cycles", str(DAY), "--seed", str(100 + day))
            with opened("arm") as twin:
                result = twin.run(sorted(folder.glob("cycle-*.csv")))
        found += len(result.of_kind("external"))
    print(f"4. the embedded arm: {found} events in {count} days")
    return found / max(count, 1)


def main(seeds: int, count: int) -> int:
    """Prints all parts."""
    if "EVERTWIN_DATA" not in os.environ:
        return no_data()
    known = fitted([file for file in files("identification") if file.stem in PAIR])
    demands = {"both pushes": pushes(known), "0 false on real recordings": calm(known) == 0}
    demands |= contacts(known, seeds)
    demands["at most one false event a day"] = days(count) <= 1.0
    return ended(demands)


if __name__ == "__main__":
    arguments = [int(one) for one in sys.argv[1:]]
    sys.exit(main(*(arguments + [100, 30][len(arguments) :])))
