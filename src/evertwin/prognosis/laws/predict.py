"""Prediction of the remaining life: all laws at once, weighted by how well they foresaw the data.

The hypotheses are looked at (`hypotheses`), mixed to one distribution of the first
passage (`mixture`), first roughly, then sharply where the probability lies. A fleet of like
machines corrects the outcome; a life told alone waits for its wear to begin (`onset`) and is as
wide as was measured on wear that follows none of the laws (`alone`).

>>> from evertwin.prognosis.laws.indicator import Limit
>>> rng = np.random.default_rng(0)
>>> t = np.arange(50.0)
>>> wear = Indicator.of("wear", "mm", Limit(1.0), t, 0.01 * t + 0.01 * rng.standard_normal(50))
>>> life = predict_life(wear)
>>> life.law in LAWS, 45.0 < life.median < 55.0
(True, True)

A fleet's prior comes from histories that ran to their limit (`learn`). Each is predicted with what
was known at several moments of its life, by a prior from the others, as in cross-validation.

>>> from evertwin.prognosis.laws.indicator import Limit
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
from typing import NamedTuple

import numpy as np

from evertwin.errors import UsageError
from evertwin.prognosis.laws.alone import newest, widened
from evertwin.prognosis.laws.fleet import ALIKE, Fleet, Member, Way
from evertwin.prognosis.laws.hypotheses import LAWS, every_look, families, look, sharpened
from evertwin.prognosis.laws.indicator import Indicator
from evertwin.prognosis.laws.life import Life, NotEnough, Onset, Workload, quantiles
from evertwin.prognosis.laws.mixture import COARSE, density_of, fine_nodes, mixture
from evertwin.prognosis.laws.onset import SHARE, SHORT, find_onset, medians
from evertwin.prognosis.laws.scaled import Problem, noise_of, scaled

FAR = 20.0
"""A median beyond so many ages is no answer: growth is not told from none."""
ANY = Fleet()
LASTING = 3
"""Values beyond the limit that end a life; a single one does not."""


def predict_life(
    indicator: Indicator, laws: Sequence[str] = LAWS, fleet: Fleet | None = None
) -> Life | NotEnough:
    """The remaining life as a distribution, or what the data lack for one.

    Args:
        indicator: the history; only its current life counts.
        laws: laws that may hold, some of `LAWS`.
        fleet: what like machines tell.
    """
    if (failed := indicator.failed) is not None:
        now = float(indicator.at[-1]) if len(indicator.at) else failed
        none = quantiles(np.zeros(1), np.ones(1))
        return Life(indicator.clock, none, now, passed=failed, failed=True,
                    calendar=indicator.calendar)  # fmt: skip
    problem = scaled(indicator)
    if isinstance(problem, str):
        return NotEnough(problem)
    onset = find_onset(indicator)
    found = replace(from_problem(indicator, problem, laws, fleet, onset), onset=onset)
    if isinstance(found, NotEnough) and found.onset is not None:
        begun = f"; wear has begun at {indicator.moment(found.onset.begin)}"
        return replace(found, reason=found.reason + begun)
    if isinstance(found, NotEnough):
        return found
    found = replace(found, calendar=indicator.calendar)
    if indicator.usage is None:
        return found
    return found.through(Workload.as_before(indicator), indicator.clock)


def from_problem(
    indicator: Indicator, problem: Problem, laws: Sequence[str], fleet: Fleet | None,
    onset: Onset | None,
) -> Life | NotEnough:  # fmt: skip
    """The life on the law's own clock: by a fleet, or as wide as one told alone has to be."""
    found = by_laws(indicator, problem, laws, fleet if fleet is not None else ANY)
    if fleet is not None or (isinstance(found, Life) and found.passed is not None):
        return found
    if onset is None:
        return not_begun(indicator, problem)
    lately = newest(indicator)
    recent = scaled(lately)
    told = found if isinstance(recent, str) else by_laws(lately, recent, laws)
    told = found if isinstance(told, NotEnough) or told.passed is not None else told
    if isinstance(told, NotEnough):
        return told
    remaining = widened(told.remaining)
    return (
        not_begun(indicator, problem) if remaining is None else replace(told, remaining=remaining)
    )


def by_laws(
    indicator: Indicator, problem: Problem, laws: Sequence[str] = LAWS, prior: Fleet = ANY
) -> Life | NotEnough:
    """What the laws say, as if one of them held for certain."""
    density = density_of(prior, problem.age)
    looks = every_look(problem, laws, prior)
    if not looks:
        return NotEnough(f"values that one of the laws {', '.join(laws)} allows")
    rough = mixture(problem, looks, COARSE, density)
    if rough.passed > 0.5 or beyond_for_good(indicator):
        return over(indicator, problem)
    looks = sharpened(problem, looks, rough.share, prior)
    found = mixture(problem, looks, fine_nodes(rough.cdf), density)
    # What does not grow yet lasts as long as like machines do.
    rest = found.unknown * prior.ending(problem.age, found.nodes * problem.age)
    found = found._replace(cdf=found.cdf + rest)
    half = float(np.interp(0.5, found.cdf, found.nodes)) if found.cdf[-1] > 0.5 else np.inf
    if half > FAR and not prior.knows_lives:
        return not_begun(indicator, problem)
    nodes = np.union1d(found.nodes, COARSE)
    cdf = prior.ending(problem.age, nodes * problem.age)  # where no growth says more
    if half <= FAR:
        cdf = prior.calibrated(np.interp(nodes, found.nodes, found.cdf), 1.0 / (1.0 + half))
    told = prior.levelled(quantiles(nodes, cdf) * problem.age, level_now(indicator, problem))
    return Life(indicator.clock, told, problem.now, found.laws)


