"""The heated box: `python -m proofs.incubator` (needs EVERTWIN_DATA).

1. March 2021 before the first lid event: learned on the first half, judged on the second.
2. September 2020 (the 24 V folder) predicts March 2021 before the first lid event.
   In both the software chooses the extra state; unmeasured temperatures at the start belong to a
   recording and are fitted to each test.
3. The lid's detector, calibrated on September 2020 alone: openings found, delays, false alarms in
   the calm parts (outside of an open lid and the 15 min after it).
"""

from __future__ import annotations

import csv
import os
import sys
from pathlib import Path

import numpy as np

from evertwin import FitResult
from planted.score import Score, score
from planted.twins import opened

SETTLED = 900 * 10**9
FIRST, SECOND, BEFORE = ":1026", "1026:2052", ":2052"


def folder() -> Path:
    """The recordings."""
    return Path(os.environ["EVERTWIN_DATA"]) / "incubator"


def september() -> Path:
    """The calm recording of 2020."""
    return folder() / "20200918_calibration_fan_24V" / "semi_random_movement.csv"


def march() -> Path:
    """The recording with lid openings."""
    name = "lid_opening_experiment_mar_2021.csv"
    return folder() / "20210321_lid_opening_7pmodel" / name


def fitted(train: str, test: str) -> FitResult:
    """A fit of the box, predicted over each whole recording."""
    with opened("incubator", prediction={"horizon": np.inf}) as twin:
        return twin.fit([train], [test])


def told(said: str, result: FitResult, limit: float) -> bool:
    """Prints a fit; is it within the limit?"""
    error = result.test[0].rms
    print(f"   {said}: {error:.4f} K (limit {limit}), train {result.train[0].rms:.4f} K")
    terms = [(term.kind, term.channel) for term in result.form.terms]
    print(f"      form: {terms}; held-out deviation {result.search['before']:.3f} -> "
          f"{result.search['after']:.3f}; tuned {result.search.get('tuned')}")  # fmt: skip
    print(f"      fitted to the test: {result.starts[0]}")
    return error <= limit and ("state", "box") in terms


def lid() -> Score:
    """The detector's figures on March."""
    with opened("incubator_lid") as twin:
        result = twin.run([september(), march()])
    with (march().parent / "events.csv").open(encoding="utf-8") as file:
        records = [(int(r["time"]), r["code"]) for r in csv.DictReader(file)]
    opens = np.array([t for t, code in records if code == "lid_open"])
    closes = np.array([t for t, code in records if code == "lid_close"])
    with march().open(encoding="utf-8") as file:
        stamps = [int(r["time"]) for r in csv.DictReader(file)]
    edges = [stamps[0], *np.column_stack([opens, closes + SETTLED]).ravel().tolist(), stamps[-1]]
    calm = [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b > a]
    alarms = [e.time for e in result.events if e.kind == "suspected"]
    return score(np.array(alarms, dtype=np.int64), opens, closes, calm)


def main() -> int:
    """Prints all parts; 1 if a figure is missed."""
    if "EVERTWIN_DATA" not in os.environ:
        print("EVERTWIN_DATA is not set: expected the folder of real recordings")
        return 4
    print("1. and 2. the box, free runs")
    good = [
        told("March, first half -> second half", fitted(f"{march()}@{FIRST}",
             f"{march()}@{SECOND}"), 0.06),
        told("September 2020 -> March 2021", fitted(str(september()), f"{march()}@{BEFORE}"), 0.25),
    ]  # fmt: skip
    found = lid()
    print("3. the lid")
    print(f"   found {found.found} of {found.events}, after "
          f"{', '.join(f'{d:.0f}' for d in found.delays)} s; {found.false_alarms} false alarms in "
          f"{found.calm_hours:.1f} h of calm")  # fmt: skip
    good.append(found.found == found.events and max(found.delays) <= 15.0)
    good.append(found.false_alarms <= 1)
    print("all reached" if all(good) else "MISSED")
    return 0 if all(good) else 1


if __name__ == "__main__":
    sys.exit(main())
