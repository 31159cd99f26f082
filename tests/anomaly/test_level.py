"""A level that rises, of residuals that are spread as they like: drawn anew per seed."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.anomaly import Level, Rise
from evertwin.signals import Channel, Layout

SEGMENT, SEGMENTS, AT = 10, 500, 300
LEVEL = Level.of(Layout.of(x="m"), np.array([True]))


def drawn(seed: int, times: float, hold: int = 1) -> np.ndarray:
    """Residuals (n, 1) of a form that is off by much at times, as commands hold for ``hold``
    predictions, and by ``times`` as much from `AT` on."""
    rng = np.random.default_rng(seed)
    size = np.repeat(np.exp(rng.normal(0.0, 1.0, SEGMENTS // hold + 1)), hold)[:SEGMENTS]
    size[AT:] *= times
    return np.asarray(np.repeat(size, SEGMENT)[:, None] * rng.normal(size=(SEGMENT * SEGMENTS, 1)))


def rises(off: np.ndarray, cuts: tuple[int, ...] = ()) -> tuple[Rise, ...]:
    state, found = LEVEL.init(), list[Rise]()
    ends = np.arange(len(off)) % SEGMENT == SEGMENT - 1
    for part in np.split(np.arange(len(off)), list(cuts)):
        moving = np.ones((len(part), 1), dtype=np.bool_)
        state, more = LEVEL.step(state, part, off[part], moving, ends[part])
        found += more
    return tuple(found)


@pytest.mark.parametrize(("hold", "most"), [(1, 10), (3, 30)])
def test_what_goes_on_as_it_was_has_not_risen(hold: int, most: int) -> None:
    assert sum(bool(rises(drawn(seed, 1.0, hold))) for seed in range(100)) <= most


@pytest.mark.parametrize(
    ("hold", "times", "least"),
    [(1, 3.0, 80), (1, 4.0, 95), (1, 8.0, 99), (3, 4.0, 70), (3, 8.0, 95)],
)
def test_a_rise_is_known_within_forty_predictions(hold: int, times: float, least: int) -> None:
    found = (rises(drawn(seed, times, hold)) for seed in range(100))
    soon = [any(0 < r.row - AT * SEGMENT <= 40 * SEGMENT for r in some) for some in found]
    assert sum(soon) >= least


def test_cuts_change_nothing() -> None:
    off = drawn(1, 4.0)
    assert rises(off) and rises(off, (7, 1000, 3123, 3124)) == rises(off)


def test_a_level_that_fell_is_learned_anew_in_silence() -> None:
    off = drawn(2, 0.2)
    assert not rises(off)
    back = np.concatenate([off, 5.0 * off[AT * SEGMENT :]])
    assert [r.first >= len(off) - 5 * SEGMENT for r in rises(back)] == [True]


def test_outputs_of_one_kind_are_one_and_unwatched_ones_none() -> None:
    pose = [("x", "m", "pose"), ("y", "m", "pose"), ("angle", "rad", "pose"), ("z", "m", "z")]
    outputs = Layout(tuple(Channel(name, unit, group=group) for name, unit, group in pose))
    level = Level.of(outputs, np.array([True, True, True, False]))
    assert level.groups == (0, 0, 1, -1) and level.init().shape[0] == 2
