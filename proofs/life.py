"""Predicted lives of planted degradations: `python -m proofs.life [SERIES] [--law LAW ...]`.

`Twin.life` on `twins/wear.toml`, each series in a history file. Seven laws (`planted/lives.py`; no
law of the predictor is like the last one) and five kinds of wear that follow none of its laws:
these six are told and not asked. Cuts at 30, 50, 70 and 90 % of each life, at least SERIES (500 by
default) per law and cut. The predictor does not know which law planted a series, nor its numbers.
*fleet*: each group of series has a fleet of 24 like machines that ran to their end. *alone*: from
the series itself and nothing else.

Counted: how often the 80 % and 95 % intervals hold the truth, answers, intervals without an upper
end, α-λ (α = 0.2), relative accuracy, CRPS, prognostic horizon; the dummy knows the mean life only.
Series of the two-phase law count from their onset on; what is said before it is counted apart.

*Efficiency*: the median error on Wiener series, alone, over that of an oracle that knows drift and
variance; limit 1.1·√(1 + remaining/observed).
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.stats import invgauss

from evertwin.prognosis.laws import Life, NotEnough
from planted.histories import Columns, Told, table
from planted.lives import LAWS, LIFE, SPREAD, STRANGERS, Planted, plant, wiener
from planted.metrics import covers, crps, dummy, horizon, relative_accuracy, within
from proofs._verdict import ended

CUTS = (0.3, 0.5, 0.7, 0.9)
BESIDE = ("noisy gamma", *STRANGERS)
"""No law of the predictor is like these: counted and told, but not asked."""
FLEET = 24
GROUP = 20
MEAN_LIFE = LIFE * np.exp(0.5 * SPREAD**2)


class Said(NamedTuple):
    """One prediction beside its truth; times in whole lives of its machine."""

    answered: bool
    in80: bool
    in95: bool
    bounded: bool
    near: bool
    accuracy: float
    score: float
    error: float
    dummy_near: bool
    dummy_error: float


def said(life: Life | NotEnough, series: Planted, now: float) -> Said:
    """The prediction judged."""
    truth, age = series.life - now, now
    guess = dummy(MEAN_LIFE, age)
    off = abs(guess - truth) / series.life
    if isinstance(life, NotEnough):
        none = np.nan
        return Said(False, False, False, False, False, none, none, none,
                    within(guess, truth), off)  # fmt: skip
    return Said(
        True, covers(life.interval80, truth), covers(life.interval95, truth), life.bounded,
        within(life, truth), relative_accuracy(life.median, truth),
        crps(life, truth) / series.life, abs(life.median - truth) / series.life,
        within(guess, truth), off,
    )  # fmt: skip


def groups(law: str, count: int, seed: int) -> Iterator[tuple[list[Columns], list[Planted]]]:
    """(histories of a fleet, `GROUP` series) until at least ``count`` series were given."""
    for k in range(-(-count // GROUP)):
        rng = np.random.default_rng([seed, (*LAWS, *STRANGERS).index(law), k])
        machines = [table(plant(law, rng)) for _ in range(FLEET)]
        yield machines, [plant(law, rng) for _ in range(GROUP)]


def cover(law: str, count: int, seed: int) -> bool:
    """Counts one law; whether all of it lies inside what is asked."""
    rows: dict[tuple[str, float], list[Said]] = defaultdict(list)
    early: dict[float, list[bool]] = defaultdict(list)
    horizons: dict[str, list[float]] = defaultdict(list)
    # At the first cut the onset lies ahead of a third of the two-phase series.
    for machines, series in groups(law, 8 * count // 5 if law == "two-phase" else count, seed):
        with Told(machines) as fleet, Told() as alone:
            for one in series:
                medians: dict[str, list[float]] = defaultdict(list)
                for cut in CUTS:
                    seen = table(one, cut)
                    now = float(seen["cycle"][-1])
                    for kind, twin in (("fleet", fleet), ("alone", alone)):
                        life = twin.life(seen)
                        medians[kind].append(life.median if isinstance(life, Life) else np.inf)
                        if now > one.onset:
                            rows[kind, cut].append(said(life, one, now))
                        elif kind == "alone":
                            early[cut].append(isinstance(life, Life))
                at = [cut * one.life for cut in CUTS]
                medians["dummy"] = [dummy(MEAN_LIFE, t) for t in at]
                for kind, found in medians.items():
                    horizons[kind].append(horizon(at, found, one.life) / one.life)
    good = [line(law, kind, cut, rows[kind, cut]) for kind in ("fleet", "alone") for cut in CUTS]
    for cut, answers in sorted(early.items()):
        print(f"  {law}, cut {cut:.0%}, before the onset: {len(answers)}, a life was given in "
              f"{sum(answers)}")  # fmt: skip
    print("  prognostic horizon, median share of the life (± 20 % of it): "
          + ", ".join(f"{kind} {np.median(h):.2f}" for kind, h in horizons.items()))  # fmt: skip
    return all(good[: len(CUTS)])


def line(law: str, kind: str, cut: float, rows: list[Said]) -> bool:
    """Prints one line of counts."""
    told = [row for row in rows if row.answered]
    n, k = len(rows), max(len(told), 1)
    in80, in95 = (100 * sum(getattr(r, name) for r in told) / k for name in ("in80", "in95"))
    answered = 100 * len(told) / max(n, 1)
    good = 75 <= in80 <= 85 and 92 <= in95 <= 98 and (answered >= 90 or cut < 0.5)
    print(
        f"{law:11s} {kind:5s} {cut:4.0%} n {n:4d} answered {answered:5.1f} %  80 %: {in80:5.1f}  "
        f"95 %: {in95:5.1f}  no end {sum(not r.bounded for r in told):3d}  "
        f"α-λ {100 * sum(r.near for r in rows) / max(n, 1):3.0f} %  "
        f"accuracy {np.median([r.accuracy for r in told]):5.2f}  "
        f"CRPS {np.mean([r.score for r in told]):.3f}  "
        f"error {np.median([r.error for r in told]):.3f}  "
        f"dummy: α-λ {100 * sum(r.dummy_near for r in rows) / max(n, 1):3.0f} %, "
        f"error {np.median([r.dummy_error for r in rows]):.3f}"
        f"{'' if good or kind == 'alone' else '   <- outside'}"
    )
    sys.stdout.flush()
    return good


def efficiency(count: int) -> bool:
    """Wiener series alone, beside the oracle; whether all cuts keep the limit."""
    good = True
    for cut in CUTS:
        ours, oracles = [], []
        with Told() as twin:
            for k in range(count):
                series, drift, variance = wiener(np.random.default_rng([11, k]))
                seen = table(series, cut)
                now = float(seen["cycle"][-1])
                life, truth = twin.life(seen), series.life - now
                ours.append(abs((life.median if isinstance(life, Life) else np.inf) - truth))
                left = 1.0 - series.level[series.at <= now][-1]
                oracles.append(abs(oracle(left, drift, variance) - truth))
        ratio = np.median(ours) / np.median(oracles)
        limit = 1.1 * np.sqrt(1.0 + (1.0 - cut) / cut)
        good &= bool(ratio <= limit)
        mark = "" if ratio <= limit else "   <- outside"
        print(
            f"efficiency, {cut:.0%} of life, {count} series: median error {ratio:.3f} of the "
            f"oracle's, limit {limit:.3f}{mark}"
        )
    return good


def oracle(left: float, drift: float, variance: float) -> float:
    """Median of the inverse Gaussian time to the limit."""
    if left <= 0.0:
        return 0.0
    mean, shape = left / drift, left * left / variance
    return float(invgauss.median(mean / shape, scale=shape))


def main() -> int:
    """Prints the counts; exit code 1 if one lies outside what is asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("series", nargs="?", type=int, default=500)
    parser.add_argument("--law", action="append", choices=(*LAWS, *STRANGERS))
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    start, demands = time.monotonic(), dict[str, bool]()
    for law in asked.law or (*LAWS, *STRANGERS):
        demands[f"{law}, with a fleet"] = cover(law, asked.series, asked.seed) or law in BESIDE
    if not asked.law or "wiener" in asked.law:
        demands["error beside the oracle's"] = efficiency(4 * asked.series)
    print(f"{time.monotonic() - start:.0f} s")
    return ended(demands)


if __name__ == "__main__":
    sys.exit(main())
