"""The clock of a live source, at its edges."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.sources.live.stamping import FAR, Stamping

S = 10**9
HOUR = 3600 * S


def run(clock: Stamping[None], samples: list[tuple[int, int]]) -> list[int]:
    return [out for t, came in samples for out, _ in clock.take(t, came, None)]


def heard(clock: Stamping[int], samples: list[tuple[int, int, int]]) -> list[tuple[int, int]]:
    return [one for t, came, value in samples for one in clock.take(t, came, value, value)]


@pytest.mark.parametrize("jump", [HOUR, -HOUR, 75 * 365 * 24 * HOUR])
def test_a_clock_that_is_set_goes_on_where_it_was(jump: int) -> None:
    clock: Stamping[None] = Stamping()
    start = 1_800_000_000 * S
    before = [(start + i * S, start + i * S) for i in range(20)]
    after = [(start + jump + i * S, start + i * S) for i in range(20, 40)]
    out = run(clock, before + after)
    assert len(out) == 40 and clock.set == 1 and clock.rejected == 0
    assert set(np.diff(out).tolist()) == {S}


@pytest.mark.parametrize("bad", [0, 2**61, -(2**61), 1_800_003_600 * S])
def test_one_absurd_stamp_stops_nothing(bad: int) -> None:
    start = 1_800_000_000 * S
    rows = [(start + i * S, start + i * S) for i in range(20)]
    clock: Stamping[None] = Stamping()
    out = run(clock, [*rows[:7], (bad, rows[7][1]), *rows[8:]])
    assert bad not in out and len(out) == 19 and clock.set == 0 and clock.rejected == 1
    first: Stamping[None] = Stamping()
    out = run(first, [(bad, rows[0][1]), *rows[1:]])
    assert len(out) >= 19 and (np.diff(out) > 0).all()


def test_what_was_kept_somewhere_comes_at_once_and_whole() -> None:
    clock: Stamping[None] = Stamping()
    rows = [(i * S, i * S) for i in range(10)]
    rows += [(i * S, 4000 * S) for i in range(10, 4000, 30)]  # steps of 30 s within one moment
    rows += [(i * S, i * S) for i in range(4001, 4010)]
    assert run(clock, rows) == [t for t, _ in rows]


def test_repeated_and_late_ones() -> None:
    clock: Stamping[None] = Stamping()
    out = run(clock, [(t * S, t * S) for t in (1, 2, 4, 3, 3, 4, 5)])
    assert out == [S, 2 * S, 4 * S, 3 * S, 5 * S] and clock.repeated == 2


def test_what_is_stored_does_not_come_again() -> None:
    for arrives in (True, False):
        clock: Stamping[None] = Stamping(arrives=arrives)
        clock.resume(100 * S)
        rows = [(t * S, (200 + t) * S) for t in (0, 95, 99, 100, 101, 102)][1 - arrives :]
        rows = rows[arrives:]
        assert run(clock, rows) == [101 * S, 102 * S]
        assert clock.repeated == len(rows) - 2


def test_what_a_broker_sends_again_after_a_start_is_no_clock_that_was_set() -> None:
    clock: Stamping[None] = Stamping()
    clock.resume(100 * S)
    burst = [(t * S, 200 * S + t) for t in range(81, 101)]
    fresh = [(t * S, (100 + t) * S) for t in range(101, 105)]
    assert run(clock, [*burst, *fresh]) == [t for t, _ in fresh]
    assert clock.set == 0 and clock.repeated == 20 and clock.rejected == 0


def test_a_pause_in_a_file_is_no_clock_that_was_set() -> None:
    clock: Stamping[None] = Stamping(arrives=False)
    rows = [(t * S, 0) for t in (1, 2, 3, 1000, 1001, 1002, 1003, 1004)]
    assert run(clock, rows) == [t for t, _ in rows] and clock.set == 0


@pytest.mark.parametrize("jump", [-HOUR, -60 * S, -HOUR * 24 * 365])
@pytest.mark.parametrize("speed", [1, 100])
def test_a_file_whose_clock_was_set_back_is_gone_on_with_where_it_was(
    jump: int, speed: int
) -> None:
    """It is read from its beginning after a restart, all at once."""
    start = 1_800_000_000 * S
    rows = [(start + i * S // 2 + (jump if i >= 40 else 0), i * S // 2 // speed) for i in range(90)]
    whole: Stamping[None] = Stamping(arrives=False)
    told = run(whole, rows)
    assert len(told) == 90 and whole.set == 1 and (np.diff(told) > 0).all()
    for cut in (30, 41, 44, 60, 89):
        first, again = (Stamping[None](arrives=False) for _ in range(2))
        before = run(first, rows[:cut])
        again.resume(before[-1])
        after = run(again, [(t, 10**6 * S) for t, _ in rows])
        assert before + after == told


@pytest.mark.parametrize("jump", [-5, -9])
@pytest.mark.parametrize("down", [1, 3])
def test_a_machine_that_is_polled_and_was_set_back_a_little_repeats_nothing(
    jump: int, down: int
) -> None:
    """Over a restart, within the time that a broker would send again what it has sent."""
    start, step = 1_800_000_000 * S, S // 4
    rows = [(start + k * step, start + k * step + 10**7, k) for k in range(200)]
    first, again = Stamping[int](), Stamping[int]()
    before = heard(first, rows[:80])
    clock = first.lasting()
    again.polled = True
    again.resume(before[-1][0])
    if clock is not None:
        again.go_on(clock)
    later = [(t + jump * S, came, k) for t, came, k in rows[80 + 4 * down :]]
    after = heard(again, later)
    assert [k for _, k in after] == list(range(80 + 4 * down, 200))
    assert again.repeated == again.rejected == 0 and again.set == 1
    assert after[0][0] > before[-1][0] and set(np.diff([t for t, _ in after]).tolist()) == {step}


def test_a_machine_that_stood_while_nobody_listened_starts_from_zero() -> None:
    clock: Stamping[None] = Stamping()
    clock.resume(5000 * S)
    out = run(clock, [(t * S, (9000 + t) * S) for t in range(1, 11)])
    assert len(out) == 10 and out[0] > 5000 * S and set(np.diff(out).tolist()) == {S}
    assert FAR < 5000 * S and clock.set == 1


def test_a_machine_in_time_lapse_may_pause() -> None:
    clock: Stamping[None] = Stamping()
    rows = [(20 * i * S, i * S) for i in range(10)] + [(20 * i * S, i * S) for i in range(30, 40)]
    assert run(clock, rows) == [t for t, _ in rows] and clock.set == 0


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("back", [60, 3600])
@pytest.mark.parametrize("speed", [1, 20])
def test_a_clock_set_back_onto_stamps_that_came_loses_nothing(
    seed: int, back: int, speed: int
) -> None:
    rng = np.random.default_rng(seed)
    values = np.cumsum(rng.integers(0, 2, 5000))  # now and then the same again
    rows = [(i * S - (back * S if i >= 4000 else 0), i * S // speed, int(values[i]))
            for i in range(4200)]  # fmt: skip
    clock: Stamping[int] = Stamping()
    out = heard(clock, rows)
    assert [value for _, value in out] == values[:4200].tolist()
    assert (np.diff([t for t, _ in out]) == S).all()
    assert (clock.set, clock.repeated, clock.rejected) == (1, 0, 0)


def test_values_that_come_late_for_stamps_that_came_are_no_clock_that_was_set() -> None:
    clock: Stamping[int] = Stamping()
    rows = [(i * S // 10, i * S // 10, i) for i in range(100)]
    late = [(t, 10 * S, value + 1) for t, _, value in rows[-12:-1]]
    more = [(10 * S + i * S // 10, 10 * S + i * S // 10, i) for i in range(20)]
    assert len(heard(clock, [*rows, *late, *more])) == 120
    assert (clock.set, clock.repeated, clock.rejected) == (0, 11, 0)


@pytest.mark.parametrize("jump", [0, -600, HOUR // S, -HOUR // S])
@pytest.mark.parametrize("speed", [1, 4])
@pytest.mark.parametrize("down", ["set before", "set meanwhile"])
def test_a_restart_goes_on_with_a_clock_that_was_set(jump: int, speed: int, down: str) -> None:
    """Stamps go on where they were; what nobody heard meanwhile takes its time."""
    start = 1_800_000_000 * S
    since = 400 if down == "set before" else 800

    def rows(first: int, last: int) -> list[tuple[int, int]]:
        return [(start + i * S // 10 + (jump * S if i >= since else 0),
                 start + i * S // 10 // speed) for i in range(first, last)]  # fmt: skip

    clock: Stamping[None] = Stamping()
    kept, out = [], []
    for row in rows(0, 800):
        out += run(clock, [row])
        kept += [one for one in [clock.lasting()] if one is not None]
    again: Stamping[None] = Stamping()
    # in time-lapse, an hour on may be a pause
    told = jump != 0 and (speed == 1 or jump < 0)
    again.resume(out[-1])
    assert again.go_on(kept[-1]) == (told and since == 400)
    sent_again, fresh = rows(780, 800), rows(1150, 1300)  # 35 s of the machine
    burst = [(t, fresh[0][1] - S // 10 + i) for i, (t, _) in enumerate(sent_again)]
    more = run(again, [*burst, *fresh])
    assert len(more) == 150 and again.rejected == 0
    assert (np.diff(more) == S // 10).all()
    assert again.set == (told and since == 800)
    passed = more[0] - out[-1]
    if again.set and speed > 1:
        assert passed > 5 * S  # nobody knows how long it was on its clock
    elif told or jump == 0 or since == 400:
        assert abs(passed - 35 * S) <= S
    else:
        assert passed > HOUR


@pytest.mark.parametrize(("lead", "later"), [(0, -4000), (600, 0)])
def test_a_clock_here_that_was_set_back_is_not_the_machine_s(lead: int, later: int) -> None:
    clock: Stamping[None] = Stamping()
    clock.resume(5000 * S)
    clock.go_on((0, lead * S, 0))
    out = run(clock, [(t * S, (t + later) * S) for t in range(6001, 6011)])
    assert out == [t * S for t in range(6001, 6011)] and clock.set == 0


def drawn(seed: int, speed: int | None = None) -> tuple[np.random.Generator, np.ndarray, list[int]]:
    """A machine of any pace: its stamps, and when they come."""
    rng = np.random.default_rng(seed)
    step = rng.choice([0.05, 0.2, 1.0, 5.0])
    speed = int(rng.choice([1, 4, 20, 100])) if speed is None else speed
    noise = rng.choice([0.0, 0.05]) * rng.uniform(-1.0, 1.0, 240)
    true = ((1_800_000_000 + step * (np.arange(240) + noise)) * S).astype(np.int64)
    came = [int((k * step / speed + 0.01 + abs(rng.normal(0, 0.003))) * S) for k in range(240)]
    return rng, true, [1_800_000_000 * S + one for one in came]


@pytest.mark.parametrize("numbered", [False, True])
@pytest.mark.parametrize("seed", range(50))
def test_what_a_gateway_sends_late_is_late_and_moves_no_clock(seed: int, numbered: bool) -> None:
    rng, true, came = drawn(seed)
    at, count, live = int(rng.integers(60, 150)), int(rng.integers(1, 41)), int(rng.integers(1, 4))
    last = at + count + live
    order = [*range(at), *range(at + count, last), *range(at, at + count), *range(last, 240)]
    for j in range(count):
        came[at + j] = came[last - 1] + (j + 1) * 10**5
    clock, out, newest = Stamping[int](), dict[int, int](), -1
    for k in order:
        late = numbered and k < newest
        newest = max(newest, k)
        out |= {value: t for t, value in clock.take(int(true[k]), came[k], k, k, late)}
    assert [out[k] for k in range(240)] == true.tolist()
    assert (clock.set, clock.repeated, clock.rejected) == (0, 0, 0)


@pytest.mark.parametrize("jump", [-86_400, -3600, -600, 600, 3600, 86_400])
@pytest.mark.parametrize("seed", range(20))
def test_a_clock_that_goes_back_to_where_it_was_is_that_clock(seed: int, jump: int) -> None:
    rng, true, came = drawn(seed, None if jump < 0 else 1)
    at, count = int(rng.integers(60, 150)), int(rng.integers(4, 60))
    sent = true.copy()
    sent[at : at + count] += jump * S
    if -jump * S >= true[at] - true[0]:  # else it lies on what was heard
        clock = Stamping[int]()
        out = {k: t for j in range(240) for t, k in clock.take(int(sent[j]), came[j], j, j)}
        assert len(out) == 240 and clock.set == 2
        assert [out[k] for k in range(at + count, 240)] == true[at + count :].tolist()


def test_one_stamp_where_none_is_missing_is_of_no_clock() -> None:
    """Unlike one that came late, it lies on samples that came."""
    rows = [(i * S, i * S) for i in range(60) if i != 20]
    wrong = run(Stamping(), [*rows[:50], (30 * S + 1, 50 * S), *rows[50:]])
    late = run(Stamping(), [*rows[:50], (20 * S, 50 * S), *rows[50:]])
    assert len(wrong) == 59 and len(late) == 60
