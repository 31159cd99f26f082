"""What a life told alone is corrected by: `python -m proofs.alone [N]`.

N (60 by default) series of each drawn law of `planted/unlike.py`, `planted/unseen.py` and
`planted/uneven.py`, and of the sudden ones of `planted/sudden.py`, asked at `MOMENTS` of its life
as `predict_life` asks. Quantile regression (Koenker, Bassett 1978) of the true remaining life over
the median of the laws gives `LOW`, `HALF` and `HIGH` of `evertwin.prognosis.laws.wear.alone`: ends
in logarithms, the median in whole lives, as its loss is counted. Every kind of wear counts alike,
and in it each answer as much as the stretch of life that it stands for. Exit code 1 if answers move
by more than `NEAR` (mean of the logarithms) with the figures found here.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from evertwin.prognosis.laws import Indicator, Life, Limit, find_onset
from evertwin.prognosis.laws.predict import by_laws
from evertwin.prognosis.laws.series.scaled import scaled
from evertwin.prognosis.laws.wear.alone import HALF, HIGH, LOW, known_of, newest, pace_of
from planted.sudden import SUDDEN
from planted.uneven import UNEVEN
from planted.unlike import LEVELS as LAWS
from planted.unlike import Kind, Stranger, kind_of, stranger
from planted.unseen import UNSEEN
from proofs._verdict import ended

MOMENTS = np.array([0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98])
STRETCHES = np.gradient(MOMENTS)
EACH = 4
"""Series of one kind of machine."""
NEAR = 0.3
WEIGHED = {0.5: (1, 3, 4), 0.1: (0, 1, 2, 3, 4), 0.92: (0, 1, 2, 4)}
"""What counts for each quantile: a constant, own, young, own · young, rush. The median of a
straight line, which the laws are sure of, stays."""
SMOOTH = 0.01
"""Errors below this have no kink."""


class Answer(NamedTuple):
    """What the laws say, and the truth."""

    half: float
    """Their median."""
    left: float
    whole: float
    known: np.ndarray


def asked(kind: Kind, one: Stranger, moment: float) -> Answer | None:
    """What is known at a moment; None: no answer."""
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
    known = known_of(life.remaining, pace_of(whole))
    if known is None:
        return None
    return Answer(known[0], one.life - float(history.at[-1]), one.life, known[1])


def quantile(
    columns: np.ndarray, rows: Sequence[Answer], weight: np.ndarray, level: float
) -> np.ndarray:
    """Coefficients of a quantile: linear in the logarithm; the median's loss in whole lives."""
    half, left, whole = (np.array([getattr(row, k) for row in rows]) for k in Answer._fields[:3])
    size = np.sqrt(np.mean(columns**2, axis=0))

    def loss(x: np.ndarray, lives: bool) -> tuple[float, np.ndarray]:
        away = np.minimum(columns / size @ x, 5.0)
        told = half * np.exp(away) / whole
        off = left / whole - told if lives else np.log(left / half) - away
        bow = np.sqrt(off * off + SMOOTH * SMOOTH)
        turn = weight * ((level - 0.5) + 0.5 * off / bow) * (told if lives else 1.0)
        return float(weight @ ((level - 0.5) * off + 0.5 * bow)), -(columns / size).T @ turn

    found = np.zeros(columns.shape[1])
    for lives in (False, True) if level == 0.5 else (False,):
        found = scipy.optimize.minimize(loss, found, (lives,), "L-BFGS-B", jac=True).x
    return np.asarray(found / size)


def main() -> int:
    """Prints the figures; exit code 1 if one that stands is off."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("series", nargs="?", type=int, default=60)
    parser.add_argument("--seed", type=int, default=7)
    told = parser.parse_args()
    rows, laws, shares = [], [], []
    names = (*LAWS, *UNSEEN, *SUDDEN, *UNEVEN)
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
    weight = np.array(shares) / np.bincount(laws, shares)[laws] / len(names)
    demands = {}
    columns = np.stack([row.known for row in rows])
    for (level, known), standing in zip(WEIGHED.items(), (HALF, LOW, HIGH), strict=True):
        new = np.zeros(len(standing))
        new[list(known)] = quantile(columns[:, list(known)], rows, weight, level)
        print(f"{level:4.0%}  {np.round(new, 2).tolist()}  standing {standing.tolist()}")
        moved = float(weight @ np.abs(columns @ (new - standing)))
        print(f"      moves answers by {moved:.2f}")
        demands[f"the quantile at {level:.0%}"] = moved <= NEAR
    print(f"{len(rows)} answers to {told.series} series of each of {len(names)} laws")
    return ended(demands)


if __name__ == "__main__":
    sys.exit(main())
