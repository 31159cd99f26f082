"""Something outside acts: told from what a model can be wrong in, by when it comes and goes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import scipy

from evertwin.anomaly import Contact, External, ExternalState, Seen
from evertwin.anomaly.external_loop import watch
from evertwin.fold import copy, equal, load, save
from planted.draws import first_of

RATE = 100.0
ABOVE, FRICTION = 0.05, 2.0
STAGE = External(("a", "b"), RATE)


def swings(n: int = 4000, seed: int = 0) -> Seen:
    """Two axes that swing to and fro, one of them every 7 s, the other every 5; noise of 0.1."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) / RATE
    v = np.stack([np.sin(2 * np.pi * t / 7), np.cos(2 * np.pi * t / 5)], axis=1)
    moving = np.abs(v) > ABOVE
    r = np.where(moving, rng.normal(0.0, 0.1, v.shape), 0.0)
    half = np.where(moving, 0.0, FRICTION)
    return Seen(0, (t * 1e9).astype(np.int64), r, half, v, moving, np.full(r.shape, np.nan))


def found(rows: Seen, stage: External = STAGE) -> tuple[Contact | None, np.ndarray]:
    state, marked = stage.step(stage.init(), rows)
    return stage.found(state), np.flatnonzero(marked)


def off(rows: Seen, by: np.ndarray) -> Seen:
    """The rows with more residual where the axis moves; what stands is held by friction."""
    return rows._replace(r=rows.r + np.where(rows.moving, by, 0.0))


@pytest.mark.parametrize("at", [1320, 1930, 2400])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_contact_is_marked_within_a_fifth_of_a_second(at: int, sign: float) -> None:
    by = np.zeros((4000, 2))
    by[at : at + 30, 0] = sign * 0.6
    contact, marked = found(off(swings(), by))
    assert contact is not None and contact.outputs == ("a",)
    assert contact.levels[0] == pytest.approx(0.6, abs=0.1)
    assert abs(contact.first - at) < STAGE.window
    assert at + 30 <= contact.last < at + 70
    assert at < marked[0] <= at + 20 and marked[-1] <= contact.last


@pytest.mark.parametrize(("share", "tells"), [(0.8, True), (0.01, False), (50.0, False)])
def test_a_model_out_of_scale_tells_no_contact(share: float, tells: bool) -> None:
    """The same residuals of outputs that are expected at a share of what is measured."""
    by = np.zeros((4000, 2))
    by[2400:2430, 0] = 0.6
    rows = off(swings(), by)
    size = 5.0 * rows.v if tells else rows.r * share / (1.0 - share)
    assert (found(rows._replace(expected=size))[0] is not None) == tells


def test_calm_says_nothing() -> None:
    for seed in range(10):
        assert found(swings(seed=seed))[0] is None


@pytest.mark.parametrize("size", [-4.5, 4.5])
@first_of("seeds", [range(3), range(3, 10)])
def test_beside_a_smooth_error_of_the_model_a_contact_of_more_than_four_times_that_is_told(
    seeds: range, size: float
) -> None:
    """Its errors go with the place of each axis, and pass for a contact nowhere."""
    for seed in seeds:
        rows, rng = swings(seed=seed), np.random.default_rng(seed)
        t = np.arange(4000) / RATE
        place = np.stack([-np.cos(2 * np.pi * t / 7), np.sin(2 * np.pi * t / 5)], axis=1)
        smooth = 0.5 * np.sin(1.2 * place + rng.uniform(0.0, 6.0, 2))
        rms, by = float(np.sqrt(np.mean(smooth[:, 0] ** 2) + 0.1**2)), np.zeros((4000, 2))
        at = int(rng.choice([2320, 2680, 3010, 3390]))
        assert found(off(rows, smooth))[0] is None
        by[at : at + 30, 0] = size * rms
        contact = found(off(rows, smooth + by))[0]
        assert contact is not None and abs(contact.first - at) < STAGE.window


