"""The welding arm tunes its own twin: `python -m proofs.arm [SEEDS]`.

The case of Aivaliotis, Arkouli, Georgoulias, Makris (2023) on the embedded arm: 69 s at 10 Hz, six
axes, Coulomb friction 50 % off, three cycles through `Twin.run`, all recorded by the arm's process.
Deviations are rms(measured − predicted) / rms(measured) over moving rows (|q̇| > 0.05 rad/s) of the
rows that the last champion had not seen.

1. Solved at once and by relaxed rounds: rounds needed, and the worst axis.
2. Weights: 24 cycles while friction grows by 0.05 % a cycle, tuned by rounds at each; single-axis
   simulations with equal weights and with the weights below, and the worst axis in any cycle.
3. The cost of a wrong law: friction with a Stribeck bump, sign in place of tanh.

`proofs.p2_crb` compares the scatter of the estimates with the Cramér-Rao bound.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from evertwin import RunResult, Twin
from evertwin.app.worlds import record_arm
from evertwin.config import TwinSpec, read
from evertwin.fold import Answer

TWIN = Path(__file__).parent.parent / "twins" / "arm.toml"
WEIGHTS = {"Fc1": 1.0, "Fc2": 0.5, "Fc3": 0.5, "Fc4": 0.5, "Fc5": 0.5, "Fc6": 0.5}
CYCLES = 24


def recorded(folder: Path, *options: str) -> list[str]:
    """Cycles written by the arm's process."""
    record_arm(folder, *options)
    return [str(path) for path in sorted(folder.glob("*.csv"))]


def run(spec: TwinSpec, files: Sequence[str]) -> tuple[RunResult, list[Any]]:
    """The result, and the contents of the answers."""
    twin = Twin(spec)
    result = twin.run(files)
    return result, [r.content for r in twin.store.read("answer") if isinstance(r, Answer)]


def worst(result: RunResult) -> float:
    """Largest deviation of an axis over moving rows, %."""
    return 100 * max(f.relative_rms_moving_after for f in result.outputs.values())


def tuned(spec: TwinSpec, folder: Path, seeds: int) -> bool:
    """Solved at once, and by rounds."""
    good = True
    for method in ("auto", "iteration"):
        rounds, deviation = [], []
        for seed in range(1, seeds + 1):
            files = recorded(folder / str(seed), "--cycles", "3", "--seed", str(seed))
            chosen = replace(spec, tuning=replace(spec.tuning, method=method))
            result, answers = run(chosen, files)
            rounds.append(answers[0]["fit"]["iterations"])
            deviation.append(worst(result))
        low, high = min(rounds), max(rounds)
        print(
            f"{method:10} rounds {np.median(rounds):.0f} ({low} to {high}), worst axis "
            f"{np.median(deviation):.2f} % (median), {max(deviation):.2f} % (largest of {seeds})"
        )
        good &= max(deviation) < 5.0
    return good


def per_cycle(result: RunResult) -> np.ndarray:
    """Deviation of each axis over the moving rows of each cycle, by the twin as it was then."""
    trace: Any = result.trace
    speed = np.abs(trace["input"][:, 6:12]) > 0.05
    found = []
    for task in np.unique(trace["task"]):
        rows = (trace["task"] == task)[:, None] & speed & np.isfinite(trace["residual"])
        r, y = (np.where(rows, trace[name], 0.0) for name in ("residual", "measured"))
        found.append(np.sqrt((r**2).sum(axis=0) / (y**2).sum(axis=0)))
    return np.array(found)


def weighted(spec: TwinSpec, folder: Path) -> bool:
    """Fewer single-axis simulations by weights."""
    files = recorded(folder / "wear", "--cycles", str(CYCLES), "--growth", "0.0005")
    counts, good = [], True
    for name, weights in (("equal", {}), ("weights", WEIGHTS)):
        tuning = replace(spec.tuning, method="iteration", weights=weights, every=60.0)
        result, answers = run(replace(spec, tuning=tuning), files)
        tunings = [a for a in answers if a.get("fit")]
        counts.append(sum(a["simulations"] for a in tunings))
        # the first two cycles start 50 % off
        largest = 100 * per_cycle(result)[3:].max()
        good &= largest < 5.0
        print(
            f"{name:10} {len(tunings)} tunings, {counts[-1]} single-axis simulations, worst axis "
            f"of any later cycle {largest:.2f} %"
        )
    saved = 1 - counts[1] / counts[0]
    print(f"weights {WEIGHTS}: {100 * saved:.0f} % fewer simulations")
    return good and saved >= 0.3


def wrong(spec: TwinSpec, folder: Path) -> None:
    """What a wrong friction law costs."""
    plain = recorded(folder / "plain", "--cycles", "3")
    bump = recorded(folder / "bump", "--cycles", "3", "--stribeck", "0.3")
    sign = {"urdf": "ur5_like", "law": "sign"}
    kept = {k: v for k, v in spec.model.parameters.items() if not k.startswith("width")}
    signed = replace(spec, model=replace(spec.model, options=sign, parameters=kept))
    for name, chosen, files in (
        ("tanh on tanh", spec, plain), ("sign on tanh", signed, plain),
        ("tanh on tanh + Stribeck", spec, bump),
    ):  # fmt: skip
        result, _ = run(chosen, files)
        figures = [100 * f.relative_rms_moving_after for f in result.outputs.values()]
        shown = " ".join(f"{v:5.2f}" for v in figures)
        print(f"{name:24} moving deviation per axis {shown} %")


def main() -> int:
    """Prints the figures; exit code 1 if an axis stays outside 5 % or weights save under 30 %."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    spec = read(TWIN)
    with tempfile.TemporaryDirectory() as folder:
        good = tuned(spec, Path(folder), seeds)
        good &= weighted(spec, Path(folder))
        wrong(spec, Path(folder))
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
