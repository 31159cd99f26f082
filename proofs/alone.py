"""What a life told alone is corrected by: `python -m proofs.alone [N]`.

N (60 by default) series of each drawn law of `planted/unlike.py` and `planted/unseen.py`, and of
the sudden ones of `planted/sudden.py`, asked at `MOMENTS` of its life as `predict_life` asks.
Quantile regression (Koenker, Bassett 1978) of the logarithm of the true remaining life over the
median of the laws gives `LOW`, `HALF` and `HIGH` of `evertwin.prognosis.laws.alone`: every kind of
wear counts alike, and in it each answer as much as the stretch of life that it stands for. Exit
code 1 if one of the standing figures is off by more than `NEAR`.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np
import scipy

from evertwin.prognosis.laws import Indicator, Life, Limit, find_onset
from evertwin.prognosis.laws.alone import HALF, HIGH, LOW, bent, known_of, newest
from evertwin.prognosis.laws.predict import by_laws
from evertwin.prognosis.laws.scaled import scaled
from planted.sudden import SUDDEN
from planted.unlike import LEVELS as LAWS
from planted.unlike import Kind, Stranger, kind_of, stranger
from planted.unseen import UNSEEN
from proofs._verdict import ended

MOMENTS = np.array([0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98])
STRETCHES = np.gradient(MOMENTS)
EACH = 4
"""Series of one kind of machine."""
NEAR = 0.15
WEIGHED = {0.5: (2, 3, 4, 5), 0.06: (0, 2, 5), 0.9: (0, 1, 2, 3, 4, 5)}
"""What counts for each quantile: a constant, own, lately, bend, young, rush. The median of a
straight line stays; the lower end does not lean on the laws' own width, as sudden ends look
calm, and on *young* as much as the median, so that what is young is not taken for near its end."""
YOUNG = 4


def asked(kind: Kind, one: Stranger, moment: float) -> tuple[float, np.ndarray] | None:
    """(logarithm of the true life over the laws' median, what is known); None: no answer."""
    seen = one.at <= moment * one.life
    side = "above" if kind.limit > kind.new else "below"
    history = Indicator.of("wear", "1", Limit(kind.limit, side), one.at[seen], one.value[seen])
    lately = newest(history)
    whole, recent = scaled(history, most=0), scaled(lately)
    if isinstance(whole, str) or isinstance(recent, str) or find_onset(history) is None:
        return None
    life = by_laws(lately, recent)
    if not isinstance(life, Life) or life.passed is not None:
        return None
    known = known_of(life.remaining, bent(whole))
    if known is None:
        return None
    half, columns = known
    return float(np.log((one.life - float(history.at[-1])) / half)), columns


def quantile(columns: np.ndarray, y: np.ndarray, weight: np.ndarray, level: float) -> np.ndarray:
    """Coefficients of a linear quantile of ``y``."""
    n, p = columns.shape
    cost = np.r_[np.zeros(p), level * weight, (1.0 - level) * weight]
    sides = scipy.sparse.hstack(
        [scipy.sparse.csr_matrix(columns), scipy.sparse.eye(n), -scipy.sparse.eye(n)]
    )
    bounds = [(None, None)] * p + [(0.0, None)] * (2 * n)
    found = scipy.optimize.linprog(cost, A_eq=sides, b_eq=y, bounds=bounds, method="highs")
    return np.asarray(found.x[:p])


def main() -> int:
    """Prints the figures; exit code 1 if one that stands is off."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("series", nargs="?", type=int, default=60)
    parser.add_argument("--seed", type=int, default=7)
    told = parser.parse_args()
    rows, laws, shares = [], [], []
    names = (*LAWS, *UNSEEN, *SUDDEN)
    for number, law in enumerate(names):
        for k in range(-(-told.series // EACH)):
            rng = np.random.default_rng([told.seed, number, k])
            kind = kind_of(law, rng)
            for _ in range(EACH):
                one = stranger(kind, rng)
                for moment, share in zip(MOMENTS.tolist(), STRETCHES.tolist(), strict=True):
                    if (row := asked(kind, one, moment)) is not None:
                        rows.append(row)
                        laws.append(number)
                        shares.append(share)
    y, columns = np.array([row[0] for row in rows]), np.stack([row[1] for row in rows])
    weight = np.array(shares) / np.bincount(laws, shares)[laws]
    demands = {}
    held = np.zeros(6)
    for (level, known), standing in zip(WEIGHED.items(), (HALF, LOW, HIGH), strict=True):
        new = np.where(np.arange(6) == YOUNG, held, 0.0)
        rest = y if YOUNG in known else y - columns @ new
        new[list(known)] = quantile(columns[:, list(known)], rest, weight * len(y), level)
        held = new if level == 0.5 else held
        print(f"{level:4.0%}  {np.round(new, 2).tolist()}  standing {standing.tolist()}")
        demands[f"the quantile at {level:.0%}"] = bool(np.max(np.abs(new - standing)) <= NEAR)
    print(f"{len(y)} answers to {told.series} series of each of {len(names)} laws")
    return ended(demands)


if __name__ == "__main__":
    sys.exit(main())