@pytest.mark.parametrize("law", ["dry", "viscous", "offset"])
def test_what_a_parameter_explains_is_none(law: str) -> None:
    rows = swings()
    later = np.clip((np.arange(4000)[:, None] - 2013) / 300.0, 0.0, 1.0)
    size = {"dry": np.sign(rows.v), "viscous": rows.v, "offset": np.ones((4000, 2))}[law]
    assert found(off(rows, 0.8 * size * later))[0] is None


def test_what_lasts_counts_again() -> None:
    by = np.zeros((4000, 2))
    by[2000:] = 0.6
    rows, stage = off(swings(), by), External(("a", "b"), RATE, longest=1.0)
    state, marked = stage.step(stage.init(), Seen(0, *(column[:2150] for column in rows[1:])))
    first, *_, last = np.flatnonzero(marked)
    assert first > 1990 and last < 2120
    state, told = stage.beat(state)
    assert told.contact is None and 1980 < told.lasts < 2010
    assert stage.beat(state)[1].lasts == -1


@first_of("seed", range(5))
def test_a_push_is_told_that_begins_with_one_axis_motion_and_ends_with_anothers(seed: int) -> None:
    """Of neither axis it is: what begins with a motion and ends with one of the same is."""
    by = np.zeros((4000, 2))
    by[1755:1880], by[1755:1790, 1] = 0.8, 0.0  # one turns at 1750 and 2100, the other at 1875
    contact = found(off(swings(seed=seed), by))[0]
    assert contact is not None and contact.outputs == ("a", "b")
    by[1755:2105], by[:, 1] = 0.8, 0.0
    assert found(off(swings(seed=seed), by))[0] is None


def standing(push: np.ndarray, friction: float = FRICTION) -> Seen:
    n = len(push)
    off, still = np.maximum(np.abs(push) - friction, 0.0)[:, None], np.zeros((n, 1), np.bool_)
    noise = np.random.default_rng(0).normal(0.0, 0.1, (n, 1)) * (off > 0.0)
    half, v = np.full((n, 1), friction), np.zeros((n, 1))
    return Seen(0, np.arange(n) * 10**7, off + noise, half, v, still, np.full(v.shape, np.nan))


def test_a_push_on_a_standing_axis_is_known_while_it_lasts() -> None:
    push = np.zeros(500)
    push[100:300] = 5.0
    rows, stage = standing(push), External(("a",), RATE)
    state, marked = stage.step(stage.init(), Seen(0, *(column[:150] for column in rows[1:])))
    state, told = stage.beat(state)
    assert told.new and told.contact is not None and told.contact.last == -1
    assert 100 < np.flatnonzero(marked)[0] <= 120
    rest = Seen(150, *(column[150:] for column in rows[1:]))
    state, told = stage.beat(stage.step(state, rest)[0])
    assert told.contact is not None and not told.new and 300 <= told.contact.last < 340


@pytest.mark.parametrize(("held", "tells"), [(3, True), (0, False)])
def test_a_push_that_sets_a_standing_axis_in_motion_is_no_error_of_that_motion(
    held: int, tells: bool
) -> None:
    """Ten rows a second: half a second is five. What is beyond friction where the axis stands,
    pushed aside, is no error of a motion; and its edge, 200 times the noise, is no noise."""
    rows = swings()
    v, r, moving = rows.v.copy(), rows.r.copy(), rows.moving.copy()
    v[2000:2500, 0], r[2000:2500, 0], moving[2000:2500, 0] = 0.0, 0.0, False
    r[2298, 0] = 1.5
    for first, way in ((2300, 1.0), (2302 + held, -1.0)):
        v[first : first + 2, 0], moving[first : first + 2, 0] = way, True
    r[2300 : 2302 + held, 0] = -20.0
    half = np.where(moving, 0.0, FRICTION)
    slow = rows._replace(t=10 * rows.t, v=v, r=r, half=half, moving=moving)
    contact, _ = found(slow, External(("a", "b"), RATE / 10))
    assert (contact is not None and contact.outputs == ("a",)) == tells


