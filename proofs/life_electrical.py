"""What a model of the electrical side does for life: `python -m proofs.life_electrical [SEEDS]`.

Aivaliotis, Arkouli, Georgoulias, Makris (2023) name electrical components as future work. Here the
joint of `twins/joint.toml` wears: the Coulomb friction of its gearbox grows, linear in runs, to
twice its value when new. Measured is the motor's voltage (noise 1 % of its rms); its winding is 0
to 40 K warmer than the data sheet's, at random from run to run and more so as production rises.
Copper gains 0.39 % of resistance a kelvin. `Twin.fit` tunes the friction at each of 60 runs:

* mechanical: torque of the motor taken as k·U/R, as if there were no back-EMF;
* electrical: U = R·i + k·ω with the data sheet's R;
* electrical, warm: R at the winding's measured temperature (known to 2 K).

`Twin.life` is asked at 50 and 70 % of life: is the true life inside the intervals, and how far is
the median off? The dummy knows only the mean life.
"""

from __future__ import annotations

import sys

import numpy as np

from evertwin.prognosis.laws import Life
from planted.histories import Told, until
from planted.joints import COPPER, joint, measured, motion
from proofs._verdict import chance, ended, holds

NEW, RUNS, K, R = 9.0, 60, 0.12, 0.8
TWINS = ("mechanical", "electrical", "electrical, warm")


def series(seed: int) -> tuple[np.ndarray, float]:
    """Friction that each twin finds at each run, (runs, 3), and the true life [runs]."""
    rng = np.random.default_rng([12, seed])
    life = float(rng.uniform(65.0, 85.0))
    t, u = motion(20.0)
    found = np.empty((RUNS, 3))
    with joint(measure="torque") as mechanical, joint(measure="voltage") as sheet:
        for run in range(RUNS):
            above = float(np.clip(rng.normal(10.0 + 15.0 * run / RUNS, 6.0), 0.0, 40.0))
            worn = NEW * (1.0 + (run + 1) / life)
            hot, known = (
                R * (1.0 + COPPER * kelvin) for kelvin in (above, above + rng.normal(0.0, 2.0))
            )
            with joint({"gearbox.Fc": worn, "motor.R": hot}, "voltage") as truth:
                rows = measured(truth, t, u, np.zeros(len(t)))
            size = 0.01 * np.sqrt(np.mean(rows["U1"] ** 2))
            rows["U1"] += size * rng.standard_normal(len(t))
            torque = {**rows, "m1": K * rows["U1"] / R}
            with joint({"motor.R": known}, "voltage") as warm:
                seen = zip((mechanical, sheet, warm), (torque, rows, rows), strict=True)
                found[run] = [twin.fit(columns).fit["gearbox.Fc"] for twin, columns in seen]
    return found, life


def main() -> int:
    """Prints the counts; exit code 1 unless the electrical side makes lives better."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    cases = [series(seed) for seed in range(seeds)]
    mean = float(np.mean([life for _, life in cases]))
    at, errors = np.arange(1.0, RUNS + 1.0), dict[tuple[float, str], float]()
    demands: dict[str, bool] = {}
    for cut in (0.5, 0.7):
        for k, name in enumerate(TWINS):
            inside, off, dummy, lives = [0, 0], [], [], 0
            with Told(limit=2.0 * NEW) as told:
                for values, life in cases:
                    stop = int(cut * life)
                    whole = {"cycle": at, "wear": values[:, k]}
                    answer = told.life(until(whole, float(stop)))
                    if not isinstance(answer, Life):
                        continue
                    lives, left = lives + 1, life - stop
                    for j, (low, high) in enumerate((answer.interval80, answer.interval95)):
                        inside[j] += low <= left <= high
                    off.append(abs(answer.median - left))
                    dummy.append(abs(max(mean - stop, 0.0) - left))
            errors[cut, name] = float(np.median(off)) if off else np.inf
            print(
                f"{100 * cut:.0f} % of life, {name:16}: answered {lives} of {seeds}, true inside "
                f"80 % in {inside[0]}, inside 95 % in {inside[1]}; median |error| "
                f"{errors[cut, name]:.1f} runs, dummy {np.median(dummy) if dummy else np.nan:.1f}"
            )
            if name == TWINS[-1]:
                said = f"{name} at {cut:.0%}"
                best = min(errors[cut, TWINS[0]], float(np.median(dummy)) if dummy else np.inf)
                demands[f"{said}: nearer than {TWINS[0]} and dummy"] = errors[cut, name] < best
                for level, held in zip((0.80, 0.95), inside, strict=True):
                    good = lives > 0 and holds(level, held / lives, chance(level, lives))
                    demands[f"{said}: intervals of {level:.0%}"] = good
    return ended(demands)


if __name__ == "__main__":
    sys.exit(main())
