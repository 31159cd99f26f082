"""Prediction of the remaining life: by like machines where there are some, else by laws of wear.

By laws: the hypotheses are looked at (`hypotheses`), mixed to one distribution of the first passage
(`mixture`), first roughly, then sharply where the probability lies. A life told alone waits for its
wear to begin (`onset`) and is as wide as was measured on wear that follows none of the laws
(`alone`). With a fleet its levels are asked (`fleet`), and laws by the chance that this one wears
in another form (`likeness`).

>>> from evertwin.prognosis.laws.series.indicator import Limit
>>> rng = np.random.default_rng(0)
>>> t = np.arange(50.0)
>>> wear = Indicator.of("wear", "mm", Limit(1.0), t, 0.01 * t + 0.01 * rng.standard_normal(50))
>>> life = predict_life(wear)
>>> life.law in LAWS, 40.0 < life.median < 60.0
(True, True)

A fleet is learned from histories of like machines, at least two of which ended.

>>> def machine(k):
...     t = np.arange(40.0)
...     noise = 0.01 * rng.standard_normal(40)
...     return Indicator.of("wear", "mm", Limit(1.0), t, t / (28.0 + k) + noise)
>>> fleet = learn([machine(k) for k in range(4)])
>>> len(fleet.ways), predict_life(wear, fleet=fleet).pace > 1.3
(4, True)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from evertwin.errors import UsageError
from evertwin.prognosis.laws.growth.lasting import comes_and_goes, flat_since
from evertwin.prognosis.laws.growth.onset import SHARE, find_onset
from evertwin.prognosis.laws.growth.way import LEAST, Way, way_of
from evertwin.prognosis.laws.likes.fleet import Fleet, Member
from evertwin.prognosis.laws.likes.likeness import at_some_age, by_chance
from evertwin.prognosis.laws.series.crowded import by_time
from evertwin.prognosis.laws.series.indicator import Indicator
from evertwin.prognosis.laws.series.life import LEVELS, Life, NotEnough, Onset, Workload, quantiles
from evertwin.prognosis.laws.series.proportional import by_share
from evertwin.prognosis.laws.series.scaled import Problem, noise_of, scaled, steady
from evertwin.prognosis.laws.series.swing import without_swing
from evertwin.prognosis.laws.wear.alone import Pace, newest, pace_of, widened
from evertwin.prognosis.laws.wear.hypotheses import LAWS, every_look, sharpened
from evertwin.prognosis.laws.wear.mixture import COARSE, fine_nodes, mixture, never

FAR = 20.0
"""A median beyond so many ages is no answer: growth is not told from none."""
LASTING = 3
"""Values beyond the limit that end a life; a single one does not."""


def predict_life(
    indicator: Indicator, laws: Sequence[str] = LAWS, fleet: Fleet | None = None
) -> Life | NotEnough:
    """The remaining life as a distribution, or what the data lack for one.

    Newest values beyond the limit that are too few to end a life do not lengthen it.

    Args:
        indicator: the history; only its current life counts.
        laws: laws that may hold, some of `LAWS`.
        fleet: what like machines tell.
    """
    found, few = _predicted(indicator, laws, fleet), held_back(indicator)
    if not few or (isinstance(found, Life) and found.passed is not None):
        return found
    kept = np.flatnonzero(np.isfinite(indicator.value))[:-few]
    rest = indicator.rows(kept).seen_at(float(indicator.at[-1]))
    without = _predicted(rest, laws, fleet)
    if isinstance(without, NotEnough) or without.passed is not None:
        return found
    if isinstance(found, NotEnough):
        return without
    worn = np.minimum(found.wearing.remaining, without.wearing.remaining)
    return replace(found, remaining=np.minimum(found.remaining, without.remaining), worn=worn)


def _predicted(
    indicator: Indicator, laws: Sequence[str], fleet: Fleet | None
) -> Life | NotEnough:  # fmt: skip
    """The same, whatever the newest values are."""
    if (failed := indicator.failed) is not None:
        now = float(indicator.at[-1]) if len(indicator.at) else failed
        none = quantiles(np.zeros(1), np.ones(1))
        return Life(indicator.clock, none, now, passed=failed, failed=True,
                    calendar=indicator.calendar)  # fmt: skip
    problem = scaled(indicator) if fleet is None else scaled(indicator, least=LEAST)
    if isinstance(problem, str):
        return NotEnough(problem)
    even = by_time(indicator)
    even = by_share(even if fleet is None else towards_end(even, fleet))
    onset = find_onset(even)
    way = None if fleet is None else way_of(indicator)
    if beyond_for_good(indicator) or (way is not None and way.level[-1] >= 0.0):
        found: Life | NotEnough = over(indicator, problem)
    elif fleet is not None and way is not None:
        told = fleet.told_of(way)
        by_age = fleet.by_age(way) if onset is None else None
        own, _ = alone(even, laws, onset)
        own_ends = own.remaining if isinstance(own, Life) else at_some_age(problem.age)
        found = Life(
            indicator.clock, by_chance(told.remaining, own_ends, told.other), problem.now,
            pace=told.pace, by_age=by_age, other=told.other,
        )  # fmt: skip
    else:
        found, onset = alone(even, laws, onset)
    found = replace(found, onset=onset)
    if isinstance(found, NotEnough) and found.onset is not None:
        begun = f"; wear has begun at {indicator.moment(found.onset.begin)}"
        return replace(found, reason=found.reason + begun)
    if isinstance(found, NotEnough):
        return found
    found = replace(found, calendar=indicator.calendar)
    if indicator.usage is None:
        return found
    return found.through(Workload.as_before(indicator), indicator.clock)


def towards_end(indicator: Indicator, fleet: Fleet) -> Indicator:
    """With the level as limit that like machines come to at most, where they fail before it."""
    limit, short = indicator.limit, min(fleet.reach, 0.0)
    return indicator.with_(limit=replace(limit, value=limit.value + limit.sign * short))


def alone(
    indicator: Indicator, laws: Sequence[str], onset: Onset | None
) -> tuple[Life | NotEnough, Onset | None]:
    """The life on the law's own clock, as wide as one told alone has to be; its onset if it stands.

    Growth that has ended, or comes and goes, tells neither a life nor an onset.
    """
    calm = without_swing(indicator)
    problem = scaled(calm)
    if isinstance(problem, str):
        return NotEnough(problem), onset
    found = by_laws(calm, problem, laws)
    if isinstance(found, Life) and found.passed is not None:
        return found, onset
    if onset is None:
        return not_begun(indicator, problem), None
    if (still := stands_still(indicator)) is not None:
        return still, None
    level = never(problem, laws)
    if level > 0.5:
        return NotEnough(
            "growth that goes on to the limit: it slows down towards a level this side of it, with "
            f"probability {level:.2f}",
            "growth is not established beyond that level",
        ), None
    lately = newest(calm)
    recent, whole = scaled(lately), scaled(calm, most=0)
    newer = found if isinstance(recent, str) else by_laws(lately, recent, laws)
    newer = found if isinstance(newer, NotEnough) or newer.passed is not None else newer
    if isinstance(newer, NotEnough):
        return newer, onset
    pace = pace_of(problem if isinstance(whole, str) else whole)
    told = widened(newer.remaining, pace)
    if told is None:
        return slows(newer, pace) or not_begun(indicator, problem), onset
    ends, worn = (np.where(1.0 - level > LEVELS, one, np.inf) for one in told)
    return replace(newer, remaining=ends, worn=worn), onset


def slows(newer: Life, pace: Pace) -> NotEnough | None:
    """The answer where growth slowed down too much to be followed; None where it did not."""
    if pace.slowing == -np.inf or widened(newer.remaining, pace._replace(slowing=-np.inf)) is None:
        return None
    now, slower = newer.median / np.exp(pace.age), float(np.exp(pace.slowing - pace.age))
    return NotEnough(
        "values until it shows whether growth slows down further",
        f"it will last {now:.2g} times as long as it has at the newest pace, {slower:.2g} times if "
        "growth slows down as it did so far",
    )


def stands_still(indicator: Indicator) -> NotEnough | None:
    """The answer where growth has ended, or comes and goes; None where it goes on."""
    if (flat := flat_since(indicator)) is not None:
        since = indicator.moment(flat.since)
        return NotEnough(
            f"growth that goes on: {indicator.shown(flat.rise)} towards the limit since {since}",
            f"growth is not established: the level has been flat since {since}",
        )
    if comes_and_goes(indicator):
        return NotEnough(
            "growth that stays, beyond every rise that was given back so far",
            "growth is not established over what comes and goes",
        )
    return None


def by_laws(indicator: Indicator, problem: Problem, laws: Sequence[str] = LAWS) -> Life | NotEnough:
    """What the laws say, as if one of them held for certain."""
    looks = every_look(problem, laws)
    if not looks:
        return NotEnough(f"values that one of the laws {', '.join(laws)} allows")
    rough = mixture(problem, looks, COARSE)
    if (rough.passed > 0.5 and not still_sound(indicator)) or beyond_for_good(indicator):
        return over(indicator, problem)
    looks = sharpened(problem, looks, rough.share)
    found = mixture(problem, looks, fine_nodes(rough.cdf))
    half = float(np.interp(0.5, found.cdf, found.nodes)) if found.cdf[-1] > 0.5 else np.inf
    if half > FAR:
        return not_begun(indicator, problem)
    told = quantiles(found.nodes, found.cdf) * problem.age
    return Life(indicator.clock, told, problem.now, found.laws)


def beyond_for_good(indicator: Indicator) -> bool:
    """Do the newest values lie beyond the limit, as many as end a life?

    Not where temperature, load or warm-up move them: the limit holds at the reference alone.
    """
    return _beyond(indicator)[0] >= LASTING


def still_sound(indicator: Indicator) -> bool:
    """Do the newest value and most of the newest lie this side of the limit, whatever laws say?

    Not where it is looked at later: the limit may have been passed since.
    """
    life = indicator.since_replaced()
    if not np.isfinite(life.value[-1]):
        return False
    apart = life.distance()[np.isfinite(life.value)]
    return not life.covariates and bool(min(apart[-1], np.median(apart[-LASTING:])) > 0.0)


def held_back(indicator: Indicator) -> int:
    """How many of the newest values lie beyond the limit, where they are too few to end a life."""
    few, known = _beyond(indicator)
    return few if few < min(LASTING, known) else 0


def _beyond(indicator: Indicator) -> tuple[int, int]:
    """(how many of the newest values lie beyond the limit, of how many); 0 where covariates move
    them."""
    life = indicator.since_replaced()
    if life.covariates:
        return 0, 0
    apart = life.distance()[np.isfinite(life.value)]
    within = np.flatnonzero(apart > 0.0)
    return len(apart) - 1 - int(within.max(initial=-1)), len(apart)


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
    third = max(len(problem.y) // 3, 3)
    first = float(np.median(problem.y[:third]))
    way = SHARE * (problem.limit - first) * problem.scale
    risen = (float(np.median(problem.y[-third:])) - first) * problem.scale
    if 3.0 * noise < risen < way:
        return NotEnough(
            f"growth by {indicator.shown(way)} towards the limit, {SHARE:.0%} of the way, to tell "
            "how it goes on", f"it has grown by {indicator.shown(risen)} so far",
        )  # fmt: skip
    return NotEnough(
        f"growth that stands out: {indicator.shown(max(way, 3.0 * noise))} towards the limit from "
        "the lowest level so far, held for as many values as a median needs, and steady enough to "
        "be followed",
        f"growth is not established over a scatter of {indicator.shown(noise)}",
    )


AROUND = 5
"""Values before and after a crossing that tell when it was."""


class End(NamedTuple):
    """When a history passed its limit.

    >>> End(120.0).failed
    False
    """

    age: float
    failed: bool = False
    """It failed before its limit, as was said."""


def lived(indicator: Indicator) -> End | None:
    """Age at which it failed, or the level, freed of noise, passed the limit; None: neither.

    A single value beyond the limit ends no life: the two that follow it must lie there as well.
    Where a line through the values around them passes the limit is the end.
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
        return End(float(np.interp(failed, life.at, clock)) - origin, failed=True)
    if not kept.any():
        return None
    near = good[max(first - AROUND, 0) : first + AROUND + 1]
    at = clock[near]
    slope, gap = steady(at, -life.distance()[near])
    end = at[-1] - gap / slope if slope > 0.0 else clock[good[first]]
    return End(float(np.clip(end, at[0], at[-1])) - origin)