@pytest.mark.parametrize(("expected", "tells"), [(8.0, True), (-8.0, False)])
def test_a_motion_that_the_actuator_brakes_was_begun_by_a_push(
    expected: float, tells: bool
) -> None:
    """Ten rows a second: a standing axis is pushed into motion, and moves back when let go. It is
    told though no motion has been seen calm since; not where a braking torque is what is expected.
    The push does not make the model one that is out of scale."""
    rows = swings()
    v, r, moving = rows.v.copy(), rows.r.copy(), rows.moving.copy()
    size = np.where(moving, 5.0 * v, 0.0)
    v[2000:2500, 0], r[2000:2500, 0], moving[2000:2500, 0], size[2000:2500, 0] = 0.0, 0.0, False, 0
    v[2300:2304, 0], r[2300:2304, 0], size[2300:2304, 0] = 1.0, -200.0, expected
    v[2304:2307, 0], moving[2300:2307, 0] = -1.0, True
    half = np.where(moving, 0.0, FRICTION)
    pushed = rows._replace(t=10 * rows.t, v=v, r=r, half=half, moving=moving, expected=size)
    stage = External(("a", "b"), RATE / 10)
    state, _ = stage.step(stage.init(), Seen(0, *(column[:2320] for column in pushed[1:])))
    contact = stage.found(state)
    assert (contact is not None and contact.outputs == ("a",)) == tells


