"""The arbiter on a one-axis robot with planted faults: `python -m proofs.arbiter [SEEDS]`.

1-D robot, 10 Hz, position noise σ = 1 cm, model gain 5 % off, 60 s, trusted samples blended. RMSE
of the twin's position against the truth in m; for the jump the time to recover in s. "no gate"
takes every measurement as it is. "told" is the same twin that is told which samples are faulty:
what remains is the model's own drift, 5 % of the way, which no arbiter can know; "more" is how much
the arbiter lies above it, with a 95 % interval (bootstrap over the runs, paired). "adopted" counts
the runs in which the twin was ever 0.3 m away from the one that is told.

Four ways to drive from the origin: on at 0.158 ± 0.05 m/s; to and fro, 0.3 m/s · sin(2π·t/20 s);
stop and go, 0.25 m/s for 3 s, then 2 s at rest; random speeds within ± 0.3 m/s, each held 2 to 6 s.
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
WAYS = ("driving on", "to and fro", "stop and go", "random speeds")
FACTORS = (1e6, 1000.0, 100.0, 180 / np.pi, 25.4, 10.0, 0.1, 0.01, 0.001)
SAYS = {"overruled": "overruled", "measurement_error": "errors", "measurement_restored": "restored"}


class Run(NamedTuple):
    """One recording with its fault."""

    block: Block
    truth: np.ndarray
    faulty: np.ndarray


def speeds(rng: np.random.Generator, t: np.ndarray, way: str) -> np.ndarray:
    """Commanded speed [m/s]."""
    seconds, phase = t * 1e-9, rng.uniform(0, 6)
    if way == "driving on":
        return np.asarray(0.158 + 0.05 * np.sin(0.5 * seconds + phase))
    if way == "to and fro":
        return np.asarray(0.3 * np.sin(2 * np.pi * seconds / 20 + phase))
    if way == "stop and go":
        return np.where((seconds + phase) % 5 < 3, 0.25, 0.0)
    v, k = np.empty(len(t)), 0
    while k < len(t):
        hold = int(rng.integers(2 * RATE, 6 * RATE + 1))
        v[k : k + hold] = rng.uniform(-0.3, 0.3)
        k += hold
    return v


def recording(
    fault: str, seed: int, rows: int = ROWS, way: str = WAYS[0], factor: float = 1000.0
) -> Run:
    """The recording, the true position, and which samples are faulty."""
    rng = np.random.default_rng(seed)
    t = np.round(np.arange(rows) * 1e9 / RATE).astype(np.int64)
    v = speeds(rng, t, way)
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
    elif fault.startswith("wrong unit"):
        y[onset : onset + 100] *= factor
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


def more(ours: list[float], told: list[float]) -> str:
    """How much the RMSE over all runs lies above that of the twin that is told."""
    rng, pairs = np.random.default_rng(0), np.array([ours, told])
    drawn = pairs[:, rng.integers(0, pairs.shape[1], (2000, pairs.shape[1]))]
    spread = np.diff(np.sqrt(drawn.mean(axis=2))[::-1], axis=0)
    low, high = np.quantile(spread, [0.025, 0.975])
    (value,) = np.diff(np.sqrt(pairs.mean(axis=1))[::-1])
    return f"{value:+.4f} ({low:+.4f} to {high:+.4f})"


class Score(NamedTuple):
    """Squares of the errors per run, times to recover, and what was found."""

    squares: dict[str, list[float]]
    times: list[float]
    kinds: dict[str, int]
    adopted: int


def scored(fault: str, seeds: int, gain: float, way: str, factor: float = 1000.0) -> Score:
    """Runs a fault's recordings through the twins."""
    stages = [Track(Robot1D(), Arbiter(Rule(use="blend", sigma=s))) for s in (SIGMA, 0.0)]
    squares: dict[str, list[float]] = {"naive": [], "ours": [], "learned": [], "told": []}
    times, kinds, adopted = [], dict.fromkeys(SAYS, 0), 0
    for seed in range(seeds):
        run = recording(fault, seed, way=way, factor=factor)
        clean = run.block._replace(y=np.where(run.faulty[:, None], np.nan, run.block.y))
        x, records = followed(stages[0], run.block, gain)
        known = followed(stages[0], clean, gain)[0]
        learned = followed(stages[1], run.block, gain)[0]
        adopted += int(np.abs(x - known).max() > 0.3)
        times.append(recovery(x, run.truth))
        ways = {"naive": run.block.y[:, 0], "ours": x, "learned": learned, "told": known}
        for name, position in ways.items():
            squares[name].append(float(np.mean((position - run.truth) ** 2)))
        for record in records:
            kinds[record.kind] = kinds.get(record.kind, 0) + 1
    return Score(squares, times, kinds, adopted)


def show(fault: str, seeds: int, gain: float, way: str) -> str:
    """One line of the table."""
    score = scored(fault, seeds, gain, way)
    counts = ", ".join(f"{n / seeds:g} {SAYS.get(k, k)}" for k, n in score.kinds.items() if n)
    if fault == "real 1 m jump":
        low, middle, high = np.quantile(score.times, [0.0, 0.5, 1.0])
        return f"{fault:22}{'0 s':>9}{middle:10.1f} s  ({low:.1f} to {high:.1f})    {counts}"
    rms = {name: float(np.sqrt(np.mean(values))) for name, values in score.squares.items()}
    figures = f"{rms['naive']:9.3f}{rms['ours']:10.4f}{rms['learned']:11.4f}{rms['told']:9.4f}"
    beyond = more(score.squares["ours"], score.squares["told"])
    return f"{fault:22}{figures}  {beyond:29}{score.adopted:3}  {counts}"


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


def units(factor: float, seeds: int) -> str:
    """One line of the table of factors."""
    adopted = [scored("wrong unit", seeds, 1.05, way, factor).adopted for way in WAYS]
    return f"{factor:12g}" + "".join(f"{n:15}" for n in adopted)


def main() -> int:
    """Prints the tables."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    for gain, way in ((1.05, WAYS[0]), (0.95, WAYS[0]), *((1.05, way) for way in WAYS[1:])):
        print(f"gain {gain}, {way}, {seeds} seeds; found per run")
        heads = f"{'fault':22}{'no gate':>9}{'four steps':>10}{'σ learned':>11}{'told':>9}"
        print(f"{heads}  {'more than told':27}adopted  found")
        for fault in FAULTS:
            print(show(fault, seeds, gain, way), flush=True)
    print(f"wrong unit by a factor, 10 s: adopted in so many of {seeds} runs (1000: {3 * seeds})")
    print(f"{'factor':>12}" + "".join(f"{way:>15}" for way in WAYS))
    for factor in FACTORS:
        print(units(factor, 3 * seeds if factor == 1000.0 else seeds), flush=True)
    print(calm(24.0, 0))
    return 0


if __name__ == "__main__":
    sys.exit(main())