def learn(histories: Sequence[Indicator], past: Sequence[Indicator] = ()) -> Fleet:
    """What a fleet of like machines knows, and earlier lives of the machine itself.

    Raises `UsageError` unless at least two lives ended.

    Args:
        histories: one indicator per machine, by name, with all its lives; those that neither failed
            nor passed their limit count with their age.
        past: lives, each for itself, after each of which another one began.
    """
    every = [history.lives() for history in histories]
    lives = [*(one for own in every for one in own), *past]
    last = [*(one is own[-1] for own in every for one in own), *(False for _ in past)]
    ends = [lived(one) for one in lives]
    members = tuple(map(member, lives, ends, last))
    ways = [way for life, end in zip(lives, ends) if (way := _way(life, end)) is not None]
    if sum(bool(np.isfinite(way.end)) for way in ways) < 2:
        got = "; ".join(one.said for one in members) or "none"
        raise UsageError(
            "fleet: expected at least two lives that ended (beyond the limit in their newest rows, "
            f"or said to have failed: --failed), got {got}"
        )
    return Fleet.of(ways, members)


def has_ended(life: Indicator) -> bool:
    """Whether a life is known to its end, and how it came there."""
    end = lived(life)
    return end is not None and _way(life, end) is not None


def _way(life: Indicator, end: End | None) -> Way | None:
    if end is None:
        return way_of(life)
    return way_of(life, end.age) if end.age > 0.0 else None


def member(life: Indicator, end: End | None, newest: bool) -> Member:
    """A life with its label; ``newest``: no other began after it on the same machine."""
    if end is not None:
        return Member(life.name, life.clock, end.age, "failed" if end.failed else "limit")
    age = float(life.at[-1]) - _start(life)
    return Member(life.name, life.clock, age, "running" if newest else "replaced")


def _start(history: Indicator) -> float:
    return float(history.at[0]) if history.origin is None else history.origin