def level_now(indicator: Indicator, problem: Problem) -> tuple[float, float, float]:
    """(level of the newest values, age, what is alike) in the indicator's own units."""
    way = way_of(indicator)
    first = float(way.level[0])
    limit = indicator.limit.sign * indicator.limit.value
    return float(way.level[-1]), problem.age, ALIKE * abs(limit - first)


def way_of(indicator: Indicator, end: float = np.nan) -> Way:
    """How the level rose: medians of the newest values, as the highest one so far."""
    life = indicator.since_replaced()
    good = np.flatnonzero(np.isfinite(life.value))
    clock = life.at if life.usage is None else life.usage
    origin = float(clock[0] if life.origin is None or life.usage is not None else life.origin)
    y = life.limit.sign * life.value[good]
    level = np.maximum.accumulate(medians(y, int(np.clip(len(y) // 4, 1, SHORT))))
    return Way(clock[good] - origin, level, end)


def beyond_for_good(indicator: Indicator) -> bool:
    """Do the newest values lie beyond the limit, as many as end a life?

    Not where temperature, load or warm-up move them: the limit holds at the reference alone.
    """
    life = indicator.since_replaced()
    if life.covariates:
        return False
    apart = life.distance()[np.isfinite(life.value)]
    return len(apart) >= LASTING and bool(np.all(apart[-LASTING:] <= 0.0))


def over(indicator: Indicator, problem: Problem) -> Life:
    """The answer where the limit is passed, with when: the first value that stayed beyond."""
    life = indicator.since_replaced()
    good = np.flatnonzero(np.isfinite(life.value))
    beyond = life.distance()[good] <= 0.0
    follows = np.append(beyond, np.ones(LASTING, dtype=np.bool_))
    stayed = np.all([follows[k : k + len(beyond)] for k in range(LASTING)], axis=0)
    at = float(life.at[good[int(np.argmax(stayed))]]) if stayed.any() else problem.now
    none = quantiles(np.zeros(1), np.ones(1))
    return Life(indicator.clock, none, problem.now, passed=at)


def not_begun(indicator: Indicator, problem: Problem) -> NotEnough:
    """The answer where growth is not established: how much of it would be."""
    noise = noise_of(problem.y) * problem.scale
    if not np.ptp(problem.y) > 0.0:
        return NotEnough(f"values that change: all {len(problem.y)} are alike so far")
    first = problem.y[: max(len(problem.y) // 3, 3)]
    way = SHARE * (problem.limit - float(np.median(first))) * problem.scale
    return NotEnough(
        f"growth that stands out: {indicator.shown(max(way, 3.0 * noise))} towards the limit from "
        "the lowest level so far, held for as many values as a median needs, and steady enough to "
        "be followed",
        f"growth is not established over a scatter of {indicator.shown(noise)}",
    )


AROUND = 8
"""Values around a crossing at which the level is looked at."""
MEMORY = 100
"""Values before it that it is filtered over."""
MOMENTS = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
"""Shares of the life at which each history is predicted."""


class End(NamedTuple):
    """When a history passed its limit.

    >>> End(120.0, 1.5).age
    120.0
    """

    age: float
    unsure: float
    """Standard deviation of the age: noise blurs the passage."""
    failed: bool = False
    """It failed before its limit, as was said."""


def lived(indicator: Indicator) -> End | None:
    """Age at which it failed, or the level, freed of noise, passed the limit; None: neither.

    A single value beyond the limit ends no life: the two that follow it must lie there as well.
    The level is that of a Wiener process with noise, filtered over the values before.
    """
    life = indicator.since_replaced()
    good = np.flatnonzero(np.isfinite(life.value))
    beyond = life.distance()[good] <= 0.0
    follows = np.append(beyond, beyond[-1:].repeat(2))
    kept = follows[:-2] & follows[1:-1] & follows[2:]
    clock = life.at if life.usage is None else life.usage
    origin = float(clock[0] if life.origin is None or life.usage is not None else life.origin)
    first = int(np.argmax(kept))
    failed = life.failed
    if failed is not None and not (kept.any() and life.at[good[first]] <= failed):
        step = float(np.median(np.diff(clock))) if len(clock) > 1 else 0.0
        return End(float(np.interp(failed, life.at, clock)) - origin, step, failed=True)
    if not kept.any():
        return None
    near = range(max(first - AROUND, 1), min(first + AROUND + 1, len(good)))
    level = np.array([_level(life, good[max(0, k - MEMORY) : k + 1]) for k in near])
    at = clock[good[near.start : near.stop]]
    after = np.flatnonzero(level[:, 0] > 0.0) if len(level) else np.zeros(0, dtype=np.int64)
    step = float(clock[good[first]] - clock[good[max(first - 1, 0)]])
    if not len(after) or after[0] == 0:
        return End(float(clock[good[first]]) - origin, step)
    k = int(after[0])
    gap, spread = level[:, 0], level[k, 1]
    age = at[k - 1] + (at[k] - at[k - 1]) * -gap[k - 1] / (gap[k] - gap[k - 1]) - origin
    slope = (gap[-1] - gap[0]) / (at[-1] - at[0])
    unsure = spread / slope if slope > 0.0 else step
    return End(float(age), float(np.hypot(unsure, step / np.sqrt(12.0))))


def _level(life: Indicator, rows: np.ndarray) -> tuple[float, float]:
    """(filtered level at the last of some rows less the limit, its standard deviation)."""
    problem = scaled(replace(life.rows(rows), origin=None, maintenance=()))
    if isinstance(problem, str):
        return float(-life.distance()[rows[-1]]), 0.0
    found = look(problem, families(("wiener",))[0])
    weight = np.exp(found.weight - found.weight.max())
    weight /= weight.sum()
    known = found.posterior
    variance = float(weight @ (known.cov[:, 0] * known.square)) / known.dof
    gap = float(weight @ known.now) - problem.limit
    return gap * problem.scale, float(np.sqrt(max(variance, 0.0))) * problem.scale


def learn(histories: Sequence[Indicator], laws: Sequence[str] = LAWS) -> Fleet:
    """The prior that a fleet of like machines gives.

    Raises `UsageError` unless at least two lives ended.

    Args:
        histories: one indicator per machine, by name, with all its lives; those that neither failed
            nor passed their limit count with their age.
        laws: laws that may hold.
    """
    every = [history.lives() for history in histories]
    lives = [one for own in every for one in own]
    newest = [one is own[-1] for own in every for one in own]
    ends = [lived(one) for one in lives]
    members = tuple(map(member, lives, ends, newest))
    ended = [(h, end) for h, end in zip(lives, ends) if end is not None and end.age > 0.0]
    if len(ended) < 2:
        got = "; ".join(one.said for one in members) or "none"
        raise UsageError(f"fleet: expected at least two lives that ended, got {got}")
    running = [one.age for one in members if not one.ended]
    known = np.array([end.age for _, end in ended])
    shares = law_shares(ended, laws)
    said: list[tuple[float, float, float]] = []
    for k, (history, end) in enumerate(ended):
        others = np.delete(known, k)
        prior = replace(Fleet.of_lives(others, running), laws=shares) if len(others) > 1 else None
        for moment in MOMENTS:
            part = before(history, moment * end.age)
            life = predict_life(part, laws, prior)
            if isinstance(life, Life) and len(part.at):
                said.append(rank(life, float(part.at[-1] - _start(history)), end))
    table = np.array(said).reshape(-1, 3)
    whole = Fleet.of_lives(known, running)
    ways = tuple(way_of(history, end.age) for history, end in ended)
    return replace(
        whole, laws=shares, ranks=table[:, 0], passed=table[:, 1], trust=table[:, 2], ways=ways,
        members=members,
    )  # fmt: skip


def member(life: Indicator, end: End | None, newest: bool) -> Member:
    """A life with its label; ``newest``: no other began after it on the same machine."""
    if end is not None:
        return Member(life.name, life.clock, end.age, "failed" if end.failed else "limit")
    age = float(life.at[-1]) - _start(life)
    return Member(life.name, life.clock, age, "running" if newest else "replaced")


def before(history: Indicator, age: float) -> Indicator:
    """What was known at an age; that it failed is not known before it does."""
    part = history.until(_start(history) + age)
    return part.with_(maintenance=tuple(m for m in part.maintenance if m.kind != "failed"))


def rank(life: Life, now: float, end: End) -> tuple[float, float, float]:
    """(probability told for the true end or earlier, share of the life passed, trust).

    A prediction about as sharp as the end itself is known tells little of its own spread: it is
    trusted less.
    """
    spread = 0.5 * (life.quantile(0.84) - life.quantile(0.16))
    blur = 2.0 * end.unsure / spread if spread > 0.0 else np.inf
    trust = 1.0 / (1.0 + blur * blur)
    return life.probability_before(end.age - now), now / (now + life.median), trust


def law_shares(ended: Sequence[tuple[Indicator, End]], laws: Sequence[str]) -> dict[str, float]:
    """Share of each law at 9/10 of each life."""
    total = dict.fromkeys(laws, 0.5)
    for history, end in ended:
        part = before(history, 0.9 * end.age)
        problem = scaled(part)
        if isinstance(problem, str):
            continue
        for law, share in by_laws(part, problem, laws).laws.items():
            total[law] += share
    whole = sum(total.values())
    return {law: share / whole for law, share in total.items()}


def _start(history: Indicator) -> float:
    return float(history.at[0]) if history.origin is None else history.origin
