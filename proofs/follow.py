"""An arm whose friction steps is followed: `python -m proofs.follow [SEEDS]`.

`twins/arm.toml` beside 14 cycles of 69 s of the embedded arm, recorded by its process. Somewhere in
the fifth cycle the Coulomb friction of one to three axes, drawn anew for each seed, rises by 10, 20
or 30 %: its torque is added to the recording. Counted are the cycles until the deviation of every
axis over the cycle that follows (moving rows, predicted by the version that was live) is below 5 %
again, and how often another version went live than was needed.
"""

from __future__ import annotations

import csv
import sys
import tempfile
from pathlib import Path

import numpy as np

from evertwin import Twin
from planted.worlds import record_arm
from proofs._verdict import ended

TWIN = "twins/arm.toml"
CYCLE, CYCLES = 690, 14
LIMIT = 0.05
FRICTION = np.array([12.0, 14.0, 10.0, 3.0, 3.0, 2.5])
"""Coulomb friction of the world [Nm]."""
WIDTH = 0.02
"""Of its tanh [rad/s]."""


def changed(folder: Path, seed: int) -> tuple[dict[str, np.ndarray], int]:
    """The recordings with a step in friction, as columns by name, and its row."""
    rng = np.random.default_rng(seed)
    rows: list[dict[str, str]] = []
    for path in sorted(folder.glob("cycle-*.csv")):
        with path.open() as file:
            rows += csv.DictReader(file)
    columns = {name.split(" ")[0]: np.array([float(r[name]) for r in rows]) for name in rows[0]}
    columns["t"] = np.arange(len(rows)) * 0.1
    at = 4 * CYCLE + int(rng.integers(CYCLE))
    axes = rng.choice(6, rng.integers(1, 4), replace=False)
    size = rng.choice([0.1, 0.2, 0.3])
    for k in axes:
        added = size * FRICTION[k] * np.tanh(columns[f"qd{k + 1}"] / WIDTH)
        columns[f"tau{k + 1}"] = columns[f"tau{k + 1}"] + added * (np.arange(len(rows)) >= at)
    return columns, at


def cycles(columns: dict[str, np.ndarray], at: int) -> tuple[float, int]:
    """Cycles until every axis is below the limit again (infinite: never), versions that went live
    after the step."""
    with Twin.open(TWIN) as twin:
        result = twin.run(columns)
    trace = result.trace
    moving = np.abs(trace["input"][:, 6:12]) > 0.05
    known = moving & np.isfinite(trace["residual"])
    sums = [
        np.cumsum(np.vstack([np.zeros(6), np.where(known, part, 0.0) ** 2]), axis=0)
        for part in (trace["residual"], trace["measured"])
    ]
    live = sum(e.kind == "promoted" and e.row > at for e in result.events)
    for row in range(at, len(moving) - CYCLE, 5):
        off, size = (total[row + CYCLE] - total[row] for total in sums)
        if np.sqrt(off / size).max() < LIMIT:
            return (row - at) / CYCLE, live
    return np.inf, live


def main(seeds: int) -> int:
    """All seeds on one recording."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "arm"
        record_arm(folder, "--cycles", str(CYCLES), "--seed", "3")
        found = [cycles(*changed(folder, seed)) for seed in range(seeds)]
    took = np.array([one for one, _ in found])
    print(
        f"cycles until every axis is below 5 % again, {seeds} seeds: median {np.median(took):.2f}"
    )
    late = np.quantile(took, 0.95, method="higher")
    print(f"95 % within {late:.2f}, the slowest {took.max():.2f}")
    print(f"versions that went live after the step: {np.mean([live for _, live in found]):.2f}")
    return ended({
        "median 2 cycles": bool(np.median(took) <= 2.0), "95 % within 3 cycles": bool(late <= 3.0),
    })  # fmt: skip


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 100))
