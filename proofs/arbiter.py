"""The arbiter on a one-axis robot with planted faults: `python -m proofs.arbiter [SEEDS]`.

1-D robot, 10 Hz, position noise σ = 1 cm, model gain 5 % off, 60 s, trusted samples blended. RMSE
of the twin's position against the truth in m; for the jump the time to recover in s. "no gate"
takes every measurement as it is. "told" is the same twin that is told which samples are faulty:
what remains is the model's own drift, 5 % of the way, which no arbiter can know. The robot drives
on at 0.158 ± 0.05 m/s, or at random speeds within ± 0.3 m/s, each held 2 to 6 s.
"""

from __future__ import annotations

import sys
from typing import NamedTuple

import numpy as np

from evertwin.fold import Block, Event, fold, make_block, take
from evertwin.machines.mobile import Robot1D
from evertwin.sync import Arbiter, Rule, Track

RATE, ROWS, SIGMA = 10.0, 600, 0.01
FAULTS = ("clean", "8 spikes of 2 m", "stuck 10 s", "wrong unit (mm) 10 s", "real 1 m jump")
SAYS = {"overruled": "overruled", "measurement_error": "errors", "measurement_restored": "restored"}


class Run(NamedTuple):
    """One recording with its fault."""

    block: Block
    truth: np.ndarray
    faulty: np.ndarray


def speeds(rng: np.random.Generator, t: np.ndarray, held: bool) -> np.ndarray:
    """Commanded speed [m/s]."""
    if not held:
        return np.asarray(0.158 + 0.05 * np.sin(0.5 * t * 1e-9 + rng.uniform(0, 6)))
    v, k = np.empty(len(t)), 0
    while k < len(t):
        hold = int(rng.integers(2 * RATE, 6 * RATE + 1))
        v[k : k + hold] = rng.uniform(-0.3, 0.3)
        k += hold
    return v


def recording(fault: str, seed: int, rows: int = ROWS, held: bool = False) -> Run:
    """The recording, the true position, and which samples are faulty."""
    rng = np.random.default_rng(seed)
    t = np.round(np.arange(rows) * 1e9 / RATE).astype(np.int64)
    v = speeds(rng, t, held)
    truth = np.concatenate([[0.0], np.cumsum(v[1:] / RATE)])
    onset, faulty = int(rng.integers(100, 170)), np.zeros(rows, dtype=np.bool_)
    if fault == "real 1 m jump":
        truth[onset:] += 1.0
    y = truth + rng.normal(0, SIGMA, rows)
    if fault == "8 spikes of 2 m":
        faulty[rng.choice(np.arange(20, rows - 20, 12), 8, replace=False)] = True
        y[faulty] += rng.choice([-2.0, 2.0], 8)
    elif fault == "stuck 10 s":
        y[onset : onset + 100] = y[onset]
        faulty[onset + 1 : onset + 100] = True
    elif fault == "wrong unit (mm) 10 s":
        y[onset : onset + 100] *= 1000.0
        faulty[onset : onset + 100] = True
    return Run(make_block(t=t, u=v[:, None], y=y[:, None]), truth, faulty)


def followed(stage: Track, block: Block, gain: float) -> tuple[np.ndarray, list[Event]]:
    """The twin's position after each row, and what became known."""
    state, x, records = stage.renew(stage.init(), np.array([gain])), np.empty(len(block.t)), []
    for i in range(len(x)):
        state, out = stage.step(state, take(block, i, i + 1))
        x[i] = state.x[0]
        records += out.records
    return x, records


def recovery(x: np.ndarray, truth: np.ndarray) -> float:
    """Seconds from the jump until the error stays under 5 cm."""
    onset = int(np.argmax(np.diff(truth))) + 1
    bad = np.flatnonzero(np.abs(x - truth) > 0.05)
    return float((bad[-1] + 1 - onset) / RATE) if len(bad) and bad[-1] >= onset else 0.0


def rms(errors: list[np.ndarray]) -> float:
    """Root of the mean square over all seeds."""
    return float(np.sqrt(np.mean([np.mean(e**2) for e in errors])))


def show(fault: str, seeds: int, gain: float, held: bool) -> str:
    """One line of the table."""
    stages = [Track(Robot1D(), Arbiter(Rule(use="blend", sigma=s))) for s in (SIGMA, 0.0)]
    naive, told, times, kinds = [], [], [], dict.fromkeys(SAYS, 0)
    ours: list[list[np.ndarray]] = [[], []]
    for seed in range(seeds):
        run = recording(fault, seed, held=held)
        for errors, stage in zip(ours, stages, strict=True):
            x, records = followed(stage, run.block, gain)
            errors.append(x - run.truth)
            if stage is stages[0]:
                times.append(recovery(x, run.truth))
                for record in records:
                    kinds[record.kind] = kinds.get(record.kind, 0) + 1
        naive.append(run.block.y[:, 0] - run.truth)
        clean = run.block._replace(y=np.where(run.faulty[:, None], np.nan, run.block.y))
        told.append(followed(stages[0], clean, gain)[0] - run.truth)
    counts = ", ".join(f"{n / seeds:g} {SAYS.get(k, k)}" for k, n in kinds.items() if n)
    if fault == "real 1 m jump":
        low, middle, high = np.quantile(times, [0.0, 0.5, 1.0])
        return f"{fault:22}{'0 s':>9}{middle:10.1f} s  ({low:.1f} to {high:.1f})    {counts}"
    figures = f"{rms(naive):9.3f}{rms(ours[0]):10.4f}{rms(ours[1]):11.4f}{rms(told):9.4f}"
    return f"{fault:22}{figures}    {counts}"


def calm(hours: float, seed: int) -> str:
    """Clean data for a long time."""
    run = recording("clean", seed, rows=int(hours * 3600 * RATE))
    stage = Track(Robot1D(), Arbiter(Rule(use="blend", sigma=SIGMA)))
    _, out = fold(stage, [run.block], stage.renew(stage.init(), np.array([1.05])))
    kinds = [e.kind for e in out.records]
    refused = int((out.rows.mark > 2).sum())
    return (
        f"{hours:g} h of clean data, {len(run.truth)} rows: {kinds.count('overruled')} overruled, "
        f"{refused} samples refused"
    )


def main() -> int:
    """Prints the table."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    for gain, held in ((1.05, False), (0.95, False), (1.05, True)):
        how = "random speeds" if held else "driving on"
        print(f"gain {gain}, {how}, {seeds} seeds; found per run")
        print(f"{'fault':22}{'no gate':>9}{'four steps':>10}{'σ learned':>11}{'told':>9}    found")
        for fault in FAULTS:
            print(show(fault, seeds, gain, held))
    print(calm(24.0, 0))
    return 0


if __name__ == "__main__":
    sys.exit(main())
