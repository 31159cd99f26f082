"""Lives of engines that nobody here planted: `python -m proofs.engines` (needs EVERTWIN_DATA).

`Twin.life` on `twins/wear.toml`. C-MAPSS FD001 (NASA, simulated turbofans): 100 engines run until
they fail. The health of an engine is the mean of the 14 sensors that move, each standardised and
turned to the side to which it grows, and its limit is the level that nine in ten reach before they
fail; scales, signs and limit come from one half of the engines. The other half is predicted at 30,
50, 70 and 90 % of each life, which ends where the twin says that the whole history has passed the
limit; then the halves change places. Nobody knows the law of this wear: it is a test of what is
said where no law is given.

*alone*: from the engine itself; *fleet*: with the other half of the engines. The dummy knows the
mean life of those. Asked: with the fleet, over all cuts, the 80 % intervals hold 75 to 85 % and the
95 % intervals 92 to 98 %, each give or take two standard deviations of the count.
"""

from __future__ import annotations

import os
import sys
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

import numpy as np

from evertwin.prognosis.laws import Life
from planted.histories import Columns, Told, until
from planted.metrics import covers, dummy
from proofs._verdict import ended, no_data
from proofs.life import CUTS

MOVING = (2, 3, 4, 7, 8, 9, 11, 12, 13, 14, 15, 17, 20, 21)
"""Sensors that are not constant."""
FIRST = 5
"""Column of sensor 1."""
LAST = 5
"""Cycles over which the level at the end is taken."""
WAYS = ("alone", "fleet")
HALF = 50
"""Engines up to this number are the first half."""


class Half(NamedTuple):
    """Health per cycle of the engines of one half, and of the other by the first one's scales."""

    known: list[Columns]
    others: list[Columns]
    limit: float


def engines(first: bool) -> Half:
    """One half and the other."""
    path = Path(os.environ["EVERTWIN_DATA"]) / "cmapss_fd001" / "train_FD001.txt"
    found = np.loadtxt(path)
    unit, cycle = found[:, 0].astype(int), found[:, 1]
    sensors = found[:, [FIRST + k - 1 for k in MOVING]]
    old = (unit <= HALF) == first
    z = (sensors - sensors[old].mean(axis=0)) / sensors[old].std(axis=0)
    side = np.sign([np.corrcoef(column, cycle[old])[0, 1] for column in z[old].T])
    health = (z * side).mean(axis=1)
    ends = [health[unit == k][-LAST:].mean() for k in np.unique(unit[old])]
    known, others = (
        [{"cycle": cycle[unit == k], "wear": health[unit == k]} for k in np.unique(unit[half])]
        for half in (old, ~old)
    )
    return Half(known, others, float(np.quantile(ends, 0.1)))


def passed(twin: Told, engine: Columns) -> float:
    """The cycle at which the limit was passed; NaN where it was not."""
    life = twin.life(engine)
    return life.passed or np.nan if isinstance(life, Life) else np.nan


def line(way: str, cut: str, rows: list[tuple[bool, bool, float]], asked: int) -> bool:
    """Prints one line of counts; whether they lie inside what is asked."""
    n = max(len(rows), 1)
    in80, in95 = (100 * sum(row[k] for row in rows) / n for k in (0, 1))
    error = np.median([row[2] for row in rows])
    print(
        f"{way:9s} {cut:4s} answered {len(rows)} of {asked}  80 %: {in80:5.1f}  95 %: {in95:5.1f}  "
        f"median |error| {error:.1f} cycles"
    )
    give80, give95 = (200 * np.sqrt(p * (1 - p) / n) for p in (0.8, 0.95))
    return bool(75 - give80 <= in80 <= 85 + give80 and 92 - give95 <= in95 <= 98 + give95)


def main() -> int:
    """Prints the counts; exit code 1 if the fleet's lie outside what is asked."""
    if "EVERTWIN_DATA" not in os.environ:
        return no_data()
    rows: dict[tuple[str, float], list[tuple[bool, bool, float]]] = defaultdict(list)
    plain: list[float] = []
    for first in (True, False):
        half = engines(first)
        with Told(limit=half.limit) as alone, Told(half.known, limit=half.limit) as fleet:
            mean = float(np.nanmean([passed(alone, one) for one in half.known]))
            for one in half.others:
                end = passed(alone, one)
                for cut in CUTS if np.isfinite(end) else ():
                    seen = until(one, cut * end)
                    now = float(seen["cycle"][-1])
                    truth = end - now
                    plain.append(abs(dummy(mean, now) - truth))
                    for way, twin in zip(WAYS, (alone, fleet), strict=True):
                        life = twin.life(seen)
                        if isinstance(life, Life):
                            held = [covers(x, truth) for x in (life.interval80, life.interval95)]
                            rows[way, cut].append((held[0], held[1], abs(life.median - truth)))
    ended_at = len(plain) // len(CUTS)
    print(f"{ended_at} of {2 * HALF} engines pass the limit")
    demands = {}
    for way in WAYS:
        for cut in CUTS:
            line(way, f"{cut:.0%}", rows[way, cut], ended_at)
        whole = [row for cut in CUTS for row in rows[way, cut]]
        inside = line(way, "all", whole, len(CUTS) * ended_at)
        if way == "fleet":
            demands["intervals with a fleet, all cuts"] = inside
    print(f"dummy: median |error| {np.median(plain):.1f} cycles")
    return ended(demands)


if __name__ == "__main__":
    sys.exit(main())
