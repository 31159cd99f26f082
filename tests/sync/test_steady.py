"""What a speed is derived from: rows that cannot be its own are told, and no others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from evertwin.fold import Event
from evertwin.fold.state import equal
from evertwin.sync.alignment.align import Rows
from evertwin.sync.alignment.derive import Derive, Operation, Taken

STAGE = Derive(
    ("q",), (Operation("q", "steady", ("q",)), Operation("qd", "derivative", ("q",))),
    (Taken("q"), Taken("qd")), (), 100.0,
)  # fmt: skip
STATIC = replace(STAGE, static=True)
"""The same, for a model that has no state to take up what is read."""
RATE, N = 100.0, 2000


def drawn(seed: int) -> np.ndarray:
    """Moves of an axis from rest to rest, noisy and in steps of an encoder."""
    rng = np.random.default_rng(seed)
    ends = np.concatenate([[0.0], rng.uniform(-1.0, 1.0, 12)])
    t, q = np.arange(N) / RATE, np.zeros(N)
    for k in range(12):
        begin, lasts = 1.6 * k + 0.5, rng.uniform(0.2, 0.9)
        s = np.clip((t - begin) / lasts, 0.0, 1.0)
        q += (ends[k + 1] - ends[k]) * (3 * s**2 - 2 * s**3)
    grain = 10.0 ** rng.uniform(-6, -3)
    return grain * np.round((q + 10.0 ** rng.uniform(-6, -3.5) * rng.normal(size=N)) / grain)


def rows(q: np.ndarray) -> Rows:
    n = len(q)
    t = np.arange(n) * 10**7
    return Rows(
        np.arange(n), t, np.full(n, 0.01), q[:, None], np.zeros((n, 0)),
        np.zeros((n, 1), np.uint8), np.zeros(n, np.int64), t == 0,
    )  # fmt: skip


def part(whole: Rows, a: int, b: int) -> Rows:
    return Rows(*(column[a:b] for column in whole))


def folded(q: np.ndarray, *cuts: int, by: Derive = STAGE) -> tuple[Rows, list[Event]]:
    state, whole, left, told = by.init(), rows(q), list[Rows](), list[Event]()
    for a, b in zip((0, *cuts), (*cuts, len(q)), strict=True):
        state, some, events = by.step(state, part(whole, a, b))
        left += [some] if some is not None else []
        told += events
    state, some, events = by.flush(state)
    left += [some] if some is not None else []
    return Rows(*(np.concatenate(c) for c in zip(*left, strict=True))), [*told, *events]


def test_of_a_healthy_axis_nothing_is_told() -> None:
    assert [seed for seed in range(150) if folded(drawn(seed))[1]] == []


@pytest.mark.parametrize("width", [1, 2, 3])
def test_rows_that_leave_it_and_are_back_are_taken_from_their_neighbours(width: int) -> None:
    for seed in range(60):
        q, rng = drawn(seed), np.random.default_rng(seed)
        at, wrong = int(rng.integers(600, N - 10)), q.copy()
        wrong[at : at + width] += rng.choice([-1.0, 1.0]) * rng.uniform(2.0, 50.0)
        found, told = folded(wrong)
        kinds = [(e.kind, e.signal, e.row) for e in told]
        assert kinds == [
            ("measurement_error", "q", at), ("measurement_restored", "q", at + width)
        ]  # fmt: skip
        fastest = np.abs(np.diff(q)).max()
        np.testing.assert_allclose(found.u[:, 0], q, atol=(width + 1) * fastest)
        assert (found.mark[at - 1 : at + width + 1, 1] > 2).all()  # no speed is taken of them


def test_what_leaps_and_goes_on_is_told_and_has_no_speed_of_that() -> None:
    for seed in range(60):
        q, rng = drawn(seed), np.random.default_rng(seed)
        at, leapt = int(rng.integers(600, N - 10)), q.copy()
        leapt[at:] += rng.choice([-1.0, 1.0]) * rng.uniform(2.0, 50.0)
        found, told = folded(leapt)
        assert [(e.kind, e.row) for e in told] == [("leapt", at)]
        assert np.abs(found.u[:, 1]).max() < 3.0 * np.abs(np.diff(q)).max() * RATE


def frozen(seed: int) -> tuple[np.ndarray, np.ndarray, int]:
    """An axis that swings; one of which the encoder stands for a second or more; the row at which
    it is back, far away."""
    rng, t = np.random.default_rng(seed), np.arange(N) / RATE
    q = np.sin(rng.uniform(0.8, 2.0) * t + rng.uniform(0.0, 6.0))
    q = 1e-5 * np.round((q + 10.0 ** rng.uniform(-6, -4) * rng.normal(size=N)) / 1e-5)
    far = [k for k in range(700, 1500) if abs(q[k] - q[550]) > 0.5 and abs(q[k + 4] - q[k]) > 0.02]
    back = int(rng.choice(far))
    stood = q.copy()
    stood[550:back] = q[550]
    return q, stood, back


def test_what_was_frozen_and_is_back_is_where_it_is() -> None:
    for seed in range(60):
        q, stood, back = frozen(seed)
        found, told = folded(stood)
        assert [(e.kind, e.row) for e in told] == [("measurement_restored", back)]
        np.testing.assert_array_equal(found.u[:, 0], stood)
        assert np.abs(found.u[:, 1]).max() < 2.0 * np.abs(np.diff(q)).max() * RATE
        assert (found.mark[back - 1 : back + 2, 1] > 2).all()


@pytest.mark.parametrize("number", [np.pi / 180.0, -0.1, 180.0 / np.pi])
def test_what_changes_its_unit_keeps_its_zero(number: float) -> None:
    undone = number != -0.1  # no two units of a place differ by that
    for seed in range(60):
        q, _, at = frozen(seed)
        if abs(q[at]) < 0.3 or abs(q[at + 3] - q[at]) < 0.02:  # it hardly leaps, or moves
            continue
        back = at + 200
        other = np.r_[q[:at], number * q[at:back], q[back:]]
        left, told = folded(other)
        assert (told[0].kind, told[0].row) == ("measurement_error", at)
        assert "unit" in told[0].reason and told[0].evidence["open"]
        assert_allclose = np.testing.assert_allclose
        assert_allclose(left.u[: back - 1, 0], (q if undone else other)[: back - 1], rtol=1e-12)
        known = np.isfinite(folded(other, by=STATIC)[0].u).all(axis=1)
        assert (known[at + 3 : back - 3] != undone).all() and known[: at - 1].all()
        again = abs(q[back]) > 0.3
        assert not again or known[back + 3 :].all()
        assert not again or [e.row for e in told[1:]] == [back]


def test_what_was_degrees_is_its_own_again_wherever_that_was_over() -> None:
    """Near zero the two are alike, and there is no leap back: the latest is known by ten seconds in
    which it goes where it went, no faster than it did."""
    after = list[int]()
    for seed in range(60):
        q, _, at = frozen(seed)
        crossing = [k for k in range(at + 100, N - 500) if q[k] * q[k - 1] <= 0.0]
        if abs(q[at]) < 0.3 or not crossing:
            continue
        back = crossing[0]
        on = np.concatenate([q[back:], *[q[::-1], q] * 2])  # it goes on to and fro
        other = np.concatenate([q[:at], np.rad2deg(q[at:back]), on])
        left, told = folded(other)
        assert [e.kind for e in told] == ["measurement_error", "measurement_restored"]
        after.append(told[1].row - back)
        np.testing.assert_allclose(left.u[told[1].row :, 0], on[after[-1] :])
    assert len(after) > 30 and min(after) >= 0 and max(after) < 15 * RATE
    assert np.quantile(after, 0.8) < 3 * RATE


def test_it_cannot_matter_where_rows_are_cut(run_as: Callable[[str], None]) -> None:
    q = drawn(3)
    q[700:702] += 9.0
    q[1200:] -= 4.0
    q[1500:1600] = q[1500]
    q[1600:] = frozen(3)[0][1600:] + q[1500]
    rng = np.random.default_rng(0)
    whole = folded(q)
    for _ in range(20):
        cuts = np.sort(rng.choice(np.arange(1, N), 30, replace=False)).tolist()
        left, told = folded(q, *cuts)
        assert told == whole[1] and equal(left, whole[0])
    run_as("plain")
    assert equal(folded(q)[0], whole[0])
