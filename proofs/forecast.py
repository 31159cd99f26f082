"""Whether the bands of a forecast hold what they say: `python -m proofs.forecast [SEEDS]`.

`Twin.run` and `Twin.forecast` on `twins/robot1d.toml`: a cart drives 8 % faster than its model,
with noise of process and sensor. The twin sees 340 rows, tunes its gain, and foretells the next 60
under the commands that follow. Rows of one run share their noise, so each run counts once: the
share of its rows inside, with the spread over runs. Beside it a dummy: the last position and the
spread of past moves over the same time.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

from evertwin.config.spec import Span
from planted.twins import opened, planned
from proofs._verdict import ended, holds

KNOWN, AHEAD = 340, 60
LEVELS = (0.8, 0.95)
DUMMY = (1.2816, 1.96)


SETTINGS = {
    "arbiter": {"use": "none"},
    "anomaly": {"window": Span(100), "requirement": 0.02},
    "prediction": {"horizon": 5.0},
    "tuning": {"window": Span(6000)},
    "correction": {"channels": ()},
    "beat": Span(20),
}
"""The gain alone is tuned; 2 cm over 5 s are asked, of which noise makes 1.2."""


def world(seed: int) -> dict[str, np.ndarray]:
    """Time, command and position of one run."""
    rng, rows = np.random.default_rng([11, seed]), KNOWN + AHEAD
    v = np.repeat(rng.uniform(0.0, 0.2, rows // 5), 5)
    driven = 1.08 * v + rng.normal(0.0, 0.005, rows)
    x = np.r_[0.0, np.cumsum(driven[1:])] + rng.normal(0.0, 0.003, rows)
    return {"t": np.arange(float(rows)), "v": np.r_[v[1:], v[-1:]], "x": x}


def one_run(seed: int) -> np.ndarray:
    """(inside, half width in m, dummy inside, dummy half width) by level, (2, 4)."""
    table = world(seed)
    known = {name: column[:KNOWN] for name, column in table.items()}
    u = table["v"][KNOWN - 1 : -1, None]
    with opened("robot1d", **SETTINGS) as twin, tempfile.TemporaryDirectory() as folder:
        twin.run(known)
        inputs = planned(twin.model, Path(folder) / "inputs.csv", u, np.ones(AHEAD))
        out = twin.forecast(float(AHEAD), known, inputs=inputs).outputs["x"]
    truth, past, steps = table["x"][KNOWN:], known["x"], np.arange(1, AHEAD + 1)
    moves = [past[k:] - past[:-k] for k in steps]
    center = past[-1] + np.array([move.mean() for move in moves])
    spread = np.array([move.std() for move in moves])
    rows = []
    for level, width in zip(LEVELS, DUMMY, strict=True):
        low, high = out.band(level)
        inside = np.mean((truth > low) & (truth < high))
        beside = np.mean(np.abs(truth - center) < width * spread)
        rows.append((inside, np.mean(high - low) / 2, beside, width * spread.mean()))
    return np.array(rows)


def main() -> int:
    """Prints the shares; exit code 1 where a band holds less or more than it says."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    found = np.array([one_run(seed) for seed in range(seeds)])
    mean, error = found.mean(axis=0), found.std(axis=0) / np.sqrt(seeds)
    demands: dict[str, bool] = {}
    for k, level in enumerate(LEVELS):
        inside, half, dummy, wide = mean[k]
        print(
            f"band of {level:.0%}: holds {inside:.1%} ± {1.96 * error[k, 0]:.1%} of the rows, "
            f"half width {100 * half:.1f} cm (dummy: {dummy:.1%}, {100 * wide:.1f} cm); "
            f"{seeds} runs of {AHEAD} rows ahead"
        )
        demands[f"band of {level:.0%}"] = holds(level, inside, 1.96 * error[k, 0])
        demands[f"narrower than the dummy's of {level:.0%}"] = bool(half < wide)
    return ended(demands)


if __name__ == "__main__":
    sys.exit(main())
