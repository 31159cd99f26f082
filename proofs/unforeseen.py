"""Lives whose wear follows none of the predictor's laws: `python -m proofs.unforeseen [SERIES]`.

Five kinds (`STRANGERS` of `proofs/_planted.py`), none of them a law of the predictor, chosen and
drawn without regard to what it says; cuts at 30, 50, 70 and 90 % of each life, at least 500 series
per kind and cut. The predictor admits that wear follows none of its laws, and that life then ends
sooner (`evertwin.prognosis.laws.unforeseen`). Counted per way:

*laws only*: without that admission; *admitted*: as `predict_life` answers; with ``--fleet`` also
*fleet*: the same with a fleet of 24 like machines that ran to their end, a new one for every 100
series.

Asked: over all kinds and cuts, the admission holds no fewer true ends in the 95 % intervals, and
costs at most 5 % of the mean CRPS. What a single kind gets is printed, not asked: before a line
becomes steep nothing in it tells so.
"""

from __future__ import annotations

import argparse
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from itertools import repeat
from unittest import mock

import numpy as np
from proofs._planted import STRANGERS
from proofs._verdict import ended
from proofs.life import CUTS, Said, groups, indicator, said

from evertwin.prognosis.laws import Fleet, Indicator, Life, NotEnough, learn, predict, predict_life

WAYS = ("laws only", "admitted", "fleet")
COST = 1.05
"""Mean CRPS with the admission, at most, over that without."""

EACH = 100
"""Series that share a fleet."""

Judged = tuple[Said, bool]
"""A prediction judged, and whether life ended before its 95 % interval."""
Counts = dict[tuple[str, float], list[Judged]]
"""Per way and cut."""


def answers(seen: Indicator, fleet: Fleet | None) -> dict[str, Life | NotEnough]:
    """The predictions of one series per way."""
    with mock.patch.object(predict, "unforeseen", return_value=0.0):
        found = {"laws only": predict_life(seen)}
    found["admitted"] = predict_life(seen)
    if fleet is not None:
        found["fleet"] = predict_life(seen, fleet=fleet)
    return found


def counted(kind: str, series: int, seed: int, ways: tuple[str, ...]) -> Counts:
    """All judged predictions of one kind, per way and cut."""
    rows: Counts = {(way, cut): [] for way in ways for cut in CUTS}
    for machines, some in groups(kind, series, seed, EACH):
        fleet = learn(machines) if "fleet" in ways else None
        for one in some:
            for cut in CUTS:
                seen = indicator(one, cut)
                now = float(seen.at[-1])
                for way, life in answers(seen, fleet).items():
                    early = isinstance(life, Life) and one.life - now < life.interval95[0]
                    rows[way, cut].append((said(life, one, now), early))
    return rows


def line(kind: str, way: str, cut: str, rows: list[Judged]) -> tuple[float, float]:
    """Prints one line of counts; (share in the 95 % intervals, mean CRPS)."""
    told = [row for row, _ in rows if row.answered]
    k = max(len(told), 1)
    held, score = sum(r.in95 for r in told) / k, float(np.mean([r.score for r in told]))
    print(
        f"{kind:12s} {way:9s} {cut:4s} n {len(rows):4d} answered {100 * len(told) / len(rows):5.1f}"
        f" %  80 %: {100 * sum(r.in80 for r in told) / k:5.1f}  95 %: {100 * held:5.1f}  "
        f"ended before it {100 * sum(early for _, early in rows) / k:5.1f}  CRPS {score:.3f}  "
        f"error {np.median([r.error for r in told]):.3f}"
    )
    sys.stdout.flush()
    return held, score


def main() -> int:
    """Prints the counts; exit code 1 if the admission holds less or costs more than is asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("series", nargs="?", type=int, default=500)
    parser.add_argument("--kind", action="append", choices=STRANGERS)
    parser.add_argument("--fleet", action="store_true")
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    start, kinds = time.monotonic(), asked.kind or STRANGERS
    ways = WAYS if asked.fleet else WAYS[:2]
    every: dict[str, list[Judged]] = {way: [] for way in ways}
    with ProcessPoolExecutor() as pool:
        work = pool.map(counted, kinds, repeat(asked.series), repeat(asked.seed), repeat(ways))
        for kind, counts in zip(kinds, work):
            for (way, cut), rows in counts.items():
                line(kind, way, f"{cut:.0%}", rows)
                every[way] += rows
    whole = {way: line("all", way, "all", rows) for way, rows in every.items()}
    (before, plain), (held, score) = whole["laws only"], whole["admitted"]
    print(f"{time.monotonic() - start:.0f} s")
    return ended({"95 % hold no less": held >= before, "CRPS costs": score <= COST * plain})


if __name__ == "__main__":
    sys.exit(main())
