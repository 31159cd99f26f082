"""The gate to the live model, through the whole loop: `python -m proofs.gate [RUNS [SPELLS]]`.

A one-axis robot at 10 Hz, position noise 1 cm, 600 s of random speeds up to 0.3 m/s, each held 2 to
6 s; the twin re-tunes its gain every 60 s and tries what comes out. Counted are promotions of a
gain that is 10 % (and 5 %) better, of one that is no better, and roll-backs of one that was better
until it went live: from that row on the machine moves as before. The trial's settings are the
defaults. Then so many trials of two versions that are equally good on the whole, over 600 segments:
one is better for a spell, then the other, each spell drawn with a mean length.
"""

from __future__ import annotations

import sys

import numpy as np

from evertwin import RunResult
from evertwin.config.spec import Span
from evertwin.trial import Trial
from planted.twins import opened

RATE, SECONDS, SIGMA, FASTEST = 10, 600, 0.01, 0.3
ROWS = RATE * SECONDS


SETTINGS = {
    "arbiter": {"use": "blend", "sigma": SIGMA},
    "prediction": {"horizon": 2.0},
    "anomaly": {"requirement": np.inf},
    "tuning": {"every": 60.0, "window": Span(600)},
    "correction": {"channels": ()},
    "beat": Span(60),
}
"""The gain alone is tuned, every 60 s."""


def recording(seed: int, gain: float, back: int = ROWS) -> dict[str, np.ndarray]:
    """Rows of a machine with ``gain``, and with gain 1 from row ``back`` on."""
    rng = np.random.default_rng(seed)
    v = np.empty(ROWS)
    k = 0
    while k < ROWS:
        hold = int(rng.integers(2 * RATE, 6 * RATE + 1))
        v[k : k + hold] = rng.uniform(-FASTEST, FASTEST)
        k += hold
    gains = np.where(np.arange(ROWS) < back, gain, 1.0)
    x = np.concatenate([[0.0], np.cumsum(gains[1:] * v[:-1] / RATE)])
    return {"t": np.arange(ROWS) / RATE, "v": v, "x": x + SIGMA * rng.standard_normal(ROWS)}


def run(data: dict[str, np.ndarray]) -> RunResult:
    """One run of the loop."""
    with opened("robot1d", **SETTINGS) as twin:
        return twin.run(data)


def first(result: RunResult, kind: str) -> int | None:
    """Row of the first event of a kind."""
    found = result.of_kind(kind)
    return found[0].row if found else None


def spell(rng: np.random.Generator, mean: float, count: int = 600) -> np.ndarray:
    """Numbers that stay the same for a spell."""
    found = np.repeat(rng.normal(size=count), rng.geometric(1.0 / mean, count))
    return found[:count]


def promotes(seed: int, mean: float) -> bool:
    """Does a trial promote one of two versions that are equally good?"""
    rng, trial = np.random.default_rng([seed, 11]), Trial()
    both = 0.5 * spell(rng, mean)
    off = [np.exp(both + 0.4 * spell(rng, mean) + 0.1 * rng.normal(size=600)) for _ in range(2)]
    return trial.step(trial.init(), np.square(np.column_stack(off)))[1] == "promote"


def said(rows: list[int | None]) -> str:
    """Share, and when."""
    known = np.array([row for row in rows if row is not None])
    share = f"{100 * len(known) / len(rows):5.1f} % of {len(rows)}"
    if len(known) == 0:
        return share
    half, most = np.percentile(known, [50, 95]) / RATE
    return f"{share}, after {half:.0f} s (median), {most:.0f} s (95 %)"


def main() -> int:
    """Prints the counts; exit code 1 if the gate misses what is asked of it."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    promoted: dict[float, list[int | None]] = {}
    for gain in (1.1, 1.05, 1.0):
        results = [run(recording(seed, gain)) for seed in range(runs)]
        promoted[gain] = [first(r, "promoted") for r in results]
        print(f"gain off by {100 * (gain - 1):4.1f} %: promoted {said(promoted[gain])}")
    back: list[int | None] = []
    for seed, row in enumerate(promoted[1.1]):
        if row is not None and row < ROWS // 2:
            rolled = first(run(recording(seed, 1.1, back=row)), "rolled_back")
            back.append(None if rolled is None else rolled - row)
    print(f"bad after it went live: rolled back {said(back)}")
    spells = int(sys.argv[2]) if len(sys.argv) > 2 else 1000
    for mean in (1, 5, 10, 20, 50):
        wrong = 100 * np.mean([promotes(seed, mean) for seed in range(spells)])
        print(f"equally good, by spells of {mean:2} segments: promoted {wrong:.1f} % of {spells}")
    share = [np.mean([row is not None for row in promoted[g]]) for g in (1.1, 1.0)]
    rolled_back = np.mean([row is not None for row in back])
    good = share[0] >= 0.95 and share[1] <= 0.01 and rolled_back >= 0.95
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
