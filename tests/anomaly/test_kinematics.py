"""Positions and speeds that contradict each other, cut anywhere, and those that do not."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.anomaly.kinematics import Contradiction, Kinematics, Leap

STAGE = Kinematics((("position", "speed"),), ((0, 1, 0),), rate=100.0)
TURNS = Kinematics((("q1", "qd1"),), ((0, 1, 1),), 100.0, ("rad", "rad/s"))
AT = 4000


def motion(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """An axis to and fro with noise and coarse steps; (n,) position and speed."""
    rng, t = np.random.default_rng(seed), 0.01 * np.arange(8000)
    way = np.sin(0.7 * t + rng.uniform(0, 6)) + 0.5 * np.sin(1.9 * t)
    speed = np.gradient(way, 0.01) + rng.normal(0.0, 0.02, len(t))
    return np.round(way + rng.normal(0.0, 1e-4, len(t)), 3), speed


def told(
    q: np.ndarray, v: np.ndarray, stage: Kinematics = STAGE, cut: int = 200
) -> tuple[list[Contradiction | Leap], np.ndarray]:
    state, found, marks = stage.init(), [], []
    u, dt = np.stack([q, v], axis=1), np.full(len(q), 0.01)
    for first in range(0, len(q), cut):
        rows = slice(first, first + cut)
        state, marked = stage.step(state, first, dt[rows], u[rows])
        marks.append(marked)
        if (first + cut) % 200 == 0:
            state, some = stage.beat(state)
            found += some
    return found, np.concatenate(marks)


@pytest.mark.parametrize(
    ("which", "number", "signal"),
    [("v", 1000.0, "speed"), ("v", 57.2958, "speed"), ("v", 0.0, "speed"), ("v", 0.001, "speed"),
     ("q", 1000.0, "position"), ("q", 0.0, "position"), ("q", 0.01, "position")],
)  # fmt: skip
def test_the_channel_that_changed_is_named_with_its_factor(
    which: str, number: float, signal: str
) -> None:
    for seed in range(5):
        q, v = motion(seed)
        (q if which == "q" else v)[AT:6000] *= number
        (opened, closed), marks = told(q, v)
        assert opened.signal == closed.signal == signal and opened.known
        assert opened.open and not closed.open
        assert opened.factor == pytest.approx(number, rel=0.1, abs=0.05 * number)
        assert AT - 100 <= opened.first <= AT + 50 and marks[AT + 100 : 6000].all()
        assert not marks[: AT - 100].any() and not marks[7000:].any()


@pytest.mark.parametrize("lost", [1, 2, 10, 40])
def test_rows_that_are_lost_contradict_nothing(lost: int) -> None:
    """Of every half second so many rows: the way over them is in the position alone."""
    for seed in range(5):
        q, v = motion(seed)
        v[np.arange(len(v)) % 50 < lost] = np.nan
        found, marks = told(q, v)
        assert not found and not marks.any()


def test_a_speed_that_stands_is_not_sound_again_where_the_motion_is_as_fast() -> None:
    """To and fro at 0.5 m/s, two seconds each way; the speed stays at one of them, with noise."""
    rng, t = np.random.default_rng(2), 0.01 * np.arange(8000)
    v = np.where(t % 4.0 < 2.0, 0.5, -0.5)
    q = np.cumsum(v) * 0.01
    v[AT:] = 0.5
    (opened,), marks = told(q, v + rng.normal(0.0, 0.01, len(t)))
    assert opened.open and marks[AT + 400 :].all()


def test_of_a_turned_sign_it_cannot_be_told_which_one_it_is() -> None:
    q, v = motion()
    v[AT:] *= -1.0
    (opened,), _ = told(q, v)
    assert opened.factor == pytest.approx(-1.0, abs=0.05) and not opened.known
    assert "which of the two is wrong cannot be told" in opened.reason


def test_the_cuts_do_not_matter() -> None:
    q, v = motion(3)
    v[AT:6000] *= 25.4
    whole, marks = told(q, v)
    for cut in (1, 40):
        other, marked = told(q, v, cut=cut)
        assert other == whole and (marked == marks).all()


def test_sound_channels_are_not_doubted() -> None:
    for seed in range(20):
        q, v = motion(seed)
        v[5000:] = np.where(np.arange(5000, 8000) < 7000, 0.0, v[5000:])  # it stands for 20 s
        q[5000:7000] = q[5000] + np.random.default_rng(seed).normal(0, 1e-3, 2000)
        q[7000:] += q[5000] - q[7000]
        found, marks = told(q, v)
        assert not found and not marks.any()


def test_an_angle_that_wraps_goes_on() -> None:
    t = 0.01 * np.arange(4000)
    q, v = np.mod(2.0 * t + np.pi, 2 * np.pi) - np.pi, np.full(4000, 2.0)
    assert told(q, v, TURNS) == ([], pytest.approx(np.zeros(4000)))


def test_what_never_agreed_is_the_doctors() -> None:
    q, v = motion()
    assert told(q, 1000.0 * v)[0] == []


def test_units_that_are_taken_for_each_other_are_named() -> None:
    q, v = motion()
    q[AT:] *= 57.3
    (opened,), _ = told(q, v, TURNS)
    assert "as degrees for radians would make it" in opened.reason


@pytest.mark.parametrize("seed", range(6))
def test_a_position_that_leaps_against_its_speed_is_told_at_once(seed: int) -> None:
    q, v = motion(seed)
    q[AT:] += 0.07 * (-1) ** seed
    (leap,), marks = told(q, v, TURNS)
    assert isinstance(leap, Leap) and leap.open and (leap.signal, leap.first) == ("q1", AT)
    assert leap.by == pytest.approx(0.07 * (-1) ** seed, rel=0.2)
    assert "against qd1" in leap.reason and not marks.any()
    q[6000:] -= 0.07 * (-1) ** seed
    (_, back), _ = told(q, v, TURNS)
    assert isinstance(back, Leap) and not back.open


@pytest.mark.parametrize("seed", range(6))
def test_what_stands_and_catches_up_or_comes_back_is_no_leap(seed: int) -> None:
    q, v = motion(seed)
    for first in range(1000, 7900, 487):
        q[first : first + 8] = q[first]  # late: held, then where it is
    q[AT] += 0.5  # one row alone
    assert not told(q, v, TURNS)[0]
    turned = np.arctan2(np.sin(3 * q), np.cos(3 * q))  # a whole turn is none
    assert not told(turned, 3 * v, TURNS)[0]
