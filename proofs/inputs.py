"""Contradicting inputs and frozen torques of a real arm: `python -m proofs.inputs [SEEDS]`.

Needs EVERTWIN_DATA. `twins/ur10e.toml`, tuned on the 30 s run of 10 February and the 50 s run of 12
February (`Twin.fit`), then beside other recordings as shipped (`Twin.run`):

1. Every recording as it is: events about a frozen torque, or a position and a speed that contradict
   each other, are false.
2. From the middle of a run on one channel of one joint is wrong, drawn anew for each seed. Told: an
   event about the joint's position or speed (or its torque) while it is wrong; learned: versions
   that went live more than without it; taken for something outside: events `external` after it.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Callable, Mapping

import numpy as np

from evertwin import FitResult, RunResult
from evertwin.fold import Event
from planted.twins import with_values
from proofs._verdict import ended, no_data
from proofs.external import recorded
from proofs.ur10e import PAIR, files, fitted

Fault = tuple[str, Callable[[np.ndarray], np.ndarray]]
FAULTS: Mapping[str, Fault] = {
    "speed, sign turned": ("qd", lambda x: -x),
    "speed in degrees": ("qd", lambda x: np.degrees(x)),
    "speed a thousandth": ("qd", lambda x: 0.001 * x),
    "speed zero": ("qd", np.zeros_like),
    "speed held": ("qd", lambda x: np.full_like(x, x[0])),
    "position held": ("q", lambda x: np.full_like(x, x[0])),
    "torque held": ("tau", lambda x: np.full_like(x, x[0])),
}
CAUSES = ("kinematics", "frozen")
"""What is asked about; broken messages of the controller are out of range, and are true."""


def errors(result: RunResult) -> list[Event]:
    """Events of this kind."""
    found = result.of_kind("measurement_error")
    return [e for e in found if e.evidence.get("cause") in CAUSES]


def calm(known: FitResult) -> int:
    """Part 1: false events."""
    found, seconds = 0, 0.0
    for file in files("identification", "jointwise", "autumn", "load_pair"):
        with with_values("ur10e", known) as twin:
            result = twin.run([file])
        t = result.trace["t"]
        seconds += float(t[-1] - t[0]) * 1e-9
        for event in errors(result):
            found += 1
            print(f"   {file.stem} row {event.row}: {event.signal}: {event.reason}")
    print(f"1. real recordings: {found} events in {seconds:.0f} s")
    return found


def wrong(known: FitResult, seeds: int) -> dict[str, bool]:
    """Part 2."""
    runs = [recorded(file) for file in files("identification") if file.stem not in PAIR]
    told, tried, outside, late = Counter[str](), Counter[str](), Counter[str](), list[float]()
    learned = 0
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        columns, joint = runs[int(rng.integers(len(runs)))], int(rng.integers(1, 7))
        name = list(FAULTS)[seed % len(FAULTS)]
        channel, change = FAULTS[name]
        half = len(columns["t"]) // 2
        values = columns[f"{channel}{joint}"].copy()
        values[half:] = change(values[half:])
        results = []
        for data in (dict(columns) | {f"{channel}{joint}": values}, columns):
            with with_values("ur10e", known) as twin:
                results.append(twin.run(data))
        begins = float(columns["t"][half] - columns["t"][0])
        about = {f"{part}{joint}" for part in (("tau",) if channel == "tau" else ("q", "qd"))}
        span = [(e.time - results[0].trace["t"][0]) * 1e-9 for e in errors(results[0])
                if e.signal in about]  # fmt: skip
        first = float(results[0].trace["t"][0]) * 1e-9 - float(columns["t"][0])
        after = [t + first - begins for t in span if t + first > begins]
        tried[name] += 1
        told[name] += bool(after)
        late += after[:1]
        outside[name] += sum(
            e.time * 1e-9 - float(columns["t"][0]) > begins for e in results[0].of_kind("external")
        )
        learned += len(results[0].of_kind("promoted")) > len(results[1].of_kind("promoted"))
    print(f"2. one channel wrong from the middle on, {seeds} seeds")
    for name, count in tried.items():
        print(f"   {name:20} told {told[name]:3d} of {count:3d}, external {outside[name]}")
    share = sum(told.values()) / seeds
    print(
        f"   told {100 * share:.1f} %, after {np.median(late):.1f} s (median), "
        f"{np.quantile(late, 0.95):.1f} s (95 %); versions that went live by them: {learned}"
    )
    return {"95 % told": share >= 0.95, "never tuned over": learned == 0}


def main(seeds: int) -> int:
    """Prints both parts."""
    if "EVERTWIN_DATA" not in os.environ:
        return no_data()
    known = fitted([file for file in files("identification") if file.stem in PAIR])
    demands = {"0 false on real recordings": calm(known) == 0}
    return ended(demands | wrong(known, seeds))


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 105))
