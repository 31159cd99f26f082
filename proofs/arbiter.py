"""The arbiter on a one-axis robot with planted faults: `python -m proofs.arbiter`.

1-D robot, 10 Hz, position noise σ = 1 cm, model gain 5 % off, 60 s, trusted samples blended. Error
of the twin's position against the truth, RMSE in m over 100 seeds. "no gate" takes every
measurement as it is.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from evertwin.fold import Block, fold, make_block
from evertwin.models import FunctionModel, Parameters
from evertwin.signals import Layout
from evertwin.sync import Arbiter, Rule, Track

RATE, ROWS, SIGMA = 10.0, 600, 0.01
FAULTS = ("clean", "8 spikes of 2 m", "stuck 10 s", "wrong unit (mm) 10 s", "real 1 m jump")


def robot(gain: float) -> FunctionModel:
    """x' = gain·v; the position is measured."""
    position = Layout.of(x="m")
    return FunctionModel(
        lambda x, u, dt, p: ([x[0] + p[0] * u[0] * dt],) * 2,
        Layout.of(v="m/s"), position, position, Parameters.of(gain=(gain, "1")),
    )  # fmt: skip


def recording(fault: str, seed: int, rows: int = ROWS) -> tuple[Block, np.ndarray]:
    """The recording with its fault, and the true position."""
    rng = np.random.default_rng(seed)
    t = np.round(np.arange(rows) * 1e9 / RATE).astype(np.int64)
    v = 0.16 + 0.05 * np.sin(0.5 * t * 1e-9 + rng.uniform(0, 6))
    truth = np.concatenate([[0.0], np.cumsum(v[1:] / RATE)])
    onset = int(rng.integers(150, 250))
    if fault == "real 1 m jump":
        truth[onset:] += 1.0
    y = truth + rng.normal(0, SIGMA, rows)
    if fault == "8 spikes of 2 m":
        at = rng.choice(np.arange(20, rows - 20, 12), 8, replace=False)
        y[at] += rng.choice([-2.0, 2.0], 8)
    elif fault == "stuck 10 s":
        y[onset : onset + 100] = y[onset]
    elif fault == "wrong unit (mm) 10 s":
        y[onset : onset + 100] *= 1000.0
    return make_block(t=t, u=v[:, None], y=y[:, None]), truth


def followed(stage: Track, block: Block) -> tuple[np.ndarray, Any]:
    """Position after each row, read from the state row by row's adoption, and what came out."""
    state, x, outs = stage.init(), np.empty(len(block.t)), []
    for i in range(len(x)):
        state, out = stage.step(state, _row(block, i))
        x[i] = state.x[0]
        outs += out.records
    return x, outs


def _row(block: Block, i: int) -> Block:
    row, *arrays = block
    return Block(row + i, *(a[i : i + 1] for a in arrays))


def recovery(x: np.ndarray, truth: np.ndarray) -> float:
    """Seconds from the jump until the error stays under 5 cm."""
    onset = int(np.argmax(np.diff(truth))) + 1
    bad = np.flatnonzero(np.abs(x - truth) > 0.05)
    return float((bad[-1] + 1 - onset) / RATE) if len(bad) and bad[-1] >= onset else 0.0


def table(seeds: int, arbiter: Arbiter) -> dict[str, tuple[float, float, int]]:
    """Per fault: figure without gate, figure with the four steps, overrulings in all seeds."""
    stage, result = Track(robot(1.05), arbiter), {}
    for fault in FAULTS:
        errors, naive, times, resets = [], [], [], 0
        for seed in range(seeds):
            block, truth = recording(fault, seed)
            x, records = followed(stage, block)
            errors.append(np.mean((x - truth) ** 2))
            naive.append(np.mean((block.y[:, 0] - truth) ** 2))
            times.append(recovery(x, truth))
            resets += sum(e.kind == "overruled" for e in records)
        jump = fault == "real 1 m jump"
        ours = float(np.median(times)) if jump else float(np.sqrt(np.mean(errors)))
        result[fault] = (0.0 if jump else float(np.sqrt(np.mean(naive))), ours, resets)
    return result


def calm(hours: float, seed: int) -> tuple[int, int, int]:
    """Clean rows, overrulings and measurement errors within ``hours`` of clean data."""
    block, _ = recording("clean", seed, rows=int(hours * 3600 * RATE))
    stage = Track(robot(1.05), Arbiter(Rule(use="blend", sigma=SIGMA)))
    _, out = fold(stage, [block])
    kinds = [e.kind for e in out.records]
    return len(block.t), kinds.count("overruled"), kinds.count("measurement_error")


def main() -> None:
    """Prints the table."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    known = table(seeds, Arbiter(Rule(use="blend", sigma=SIGMA)))
    learned = table(seeds, Arbiter(Rule(use="blend")))
    print(f"{seeds} seeds, RMSE in m (jump: median time to recover in s)")
    print(f"{'fault':24}{'no gate':>10}{'four steps':>12}{'σ learned':>12}{'overruled':>11}")
    for fault in FAULTS:
        naive, ours, resets = known[fault]
        print(f"{fault:24}{naive:10.3f}{ours:12.4f}{learned[fault][1]:12.4f}{resets:11d}")
    rows, resets, errors = calm(24.0, 0)
    print(f"24 h of clean data, {rows} rows: {resets} overruled, {errors} samples refused")


if __name__ == "__main__":
    main()