def short_moves(since: int, n: int = 6000) -> Seen:
    """A second of rest, then a move, to and fro; friction that grew ``since``: the axis is held by
    more than it was, breaks loose late, and moves against more."""
    t, rng = np.arange(n), np.random.default_rng(0)
    way = np.where(t // 200 % 2 == 0, 1.0, -1.0)
    moves, loads = t % 200 >= 100, (t % 200 >= 70) & (t >= since)
    v = np.where(moves, way * 0.2, 0.0)
    r = np.where(moves, rng.normal(0.0, 0.1, n), 0.0)
    r += np.where(loads, way * np.where(moves, 0.8, 2.5), 0.0)
    half = np.where(moves, 0.0, FRICTION)
    columns = (a[:, None] for a in (r, half, v, moves))
    return Seen(0, t * 10**7, *columns, np.full((n, 1), np.nan))


def test_what_holds_before_each_motion_and_in_it_is_the_machines_own() -> None:
    rows, stage, since = short_moves(3000), External(("a",), RATE), 3000
    state, told = stage.init(), []
    for a in range(0, 6000, 100):
        state, _ = stage.step(state, Seen(a, *(column[a : a + 100] for column in rows[1:])))
        state, beat = stage.beat(state)
        told += [(a, beat)]
    own = [(a, beat.own) for a, beat in told if beat.own is not None]
    assert len(own) == 1 and own[0][1].output == "a"
    assert since - 200 <= own[0][1].first < since + 200 and own[0][0] <= since + 800
    contacts = [a for a, beat in told if beat.contact is not None]
    assert contacts and since <= min(contacts) and max(contacts) < own[0][0]
    later = Seen(6000, *(column[4000:] for column in rows[1:]))
    assert not stage.step(state, later._replace(t=later.t + 20 * 10**9))[1].any()


@first_of("seed", range(10))
@pytest.mark.parametrize("lasts", [150, 250, 400])
def test_what_comes_once_and_lasts_over_several_motions_does_not_recur(
    lasts: int, seed: int
) -> None:
    """A load of the same size and sign in each motion, to and fro, for as long as it is there."""
    rng = np.random.default_rng(seed)
    at = 2000 + int(rng.integers(0, 200))
    t, n = np.arange(3000), 3000
    v = np.sin(2 * np.pi * t / 80 + rng.uniform(0.0, 6.0))
    moving = np.abs(v) > ABOVE
    r = np.where(moving, rng.normal(0.0, 0.1, n), 0.0)
    r += np.where((t >= at) & (t < at + lasts), np.where(moving, 3.0, 1.0), 0.0)
    columns = (a[:, None] for a in (r, np.where(moving, 0.0, FRICTION), v, moving))
    rows = Seen(0, t * 10**7, *columns, np.full((n, 1), np.nan))
    stage = External(("a",), RATE)
    state, told = stage.init(), []
    for a in range(0, n, 100):
        state, _ = stage.step(state, Seen(a, *(column[a : a + 100] for column in rows[1:])))
        state, beat = stage.beat(state)
        told.append(beat)
    assert [beat.own for beat in told] == [None] * len(told)
    (contact,) = {beat.contact.first: beat.contact for beat in told if beat.contact}.values()
    assert abs(contact.first - at) < 2 * stage.window


def test_what_friction_holds_is_not_told_and_without_one_nothing_is() -> None:
    push = np.zeros(3000)
    push[100:300] = 3.9
    stage = External(("a",), RATE)
    state, told = stage.beat(stage.step(stage.init(), standing(push))[0])
    assert told.contact is None and not told.blind
    unknown = standing(push, friction=0.0)
    state, told = stage.beat(stage.step(stage.init(), unknown)[0])
    assert told.contact is None and told.blind
    assert not stage.beat(state)[1].blind


def test_few_rows_take_more_to_tell() -> None:
    assert STAGE.window == 20 and STAGE.times == 2.5
    slow = External(("a",), 10.0)
    assert slow.window == 3 and slow.times == pytest.approx(4.1, abs=0.1)
    calm = np.random.default_rng(0).normal(size=(200_000, 1))
    assert found(Seen.of(calm, 0.1), slow)[0] is None


def test_no_cut_matters_and_a_saved_state_goes_on() -> None:
    by = np.zeros((4000, 2))
    by[2400:2440, 1] = 1.0
    rows = off(swings(), by)
    rows.r[::97] = np.nan
    whole, marked = STAGE.step(STAGE.init(), rows)
    state, seen = STAGE.init(), []
    places = [0, 1, 2, *np.random.default_rng(1).integers(3, 3999, 60).tolist(), 4000]
    for a, b in pairwise(sorted(set(places))):
        state = load(save(copy(state)), like=state)
        state, part = STAGE.step(state, Seen(a, *(column[a:b] for column in rows[1:])))
        seen.append(part)
    assert equal(state, whole) and (np.concatenate(seen) == marked).all()
    assert STAGE.found(whole) is not None


def test_machine_code_and_plain_python_give_the_same_bits() -> None:
    by = np.zeros((1200, 2))
    by[800:840] = 1.0
    rows = off(swings(1200), by)

    def run(form: object) -> tuple[ExternalState, np.ndarray]:
        state, marked = STAGE.init(), np.zeros(1200, np.bool_)
        form(rows, STAGE.times, STAGE.rule, state, marked)  # type: ignore[operator]
        return state, marked

    (a, b), (c, d) = run(watch.plain), run(watch.compiled)
    assert equal(a, c) and (b == d).all() and b.any()


def late(seed: int, by: np.ndarray | float = 0.0) -> Seen:
    """The swings of outputs that now and then rise for a third of a second, measured behind a low
    pass of 40 ms."""
    rows, rng = swings(seed=seed), np.random.default_rng(seed)
    rises = np.zeros(rows.r.shape)
    for start in np.arange(150, 3900, 330) + rng.integers(0, 100, 12):
        rises[start : start + 35] += rng.choice([-1.0, 1.0], 2) * 6.0
    expected = 5.0 * rows.v + scipy.ndimage.gaussian_filter1d(rises, 8.0, axis=0)
    stay = np.exp(-1.0 / RATE / 0.04)
    measured = scipy.signal.lfilter([1.0 - stay], [1.0, -stay], expected, axis=0)
    r = rows.r + np.where(rows.moving, measured - expected + by, 0.0)
    return rows._replace(r=r, expected=expected)


@first_of("seed", range(6))
def test_what_a_low_pass_leaves_is_no_contact(seed: int) -> None:
    assert found(late(seed))[0] is None


@first_of("seed", range(6))
def test_a_contact_is_told_beside_a_low_pass(seed: int) -> None:
    by = np.zeros((4000, 2))
    by[2420:2460, 0] = 3.0
    contact, _ = found(late(seed, by))
    assert contact is not None and contact.outputs == ("a",)
    assert abs(contact.first - 2420) < STAGE.window
