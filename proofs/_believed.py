"""Scores of lives beside the truth and four dummies."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from evertwin.prognosis.laws import Life
from evertwin.prognosis.laws.plans.alarms import LEAD, alarm_of
from evertwin.prognosis.laws.series.life import LEVELS
from evertwin.prognosis.outlook.lives import ComponentLife
from planted.metrics import covers, crps

CUTS = (0.3, 0.5, 0.7, 0.9)
DUMMIES = ("mean", "lives", "level", "zero")
RISK = 0.1
NARROW = 5.0


class Row(NamedTuple):
    """One question with its answer, scored."""

    cut: float
    answered: bool
    held: bool = False
    above: bool = False
    narrow: bool = False
    score: float = np.nan
    dummies: tuple[float, ...] = (np.nan,) * len(DUMMIES)
    due: bool = False
    early: bool = False


class Likes(NamedTuple):
    """What the dummies know of like machines: lives, and how each rose."""

    lives: np.ndarray
    ways: Sequence[tuple[np.ndarray, np.ndarray]] = ()
    """(time, value) of each until its end."""


def scored(one: ComponentLife, cut: float, truth: float, whole: float, likes: Likes) -> Row:
    """An answer beside its truth and the dummies."""
    life = one.life
    if not isinstance(life, Life):
        return Row(cut, answered=False)
    age = whole - truth
    beyond = likes.lives[likes.lives > age] - age
    left = [max(float(likes.lives.mean()) - age, 0.0)], beyond, matched(one, likes), [0.0]
    others = tuple(crps(_spread(x), truth) / whole for x in left)
    low, high = life.interval80
    lead = LEAD * (age + life.median)
    due = alarm_of("part", one.indicator, life, lead, RISK)
    failing = due is not None and due.kind == "failure_due"
    return Row(
        cut, True, covers((low, high), truth), low <= truth, low > 0.0 and high < NARROW * low,
        crps(life, truth) / whole, others, failing, failing and truth > 5.0 * lead,
    )  # fmt: skip


def _spread(left: Sequence[float] | np.ndarray) -> Life:
    known = np.asarray(left, dtype=np.float64)
    return Life("cycle", np.quantile(known, LEVELS) if len(known) else np.zeros(len(LEVELS)))


def matched(one: ComponentLife, likes: Likes) -> np.ndarray:
    """How long each like machine still lasted when its level was as it is now: medians of 12."""
    sign = one.indicator.limit.sign
    now = float(np.median(sign * one.indicator.value[-12:]))
    left = []
    for (at, value), life in zip(likes.ways, likes.lives, strict=False):
        windows = np.lib.stride_tricks.sliding_window_view(sign * value, min(12, len(value)))
        level = np.maximum.accumulate(np.median(windows, axis=1))
        k = min(int(np.searchsorted(level, now)) + len(value) - len(level), len(at) - 1)
        left.append(max(life - float(at[k]), 0.0))
    return np.array(left)


class Counted(NamedTuple):
    """What came of all questions at one cut."""

    asked: int
    answered: float
    held: float
    loss: float
    best: float
    """The best dummy's loss."""

    def meets(self, low: float, high: float) -> bool:
        """Whether the 99 % interval of what held reaches into low … high."""
        n = max(self.asked * self.answered, 1.0)
        half = 2.576 * np.sqrt(max(self.held * (1.0 - self.held), 0.25 / n) / n)
        return self.held + half >= low and self.held - half <= high


def line(name: str, found: Sequence[Row]) -> Mapping[float, Counted]:
    """Prints one line a cut."""
    out = {}
    for cut in CUTS:
        asked = [row for row in found if row.cut == cut]
        good = [row for row in asked if row.answered]
        n = max(len(good), 1)
        held = sum(row.held for row in good) / n
        others = np.mean([row.dummies for row in good], axis=0) if good else [np.nan] * 4
        loss = float(np.mean([row.score for row in good])) if good else np.nan
        out[cut] = Counted(
            len(asked), len(good) / max(len(asked), 1), held, loss, float(np.nanmin(others))
        )
        beside = ", ".join(f"{k} {x:.3f}" for k, x in zip(DUMMIES, others, strict=True))
        print(
            f"{name:20s} {cut:4.0%}  answered {out[cut].answered:4.0%} of {len(asked)}  "
            f"80 %: {held:4.0%}  above the lower end {sum(r.above for r in good) / n:4.0%}  "
            f"CRPS {loss:.3f} ({beside})  alarms too early {sum(r.early for r in good)} "
            f"of {sum(r.due for r in good)}"
        )
    sys.stdout.flush()
    return out
