"""The arbiter on a one-axis robot with planted faults: `python -m proofs.arbiter [SEEDS [FIRST]]`.

`Twin.run` on `twins/robot1d.toml` with its gain 5 % off, 60 s a run (`planted/robots.py`). RMSE of
the twin's predicted position against the truth in m; for the jumps the time to recover in s. "no
gate" takes every measurement as it is. "told" is the same twin without the faulty samples: what
remains is the model's own drift, 5 % of the way, which no arbiter can know. "within" is the share
of the runs whose RMSE is at most 1.2 times that of the told twin. "adopted" counts the runs in
which the twin was ever 0.3 m away from it.

Faults of 10 s begin after 10 to 17 s. Each has its relatives: a frozen sensor with dither, at two
values, with spikes. A recorded command may be wrong too; then "told" has the true one.

At last what cannot be told from one sensor: pairs of machines that give the same rows.
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
    "burst of 7, + 2 m": lambda y, rng: y + 2.0 * (np.arange(len(y)) < 7),
    "burst of 9, + 2 m": lambda y, rng: y + 2.0 * (np.arange(len(y)) < 9),
    **{
        f"unit off by {factor:g}": lambda y, rng, factor=factor: factor * y
        for factor in (1e6, 1000.0, 100.0, 180 / np.pi, 25.4, 39.37, 10.0, 3.281, 0.1, 0.01, 0.001)
    },
}
JUMPS = ("real 1 m jump", "1 m jump, 20 % spikes")
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
    elif fault in JUMPS:
        y[onset:] += 1.0
        run.truth[onset:] += 1.0
        if fault == JUMPS[1]:
            y[onset : onset + LONG] = spiked(y[onset : onset + LONG], rng)
    elif fault == "mm from row 0":
        y[: onset + LONG] *= 1000.0
        wrong[: onset + LONG] = True
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

    squares: tuple[float, float, float]
    seconds: float
    adopted: bool
    kinds: Counter[str]


def case(fault: str, seed: int, gain: float, way: str) -> Case:
    """A fault's recording through the twins."""
    run = faulty(fault, seed, way)
    told = run._replace(y=np.where(run.faulty, np.nan, run.y))
    if fault in COMMANDS:
        told = drive(seed, way=way)
    ours, known = followed(run, gain=gain), followed(told, gain=gain)
    x, other = (result.trace["predicted"][:, 0] for result in (ours, known))
    naive, *rest = (float(np.nanmean((p - run.truth) ** 2)) for p in (run.y, x, other))
    bad = np.flatnonzero(np.abs(x - run.truth) > 0.05)
    onset = int(np.argmax(np.abs(np.diff(run.truth)))) + 1
    seconds = float((bad[-1] + 1 - onset) / RATE) if len(bad) and bad[-1] >= onset else 0.0
    away = bool(np.nanmax(np.abs(x - other)) > 0.3)
    kinds = Counter(event.kind for event in ours.events if event.kind in SAYS)
    return Case((naive, rest[0], rest[1]), seconds, away, kinds)


def show(fault: str, seeds: range, gain: float, way: str) -> str:
    """One line of the table."""
    cases = [case(fault, seed, gain, way) for seed in seeds]
    kinds: Counter[str] = sum((one.kinds for one in cases), Counter())
    counts = ", ".join(f"{n / len(seeds):g} {SAYS[kind]}" for kind, n in kinds.items())
    if fault in JUMPS:
        low, middle, high = np.quantile([one.seconds for one in cases], [0.0, 0.5, 1.0])
        return f"{fault:22}{'0 s':>9}{middle:10.1f} s  ({low:.1f} to {high:.1f})    {counts}"
    squares = np.array([one.squares for one in cases])
    naive, ours, told = np.sqrt(squares.mean(axis=0))
    within = float(np.mean(squares[:, 1] <= 1.44 * squares[:, 2]))
    adopted = sum(one.adopted for one in cases)
    figures = f"{naive:9.3f}{ours:10.4f}{told:9.4f}{100 * within:8.0f} %{adopted:8}"
    return f"{fault:22}{figures}   {counts}"


def pairs() -> str:
    """Two machines each that give the same rows: how far off the twin is, if it was one or other.

    What the sensor of one does, the machine of the other does; so commands and measurements are
    the same numbers, and only the truth differs.
    """
    run = drive(0, way=WAYS[1])
    zero = 100 + int(np.argmin(np.abs(run.truth[100:200])))
    burst, turned, slow = run.y.copy(), run.y - run.truth, run.y
    burst[zero : zero + 9] += 2.0
    away, other_way = run.truth.copy(), run.truth.copy()
    away[zero : zero + 9] += 2.0
    other_way[zero : zero + LONG] *= -1.0
    turned = turned + other_way
    v = run.v.copy()
    v[zero : zero + LONG] *= 3.0
    lines = [
        "the same rows from two machines; RMSE of the twin in m if it was the first, the other"
    ]
    for says, command, y, other in (
        ("burst longer than the vote | moved there and back", run.v, burst, away),
        ("sign of the sensor at zero | goes the other way", run.v, turned, other_way),
        ("command x 3 is recorded    | its gain fell to a third", v, slow, run.truth),
    ):
        rows = run._replace(v=command, y=y)
        x = followed(rows).trace["predicted"][:, 0]
        first, second = (np.sqrt(np.nanmean((x - t) ** 2)) for t in (run.truth, other))
        lines.append(f"{says:52}{first:9.4f}{second:9.4f}")
    return "\n".join(lines)


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
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    seeds = range(first, first + count)
    for gain, way in ((1.05, WAYS[0]), (0.95, WAYS[0]), *((1.05, way) for way in WAYS[1:])):
        print(f"gain {gain}, {way}, {count} seeds from {first}; found per run")
        print(f"{'fault':22}{'no gate':>9}{'arbiter':>10}{'told':>9}{'within':>10} adopted   found")
        for fault in ("clean", "8 spikes of 2 m", *JUMPS, "mm from row 0", *FAULTS, *COMMANDS):
            print(show(fault, seeds, gain, way), flush=True)
    print(pairs())
    print(calm(24.0))
    return 0


if __name__ == "__main__":
    sys.exit(main())
