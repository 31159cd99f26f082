"""Two real machines run towards their end: `python -m proofs.series` (needs EVERTWIN_DATA).

`Twin.life` on `twins/wear.toml`. Every answer uses what was known at its moment, nothing later.

1. `battery`: capacity per cycle of two lithium-ion cells, limit 1.4 Ah, at 50, 70 and 90 % of the
   record's part before the end (B0005 falls below after cycle 124, B0007 never within 168 cycles).
   On all its cycles B0005 must be said to have passed its limit at cycle 125.
   The dummy knows only the other cell's life (B0007's is taken as its record).
2. `bearing_ims2`: mean |acceleration| of bearing 1 every ten minutes until its outer race failed.
   Asked every hour: is it "not enough data" before the onset, when does the warning come, and what
   is said of the life after it: its 80 % intervals must hold the truth in 75 % of the answers, its
   95 % intervals in 92 %. The limit is three times the median of the first day. The dummy
   warns when the mean life is half over; with one machine the mean life is the life itself.
"""

from __future__ import annotations

import csv
import os
import sys
from pathlib import Path

import numpy as np

from evertwin.prognosis.laws import Life
from planted.histories import Columns, Told, until
from proofs._verdict import ended, no_data

CUTS = (0.5, 0.7, 0.9)
END = {"B0005": 124, "B0007": 168}
LEAST = (0.75, 0.92)
"""Share of the answers whose 80 % and 95 % intervals must hold the truth."""
DAY = 144
"""Rows of a day at one in ten minutes."""


def rows(name: str) -> list[dict[str, str]]:
    """The rows of a recording."""
    with (Path(os.environ["EVERTWIN_DATA"]) / name).open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def cells() -> dict[str, Columns]:
    """Capacity per cycle of each cell."""
    every = rows("battery/capacity.csv")
    found = {}
    for name in END:
        capacity = np.array([float(r["capacity_Ah"]) for r in every if r["battery"] == name])
        found[name] = {"cycle": np.arange(1.0, len(capacity) + 1.0), "wear": capacity}
    return found


def battery() -> dict[str, bool]:
    """Both cells at each cut, and B0007 at every fourth cycle."""
    with Told(limit=1.4, direction="below") as twin:
        return asked(twin)


def asked(twin: Told) -> dict[str, bool]:
    """What is said of the cells."""
    good = True
    for name, known in cells().items():
        other = next(end for cell, end in END.items() if cell != name)
        for cut in CUTS:
            now = float(np.floor(cut * END[name]))
            life = twin.life(until(known, now))
            true, dummy = END[name] - now, max(other - now, 0.0)
            if not isinstance(life, Life):
                print(f"{name} {100 * cut:.0f} %: {life.verdict}, needs {life.needs}")
                good = False
                continue
            low, high = life.interval80
            ends = f"95 % {life.interval95[0]:.0f} … {life.interval95[1]:.0f}"
            shown = f"true {true:.0f}" if name == "B0005" else f"true more than {true:.0f}"
            print(
                f"{name} {100 * cut:.0f} %: {life.median:.0f} cycles left (80 % {low:.0f} … "
                f"{high:.0f}; {ends}), {shown}, dummy {dummy:.0f}"
            )
            if name == "B0005":
                good &= life.interval95[0] <= true <= life.interval95[1]
            else:
                good &= life.interval95[1] >= true
    known = cells()["B0007"]
    moments = range(20, 169, 4)
    answers = [twin.life(until(known, float(m))) for m in moments]
    failed = sum(isinstance(a, Life) and a.median <= 0.0 for a in answers)
    dummy = sum(m > END["B0005"] for m in moments)
    print(f"B0007 called failed in {failed} of {len(answers)} answers (dummy: {dummy})")
    last = twin.life(cells()["B0005"])
    passed = isinstance(last, Life) and last.passed
    print(
        f"B0005 on all its cycles: limit passed at cycle {passed or '-'}, true {END['B0005'] + 1}"
    )
    return {
        "95 % intervals of the cells": good, "B0007 is not called failed": failed == 0,
        "B0005 passed its limit": passed == END["B0005"] + 1,
    }  # fmt: skip


def bearing() -> dict[str, bool]:
    """Bearing 1, asked every hour."""
    table = rows("bearing_ims2/2nd_test_resmaple_10minutes.csv")
    value = np.array([float(r["Bearing 1"]) for r in table])
    running = np.flatnonzero(value > 0.01)  # the last rows were taken after the rig had stopped
    value = value[: running[-1] + 1]
    hours = np.arange(len(value)) / 6.0
    limit = 3.0 * float(np.median(value[:DAY]))
    with Told(clock="h", limit=limit) as twin:
        return hourly(twin, {"h": hours, "wear": value}, limit)


def hourly(twin: Told, known: Columns, limit: float) -> dict[str, bool]:
    """What is said of the bearing, hour by hour."""
    hours, value = known.values()
    end, stopped = float(hours[np.argmax(value > limit)]), float(hours[-1])
    warned = None
    before, lives, inside = 0, 0, [0, 0]
    for now in np.arange(6.0, end, 1.0):
        answer = twin.life(until(known, float(now), "h"))
        if answer.onset is not None and warned is None:
            warned = float(now)
            print(
                f"bearing: warning at {now:.0f} h, {stopped - now:.0f} h before the end and "
                f"{end - now:.0f} h before the limit; wear is said to have begun at "
                f"{answer.onset.begin:.1f} h"
            )
        if warned is None:
            before += isinstance(answer, Life)
        elif isinstance(answer, Life):
            lives += 1
            pairs = enumerate((answer.interval80, answer.interval95))
            for k, (low, high) in pairs:
                inside[k] += low <= end - now <= high
            if lives % 12 == 1:
                print(
                    f"  {now:5.0f} h: {answer.median:6.1f} h left (80 % {answer.interval80[0]:.1f}"
                    f" … {answer.interval80[1]:.1f}), true {end - now:.1f}"
                )
    print(
        f"bearing: {before} lives told before the warning; {lives} after it, true inside 80 % in "
        f"{inside[0]}, inside 95 % in {inside[1]}; dummy warns {stopped / 2:.0f} h before the end"
    )
    # Neighbouring answers share nearly all their values, so their count has no binomial spread:
    # the intervals may hold more than they say, not less.
    return {
        "no life before the warning": before == 0,
        "warned 24 h before the end": warned is not None and stopped - warned >= 24.0,
        "80 % intervals of the bearing": 0 < LEAST[0] * lives <= inside[0],
        "95 % intervals of the bearing": 0 < LEAST[1] * lives <= inside[1],
    }


def main() -> int:
    """Prints both; exit code 1 if a demand is missed."""
    if "EVERTWIN_DATA" not in os.environ:
        return no_data()
    return ended(battery() | bearing())


if __name__ == "__main__":
    sys.exit(main())
