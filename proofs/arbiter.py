"""The arbiter on a one-axis robot with planted faults: `python -m proofs.arbiter [SEEDS]`.

`Twin.run` on `twins/robot1d.toml` with its gain 5 % off, 60 s a run (`planted/robots.py`). RMSE of
the twin's predicted position against the truth in m; for the jump the time to recover in s. "no
gate" takes every measurement as it is. "told" is the same twin without the faulty samples: what
remains is the model's own drift, 5 % of the way, which no arbiter can know; "more" is how much the
arbiter lies above it, with a 95 % interval (bootstrap over the runs, paired). "adopted" counts the
runs in which the twin was ever 0.3 m away from the one that is told.

Faults of 10 s begin after 10 to 17 s. Each has its relatives: a frozen sensor with dither, at two
values, with spikes. A recorded command may be wrong too; then "told" has the true one.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from planted.robots import RATE, WAYS, Run, drive, followed

LONG = 100
"""Rows of a fault of 10 s."""
Change = Callable[[np.ndarray, np.random.Generator], np.ndarray]


def held(y: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The first value again and again."""
    return np.full(len(y), y[0])


def spiked(y: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A fifth of the values off by 2 m."""
    return y + rng.choice([-2.0, 2.0], len(y)) * (rng.random(len(y)) < 0.2)


FAULTS: dict[str, Change] = {
    "stuck": held,
    "stuck, 1 mm dither": lambda y, rng: held(y, rng) + rng.normal(0.0, 1e-3, len(y)),
    "stuck at two values": lambda y, rng: held(y, rng) + 0.01 * (np.arange(len(y)) % 2),
    "stuck, 20 % spikes": lambda y, rng: spiked(held(y, rng), rng),
    "zero": lambda y, rng: np.zeros(len(y)),
    "sign flipped": lambda y, rng: -y,
    "every 2nd sample + 2 m": lambda y, rng: y + 2.0 * (np.arange(len(y)) % 2),
    "burst of 9, + 2 m": lambda y, rng: y + 2.0 * (np.arange(len(y)) < 9),
    **{
        f"unit off by {factor:g}": lambda y, rng, factor=factor: factor * y
        for factor in (1e6, 1000.0, 100.0, 180 / np.pi, 25.4, 10.0, 3.281, 0.1, 0.01, 0.001)
    },
}
COMMANDS = {f"command x {factor:g}": factor for factor in (1000.0, 10.0, 3.0, -1.0, 0.0)}
"""Factors on the recorded command; the machine got the true one."""
SAYS = {"overruled": "overruled", "measurement_error": "errors", "measurement_restored": "restored"}


def faulty(fault: str, seed: int, way: str) -> Run:
    """A recording with a fault."""
    run, rng = drive(seed, way=way), np.random.default_rng([1, seed])
    y, wrong, onset = run.y.copy(), run.faulty.copy(), int(rng.integers(100, 170))
    if fault == "8 spikes of 2 m":
        wrong[rng.choice(np.arange(20, len(y) - 20, 12), 8, replace=False)] = True
        y[wrong] += rng.choice([-2.0, 2.0], 8)
    elif fault == "real 1 m jump":
        y[onset:] += 1.0
        run.truth[onset:] += 1.0
    elif fault in COMMANDS:
        v = run.v.copy()
        v[onset : onset + LONG] *= COMMANDS[fault]
        run = run._replace(v=v)
    elif fault in FAULTS:
        at = slice(onset, onset + LONG)
        y[at] = FAULTS[fault](y[at], rng)
        wrong[at] = y[at] != run.y[at]
    return run._replace(y=y, faulty=wrong)


class Case(NamedTuple):
    """One recording followed: squares of the errors, time to recover, and what was found."""

    squares: tuple[float, float, float, float]
    seconds: float
    adopted: bool
    kinds: Counter[str]


def case(fault: str, seed: int, gain: float, way: str) -> Case:
    """A fault's recording through the twins."""
    run = faulty(fault, seed, way)
    told = run._replace(y=np.where(run.faulty, np.nan, run.y))
    if fault in COMMANDS:
        told = drive(seed, way=way)
    ours, learned, known = (
        followed(run, gain=gain), followed(run, 0.0, gain), followed(told, gain=gain)
    )  # fmt: skip
    x, *others = (result.trace["predicted"][:, 0] for result in (ours, learned, known))
    naive, *rest = (float(np.nanmean((p - run.truth) ** 2)) for p in (run.y, x, *others))
    bad = np.flatnonzero(np.abs(x - run.truth) > 0.05)
    onset = int(np.argmax(np.abs(np.diff(run.truth)))) + 1
    seconds = float((bad[-1] + 1 - onset) / RATE) if len(bad) and bad[-1] >= onset else 0.0
    away = bool(np.nanmax(np.abs(x - others[1])) > 0.3)
    kinds = Counter(event.kind for event in ours.events if event.kind in SAYS)
    return Case((naive, rest[0], rest[1], rest[2]), seconds, away, kinds)


def more(ours: np.ndarray, told: np.ndarray) -> str:
    """How much the RMSE over all runs lies above that of the twin that is told."""
    rng, pairs = np.random.default_rng(0), np.array([ours, told])
    drawn = pairs[:, rng.integers(0, pairs.shape[1], (2000, pairs.shape[1]))]
    spread = np.diff(np.sqrt(drawn.mean(axis=2))[::-1], axis=0)
    low, high = np.quantile(spread, [0.025, 0.975])
    (value,) = np.diff(np.sqrt(pairs.mean(axis=1))[::-1])
    return f"{value:+.4f} ({low:+.4f} to {high:+.4f})"


def show(fault: str, seeds: int, gain: float, way: str) -> str:
    """One line of the table."""
    cases = [case(fault, seed, gain, way) for seed in range(seeds)]
    kinds: Counter[str] = sum((one.kinds for one in cases), Counter())
    counts = ", ".join(f"{n / seeds:g} {SAYS[kind]}" for kind, n in kinds.items())
    if fault == "real 1 m jump":
        low, middle, high = np.quantile([one.seconds for one in cases], [0.0, 0.5, 1.0])
        return f"{fault:22}{'0 s':>9}{middle:10.1f} s  ({low:.1f} to {high:.1f})    {counts}"
    squares = np.array([one.squares for one in cases])
    naive, ours, learned, told = np.sqrt(squares.mean(axis=0))
    figures = f"{naive:9.3f}{ours:10.4f}{learned:11.4f}{told:9.4f}"
    beyond, adopted = more(squares[:, 1], squares[:, 3]), sum(one.adopted for one in cases)
    return f"{fault:22}{figures}  {beyond:29}{adopted:3}  {counts}"


def calm(hours: float) -> str:
    """Clean data for a long time."""
    run = drive(0, rows=int(hours * 3600 * RATE))
    result = followed(run)
    kinds = Counter(event.kind for event in result.events)
    refused = int((result.trace["mark"] > 2).sum())
    return (
        f"{hours:g} h of clean data, {len(run.truth)} rows: {kinds['overruled']} overruled, "
        f"{refused} samples refused"
    )


def main() -> int:
    """Prints the tables."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    for gain, way in ((1.05, WAYS[0]), (0.95, WAYS[0]), *((1.05, way) for way in WAYS[1:])):
        print(f"gain {gain}, {way}, {seeds} seeds; found per run")
        heads = f"{'fault':22}{'no gate':>9}{'arbiter':>10}{'σ learned':>11}{'told':>9}"
        print(f"{heads}  {'more than told':27}adopted  found")
        for fault in ("clean", "8 spikes of 2 m", "real 1 m jump", *FAULTS, *COMMANDS):
            print(show(fault, seeds, gain, way), flush=True)
    print(calm(24.0))
    return 0


if __name__ == "__main__":
    sys.exit(main())
