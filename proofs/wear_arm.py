"""The embedded arm wears until its gearbox is replaced: `python -m proofs.wear_arm`.

The arm's process records a welding cycle a day; Coulomb friction of every axis grows by 1 % of its
value when new a cycle. The twin runs over each recording, tunes, and keeps its parameter history in
its store; `Twin.life` is asked after some of them. The limit of axis 1 is 30 % more friction, which
it passes after cycle 31. Axis 2's limit is where its torque differs by 4 Nm (rms) from that of a
new arm, computed with the twin. After 28 cycles the gearboxes are replaced: the same wear begins
again. The dummy knows only the mean life of arms that wear by 0.5 to 1.5 % a cycle. A life is
counted in whole cycles: the interval reaches to the next whole number.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

from evertwin import Twin
from evertwin.config import spec
from evertwin.prognosis.laws import Life
from evertwin.prognosis.outlook.lives import ComponentLife, Lives
from planted.twins import opened
from planted.worlds import record_arm
from proofs._verdict import ended

GROWTH = 0.01
NEW = (12.0, 14.0)
"""True Coulomb friction of axes 1 and 2 when new [Nm]."""
LIMIT = 1.3 * NEW[0]
END = {"gearbox1": 0.3 / GROWTH + 1.0}
"""Cycle after which the limit is passed: cycle n runs with the growth of n − 1 cycles."""
ASKED = (3, 8, 12, 16, 20, 24, 28)
MEAN = float(np.mean(0.3 / np.linspace(0.005, 0.015, 201))) + 1.0


def twin() -> Twin:
    """The arm's twin, tuned at each cycle."""
    indicators = (
        spec.IndicatorSpec("Fc1", component="gearbox1", parameter="Fc1", limit=LIMIT),
        spec.IndicatorSpec(
            "Fc2", component="gearbox2", parameter="Fc2",
            accuracy=spec.AccuracySpec("tau2", tolerance=4.0),
        ),
    )  # fmt: skip
    return opened("arm", tuning={"every": 60.0}, indicator=indicators)


def said(one: ComponentLife, cycles: int, true: float) -> tuple[bool, float, float]:
    """Prints one answer: (is the truth inside 80 %, width of it, |error| of the dummy)."""
    left, dummy = true - cycles, max(MEAN - cycles, 0.0)
    if not isinstance(one.life, Life):
        print(f"  {cycles:3d} cycles  {one.component}: {one.sentence} (true {left:.1f})")
        return True, np.inf, abs(dummy - left)
    low, high = one.life.interval80
    wide = one.life.interval95
    inside = np.floor(wide[0]) <= left <= np.ceil(wide[1])  # a life is whole cycles
    print(
        f"  {cycles:3d} cycles  {one.component}: {one.life.median:5.1f} left (80 % {low:.1f} … "
        f"{high:.1f}; 95 % {wide[0]:.1f} … {wide[1]:.1f}), true {left:.1f}, dummy {dummy:.1f}"
    )
    return inside, high - low, abs(dummy - left)


def one_life(arm: Twin, files: list[str], start: int) -> list[tuple[bool, float, float]]:
    """Runs the arm's recordings; answers at the asked cycles."""
    found = []
    for cycle, name in enumerate(files, start=1):
        arm.run([name])
        if cycle in ASKED:
            lives: Lives = arm.life(data=[name])
            found.append(said(lives.components["gearbox1"], cycle, END["gearbox1"]))
            other = lives.components["gearbox2"]
            limit = other.indicator.limit.value
            if start == 0:
                said(other, cycle, (limit / NEW[1] - 1.0) / GROWTH + 1.0)
    return found


def main() -> int:
    """Prints the answers; exit code 1 unless life narrows around the truth and resets."""
    with tempfile.TemporaryDirectory() as folder:
        worn = []
        for seed, cycles in ((1, 28), (2, 16)):
            out = Path(folder) / str(seed)
            record_arm(out, "--cycles", str(cycles), "--growth", str(GROWTH), "--seed", str(seed))
            worn.append([str(path) for path in sorted(out.glob("*.csv"))])
        arm = twin()
        print(f"first life, limit {LIMIT:.1f} Nm, passed after {END['gearbox1']:.0f} cycles:")
        first = one_life(arm, worn[0], 0)
        before = arm.life(data=worn[0][-1:]).components["gearbox1"]
        for name in ("gearbox1", "gearbox2"):
            arm.maintained(name, "gearbox replaced")
        after = arm.life(data=worn[0][-1:]).components["gearbox1"]
        print(f"gearbox replaced: {before.sentence}\n   -> {after.sentence}")
        print("second life:")
        second = one_life(arm, worn[1], len(worn[0]))
    told = [item for item in first if np.isfinite(item[1])]
    widths = [width for _, width, _ in told]
    inside = sum(item[0] for item in told)
    print(
        f"first life: truth inside 95 % in {inside} of {len(told)} answers; width of 80 % "
        f"{widths[0]:.1f} -> {widths[-1]:.1f} cycles; mean |error| of the dummy "
        f"{np.mean([item[2] for item in told]):.1f} cycles"
    )
    reset = not isinstance(after.life, Life) and isinstance(before.life, Life)
    again = [item for item in second if np.isfinite(item[1])]
    print(f"after the replacement: reset {reset}; answered again in {len(again)} of {len(second)}")
    return ended({
        "first life: truth inside 95 %": inside == len(told),
        "narrows to a quarter": widths[-1] < 0.25 * widths[0],
        "reset by the replacement": reset,
        "second life: answered, truth inside 95 %": bool(again) and all(x[0] for x in again),
    })  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
