"""What a model of the electrical side does for life: `python -m proofs.life_electrical [SEEDS]`.

Aivaliotis, Arkouli, Georgoulias, Makris (2023) name electrical components as future work. Here a
feed axis wears: the Coulomb friction of its ballscrew grows, linear in runs, to twice its value
when new. Measured is the motor's voltage (noise 1 % of its rms); its winding is 0 to 40 K warmer
than the data sheet's, at random from run to run and more so as production rises. Copper gains
0.39 % of resistance a kelvin. Friction is tuned at each of 60 runs by three twins:

* mechanical: effort taken in proportion to the voltage, k·U/R, as if there were no back-EMF;
* electrical: U = R·i + k·ω with the data sheet's R;
* electrical and warm: R at the winding's measured temperature (known to 2 K).

Asked at 50 and 70 % of life, all with the same laws: is the true life inside the intervals, and how
far is the median off? The dummy knows only the mean life.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from evertwin.machines.assembly import assembly
from evertwin.prognosis.laws import Indicator, Life, Limit, predict_life
from proofs._verdict import chance, ended, holds

COPPER = 0.0039
"""Rise of resistance [1/K]."""
NEW, RUNS = 120.0, 60
AXIS: list[dict[str, Any]] = [
    {"name": "motor", "kind": "motor", "axis": 1, "k": 0.1, "R": 2.0, "J": 1e-4},
    {"name": "screw", "kind": "ballscrew", "axis": 1, "lead": 0.005, "Fc": NEW, "Fv": 400.0},
    {"name": "table", "kind": "mass", "axis": 1, "mass": 80.0},
]
TWINS = ("mechanical", "electrical", "electrical, warm")


def named(model: Any, name: str) -> int:
    """Column of a parameter, whatever the assembly calls it."""
    found = [k for k, one in enumerate(model.parameters.names) if name in one]
    if len(found) != 1:
        raise LookupError(f"{name}: {model.parameters.names}")
    return found[0]


def motion() -> tuple[np.ndarray, np.ndarray]:
    """A motion to and fro: speed and acceleration, and the rows' length."""
    t = np.arange(0.0, 20.0, 0.05)
    v = 0.03 * np.cos(0.8 * t + 0.3 * np.sin(0.3 * t))
    return np.stack([v, np.gradient(v, t)], axis=1), np.full(len(t), 0.05)


def friction(model: Any, u: np.ndarray, dt: np.ndarray, p: np.ndarray, y: np.ndarray) -> float:
    """Coulomb friction of the screw from one run's rows, with viscous friction, solved at once."""
    y0, phi = model.regressor(np.zeros(0), u, dt, p)
    dense = np.zeros((len(u), len(p)))
    for m, place in enumerate(model.columns[0]):
        if place >= 0:
            dense[:, place] += phi[:, 0, m]
    free = [named(model, "Fc"), named(model, "Fv")]
    fixed = p.copy()
    fixed[free] = 0.0
    found = np.linalg.lstsq(dense[:, free], y - y0[:, 0] - dense @ fixed, rcond=None)[0]
    return float(found[0])


def series(seed: int) -> tuple[np.ndarray, float]:
    """Friction that each twin finds at each run, (runs, 3), and the true life [runs]."""
    rng = np.random.default_rng([12, seed])
    life = float(rng.uniform(65.0, 85.0))
    voltage, torque = assembly(AXIS, measure="voltage"), assembly(AXIS, measure="torque")
    u, dt = motion()
    r, fc = named(voltage, "motor.R"), named(voltage, "screw.Fc")
    found = np.empty((RUNS, 3))
    for run in range(RUNS):
        warm = float(np.clip(rng.normal(10.0 + 15.0 * run / RUNS, 6.0), 0.0, 40.0))
        true = voltage.parameters.values
        true[fc] = NEW * (1.0 + (run + 1) / life)
        true[r] *= 1.0 + COPPER * warm
        _, y = voltage.simulate(np.zeros(0), u, dt, true)
        noise = 0.01 * np.sqrt(np.mean(y[:, 0] ** 2))
        seen = y[:, 0] + noise * rng.standard_normal(len(u))
        sheet = voltage.parameters.values
        known = sheet.copy()
        known[r] *= 1.0 + COPPER * (warm + rng.normal(0.0, 2.0))
        k, resistance = 0.1, float(sheet[r])
        found[run] = (
            friction(torque, u, dt, torque.parameters.values, k * seen / resistance),
            friction(voltage, u, dt, sheet, seen),
            friction(voltage, u, dt, known, seen),
        )
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
            for values, life in cases:
                stop = int(cut * life)
                known = Indicator.of(
                    "Fc", "N", Limit(2.0 * NEW), at[:stop], values[:stop, k]
                )  # fmt: skip
                answer = predict_life(known)
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
                told = f"{name} at {cut:.0%}"
                best = min(errors[cut, TWINS[0]], float(np.median(dummy)) if dummy else np.inf)
                demands[f"{told}: nearer than {TWINS[0]} and dummy"] = errors[cut, name] < best
                for level, held in zip((0.80, 0.95), inside, strict=True):
                    good = lives > 0 and holds(level, held / lives, chance(level, lives))
                    demands[f"{told}: intervals of {level:.0%}"] = good
    return ended(demands)


if __name__ == "__main__":
    sys.exit(main())
