"""A fleet's prior from histories that ran to their limit.

Each history is predicted with what was known at several moments of its life, by a prior from the
others, as in cross-validation.

>>> from evertwin.prognosis.indicator import Limit
>>> rng = np.random.default_rng(0)
>>> def machine(k):
...     t = np.arange(40.0)
...     noise = 0.01 * rng.standard_normal(40)
...     return Indicator.of("wear", "mm", Limit(1.0), t, t / (28.0 + k) + noise)
>>> fleet = learn([machine(k) for k in range(4)])
>>> len(fleet.ranks), round(sum(fleet.laws.values()), 3)
(28, 1.0)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from evertwin.errors import UsageError
from evertwin.prognosis.fleet import Fleet
from evertwin.prognosis.indicator import Indicator
from evertwin.prognosis.laws import LAWS
from evertwin.prognosis.life import Life
from evertwin.prognosis.predict import predict_life

__all__ = ["learn", "lived"]

MOMENTS = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
"""Shares of the life at which each history is predicted."""


def lived(indicator: Indicator) -> float | None:
    """Age at which the indicator passed its limit for good; None if it did not.

    A value counts as passed if the two after it are beyond the limit as well, so that an outlier
    ends no life.
    """
    life = indicator.since_replaced()
    good = np.isfinite(life.value)
    beyond = life.distance()[good] <= 0.0
    if not beyond.any():
        return None
    follows = np.append(beyond, [beyond[-1], beyond[-1]])
    kept = follows[:-2] & follows[1:-1] & follows[2:]
    if not kept.any():
        return None
    at = life.at[good] if life.usage is None else life.usage[good]
    origin = life.at[0] if life.origin is None or life.usage is not None else life.origin
    return float(at[np.argmax(kept)] - (at[0] if life.usage is not None else origin))


def learn(histories: Sequence[Indicator], laws: Sequence[str] = LAWS) -> Fleet:
    """The prior that a fleet of like machines gives.

    Raises `UsageError` unless at least two histories passed their limit.

    Args:
        histories: one indicator per machine; those that did not pass count as still running.
        laws: laws that may hold.
    """
    lives = [lived(history) for history in histories]
    ended = [(h, age) for h, age in zip(histories, lives) if age is not None and age > 0.0]
    if len(ended) < 2:
        raise UsageError(
            f"fleet: expected at least two histories that passed their limit, got {len(ended)}"
        )
    running = [float(h.at[-1] - h.at[0]) for h, age in zip(histories, lives) if age is None]
    known = np.array([age for _, age in ended])
    whole = Fleet.of_lives(known, running)
    shares = law_shares([h for h, _ in ended], laws)
    whole = replace(whole, laws=shares)
    ranks: list[float] = []
    passed: list[float] = []
    for k, (history, age) in enumerate(ended):
        others = np.delete(known, k)
        prior = replace(Fleet.of_lives(others, running), laws=shares) if len(others) > 1 else None
        for moment in MOMENTS:
            part = history.until(_start(history) + moment * age)
            life = predict_life(part, laws, prior)
            if isinstance(life, Life) and len(part.at):
                now = float(part.at[-1] - _start(history))
                ranks.append(life.probability_before(age - now))
                passed.append(now / (now + life.median))
    return replace(whole, ranks=np.array(ranks), passed=np.array(passed))


def law_shares(histories: Sequence[Indicator], laws: Sequence[str]) -> dict[str, float]:
    """Share of each law at 9/10 of each life."""
    total = dict.fromkeys(laws, 0.5)
    for history in histories:
        age = lived(history) or 0.0
        life = predict_life(history.until(_start(history) + 0.9 * age), laws)
        for law, share in life.laws.items():
            total[law] += share
    whole = sum(total.values())
    return {law: share / whole for law, share in total.items()}


def _start(history: Indicator) -> float:
    return float(history.at[0]) if history.origin is None else history.origin
