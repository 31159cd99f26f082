"""One machine at 1 and at 10 rows a second: `python -m proofs.rates [SEEDS]`.

A drive with a threshold, a gain and a cap of its own, drawn anew for each seed, follows speeds that
are held for some seconds. Its position is recorded ten times a second, and every tenth of these
samples alone, and `twins/robot1d.toml` runs beside either recording, its settings in times.
Counted is how often both give the same verdicts and the same form of the model, and whether it
goes live within two beats of the other.
"""

from __future__ import annotations

import sys
from typing import NamedTuple

import numpy as np

from evertwin import Twin
from evertwin.outcome.result import RunResult
from proofs._verdict import ended

TWIN = "twins/robot1d.toml"
BEAT = 5.0
SECONDS = 900
DECISIVE = ("suspected", "normal", "abnormal", "promoted", "rolled_back")


class Outcome(NamedTuple):
    """What a run came to."""

    verdicts: tuple[str, ...]
    form: tuple[str, ...]
    live: float
    """Time at which the champion went live [s]; infinite: never."""


def recording(seed: int, rate: int) -> dict[str, np.ndarray]:
    """Commands and positions of one drive, in SI."""
    rng = np.random.default_rng(seed)
    start, cap = rng.uniform(0.03, 0.08), rng.uniform(0.13, 0.18)
    gain = rng.uniform(0.85, 1.1)
    sweep = np.repeat(0.01 * np.arange(21), 5)
    held = rng.integers(3, 9, SECONDS)
    free = np.repeat(0.01 * rng.integers(0, 21, SECONDS), held)
    v = np.concatenate([sweep, free])[:SECONDS]
    true = np.where(v < start, 0.0, np.minimum(gain * v, cap))
    fine = np.repeat(v, 100)
    way = np.r_[0.0, np.cumsum(np.repeat(true, 100)) * 0.01]
    at = np.arange(0, SECONDS * 100, 10)
    noise = np.random.default_rng([seed, 1]).normal(0.0, 0.002, len(at))
    kept = slice(None, None, 10 // rate)
    return {"t": at[kept] * 0.01, "v": fine[at][kept], "x": (way[at] + noise)[kept]}


def outcome(result: RunResult) -> Outcome:
    """The verdicts before the model went live, its form, and when."""
    lived = [e for e in result.events if e.kind == "promoted"]
    end = lived[0].row if lived else result.samples
    verdicts = tuple(e.kind for e in result.events if e.kind in DECISIVE and e.row <= end)
    form = tuple(sorted(f"{term.kind} {term.channel}" for term in result.champion.form.terms))
    return Outcome(verdicts, form, lived[0].time * 1e-9 if lived else np.inf)


def main(seeds: int) -> int:
    """Both rates for each seed."""
    same = near = live = 0
    for seed in range(seeds):
        found = []
        for rate in (1, 10):
            with Twin.open(TWIN) as twin:
                found.append(outcome(twin.run(recording(seed, rate))))
        slow, fast = found
        equal = slow[:2] == fast[:2]
        same += equal
        live += np.isfinite(slow.live) and np.isfinite(fast.live)
        near += slow.live == fast.live or abs(slow.live // BEAT - fast.live // BEAT) <= 2
        if not equal:
            print(f"seed {seed}: {slow} at 1 Hz, {fast} at 10 Hz", flush=True)
    print(f"same verdicts and form: {same} of {seeds}; live at both rates: {live}")
    print(f"live within two beats: {near} of {seeds}")
    return ended({
        "same verdicts and form in 95 %": same >= 0.95 * seeds,
        "live within two beats in 95 %": near >= 0.95 * seeds,
    })  # fmt: skip


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 100))
