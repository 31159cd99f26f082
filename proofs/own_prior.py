"""Coverage over the predictor's own prior: `python -m proofs.own_prior [SERIES]`.

A prediction from a prior is calibrated where components are drawn from that prior, not for each of
its laws alone: what looks like a line may be a young exponential, so lines get intervals that are
too wide and exponentials ones that are too narrow. Here components are drawn as `predict_life`
expects them without a fleet: the laws alike, exponents even in their logarithm over the predictor's
own ranges, onsets even over the life, and each looked at when a share of its life has passed that
is even between 0 and 1. Processes, noises and the 100 values of a life are those of
`planted/lives.py`; the gamma law has no noise here, as in the predictor.

A component whose onset lies ahead has no life yet: its true life counts as endless. Asked: over all
laws the 80 % intervals hold 75 to 85 %, the 95 % intervals 92 to 98 %.

Source: Talts, Betancourt, Simpson, Vehtari, Gelman, "Validating Bayesian inference algorithms with
simulation-based calibration" (2018).
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from evertwin.prognosis.laws import Life
from evertwin.prognosis.laws.hypotheses import EXPONENT, LAWS, POWER
from planted.histories import Told, table
from planted.lives import VALUES, Planted, plant
from proofs._verdict import ended

YOUNGEST = 0.05
"""Share of the life before which there are too few values."""
SHARES = (0.0, 0.025, 0.1, 0.5, 0.9, 0.975)
"""Probabilities between which true lives are counted."""


class Seen(NamedTuple):
    """One answer beside its truth."""

    passed: float
    """Share of the life that has passed."""
    step: int
    """How many of the quantiles at `SHARES` lie below the true remaining life."""


def drawn(law: str, rng: np.random.Generator) -> Planted:
    """A component as the predictor's prior has it."""
    if law in ("linear", "wiener", "gamma"):
        return plant(law, rng)
    s, noise = np.arange(1, VALUES + 1) / VALUES, rng.uniform(0.01, 0.04)
    low, high = POWER if law == "power" else EXPONENT
    c = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    if law == "power":
        return noisy(s, s**c, noise, 0.0, rng)
    if law == "exponential":
        return noisy(s, np.expm1(c * s) / np.expm1(c), noise, 0.0, rng)
    onset, form = rng.uniform(), rng.integers(3)
    u = np.maximum(s - onset, 0.0) / (1.0 - onset)
    if form == 0:
        return noisy(s, u, noise, onset, rng)
    if form == 1:
        return noisy(s, np.expm1(c * u) / np.expm1(c), noise, onset, rng)
    walk = plant("wiener", rng)
    rows = np.unique(np.ceil(u[u > 0.0] * VALUES).astype(int)) - 1
    after = onset + (1.0 - onset) * walk.at[rows] / walk.life
    before = s[s < onset]
    level = np.concatenate([np.zeros(len(before)), walk.level[rows]])
    return noisy(np.concatenate([before, after]), level, 0.25 * noise, onset, rng)


def noisy(
    s: np.ndarray, level: np.ndarray, noise: float, onset: float, rng: np.random.Generator
) -> Planted:
    """A component that lives 1, seen through noise."""
    return Planted(s, level + noise * rng.standard_normal(len(s)), 1.0, onset, level)


def seen(twin: Told, law: str, rng: np.random.Generator) -> Seen | None:
    """One component at some moment of its life; None without an answer."""
    one, passed = drawn(law, rng), rng.uniform(YOUNGEST, 1.0)
    known = table(one, passed)
    life = twin.life(known)
    if not isinstance(life, Life):
        return None
    truth = one.life - float(known["cycle"][-1]) if one.onset < passed * one.life else np.inf
    quantiles = np.array([0.0, *(life.quantile(p) for p in SHARES[1:])])
    return Seen(passed, int(np.sum(quantiles < truth)))


def line(name: str, rows: Sequence[Seen], asked: int) -> bool:
    """Prints one line of counts; whether it lies inside what is asked."""
    share = 100 * np.bincount([row.step for row in rows], minlength=7)[1:] / max(len(rows), 1)
    in80, in95 = float(share[2:4].sum()), float(share[1:5].sum())
    print(
        f"{name:16s} n {asked:5d} answered {100 * len(rows) / asked:5.1f} %  80 %: {in80:5.1f}  "
        f"95 %: {in95:5.1f}  true lives below 2.5, 10, 50, 90, 97.5 % and above: "
        + ", ".join(f"{x:.1f}" for x in share)
    )
    sys.stdout.flush()
    return 75 <= in80 <= 85 and 92 <= in95 <= 98


def main() -> int:
    """Prints the counts; exit code 1 if the laws together lie outside what is asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("series", nargs="?", type=int, default=500)
    parser.add_argument("--seed", type=int, default=5)
    asked = parser.parse_args()
    start, every = time.monotonic(), []
    for law in LAWS:
        rngs = (
            np.random.default_rng([asked.seed, LAWS.index(law), k]) for k in range(asked.series)
        )
        with Told() as twin:
            rows = [row for rng in rngs if (row := seen(twin, law, rng)) is not None]
        line(law, rows, asked.series)
        every += rows
    for low in (0.0, 0.25, 0.5, 0.75):
        some = [row for row in every if low <= row.passed < low + 0.25]
        line(f"life passed {low:.0%}+", some, len(some))
    good = line("all", every, asked.series * len(LAWS))
    print(f"{time.monotonic() - start:.0f} s")
    return ended({"intervals of all laws together": good})


if __name__ == "__main__":
    sys.exit(main())
