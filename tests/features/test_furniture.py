"""Tables while scans come: the laws of a stage, their places, and what is told."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest

from evertwin.features.perception import Perception, PerceptionState
from evertwin.fold import Chunk, Event, Out
from evertwin.fold.laws import join
from evertwin.fold.state import copy, equal, load, save
from evertwin.signals.planar import compose
from evertwin.sources.columns.scans import Lidar
from planted.halls import legs, met
from planted.rooms import box, ranges

LIDAR = Lidar(-np.pi, float(np.radians(1.0)), 12.0)
TABLE = np.array([0.3, 1.4, 0.4, 1.2, 0.7, 0.03])
MOVED = TABLE + np.array([-0.6, -2.7, 1.0, 0, 0, 0])
ROOM = np.concatenate([box(0, 0, 7, 6), box(2.9, 2.4, 0.8, 0.6), box(-2.8, -2.3, 0.6, 0.9)])
WAY = np.column_stack([np.linspace(-1.5, 1.5, 24), np.zeros(24), np.zeros(24)])


def scans(*stages: Sequence[np.ndarray], walker: bool = False) -> list[Chunk]:
    """To and fro, once for each of the stages: the tables that stand there."""
    out, angles, rng = [], LIDAR.angles(360), np.random.default_rng(3)
    for k, tables in enumerate(stages):
        for j, pose in enumerate(WAY[:: 1 if k % 2 == 0 else -1]):
            n = k * len(WAY) + j
            rounds = [np.zeros((0, 3)), *(legs(one) for one in tables)]
            if walker:  # steps of 60 cm, two feet
                x = -3.0 + (0.3 * n) % 6.0
                rounds.append(np.array([[x, -1.4, 0.06], [x + 0.25, -1.2, 0.06]]))
            seen = np.minimum(ranges(ROOM, pose, angles), met(np.concatenate(rounds), pose, angles))
            seen = seen + 0.01 * rng.normal(size=360)
            out.append(Chunk("scan", np.array([3 * 10**8 * n]), seen[None]))
    return out


def fold(
    on: Perception, chunks: Sequence[Chunk], state: PerceptionState | None = None
) -> tuple[PerceptionState, Out]:
    state, outs = on.init() if state is None else state, []
    for chunk in chunks:
        state, out = on.step(state, chunk)
        outs.append(out)
    return state, join(outs)


def stage(places: int = 3) -> Perception:
    return Perception("scan", LIDAR, 360, tables=places)


def told(out: Out) -> list[Event]:
    return [one for one in out.records if isinstance(one, Event)]


def in_map(table: np.ndarray) -> np.ndarray:
    """In the frame of the first scan."""
    return np.asarray(table[:5] - [WAY[0, 0], 0, 0, 0, 0])


def joined(chunks: Sequence[Chunk]) -> Chunk:
    t, v = (np.concatenate(both) for both in zip(*(one[1:3] for one in chunks)))
    return Chunk("scan", t, v)


@pytest.fixture(scope="module")
def moved() -> list[Chunk]:
    return scans([TABLE], [MOVED], [MOVED])


def test_a_table_that_was_moved_keeps_its_place_and_is_named(moved: list[Chunk]) -> None:
    _, out = fold(stage(), moved)
    named = [one for one in told(out) if one.kind == "table_moved"]
    assert told(out)[0].kind == "table_found" and len(named) == 1
    now, half = (np.array(named[0].evidence[key]) for key in ("now", "half95"))
    assert np.abs(now[:2] - in_map(MOVED)[:2]).max() < 0.03 and (half[:2] < 0.03).all()
    assert np.abs(np.array(named[0].evidence["before"])[:2] - in_map(TABLE)[:2]).max() < 0.03
    stood = out.rows.tables.reshape(-1, 3, 6)
    assert np.abs(stood[20, 0, :5] - in_map(TABLE)).max() < 0.06
    assert np.abs(stood[-1, 0, :5] - in_map(MOVED)).max() < 0.06 and not stood[-1, 1:].any()
    since = 24 * 3 * 10**8  # it may be told as soon as both places were seen, and is in 5 s
    assert since < named[0].time < since + 10 * 10**9


def test_the_laws_of_a_stage_hold(moved: list[Chunk]) -> None:
    on = stage()
    state, whole = fold(on, moved)
    rng = np.random.default_rng(1)
    cuts = [0, *sorted(rng.choice(np.arange(1, len(moved)), 9, replace=False)), len(moved)]
    pieces = [joined(moved[a:b]) for a, b in pairwise(cuts)]
    other, out = fold(on, pieces)
    assert equal(other, state) and equal(out.rows, whole.rows) and out.records == whole.records
    half, first = fold(on, moved[:30])
    again, second = fold(on, moved[30:], load(save(copy(half)), like=on.init()))
    both = join([first, second])
    assert equal(again, state) and equal(both.rows, whole.rows)
    assert both.records == whole.records


def test_where_nothing_is_moved_nothing_is_told_but_what_stands() -> None:
    _, out = fold(stage(), scans(*[[TABLE]] * 4, walker=True))
    assert [one.kind for one in told(out)] == ["table_found"]
    stood = out.rows.tables.reshape(-1, 3, 6)[24:]
    assert not stood[:, 1:].any(), "who walks there is no table"
    assert len(np.unique(stood[:, 0], axis=0)) < 5, "what is told does not tremble"


def test_a_table_that_is_gone_is_in_no_place() -> None:
    _, out = fold(stage(), scans([TABLE], [], []))
    assert [one.kind for one in told(out)] == ["table_found", "table_gone"]
    assert out.rows.tables[20].any() and not out.rows.tables[-1].any()


def test_more_tables_than_places_are_told() -> None:
    _, out = fold(stage(1), scans([TABLE, MOVED], [TABLE, MOVED]))
    found = [one.reason for one in told(out)]
    assert len(found) == 2 and sum("the model does not have it" in one for one in found) == 1
    assert out.rows.tables.shape[1] == 6 and out.rows.tables[-1].any()


def test_on_a_new_map_no_table_is_known(moved: list[Chunk]) -> None:
    """Carried elsewhere: another room, where no place is told to be the first map's."""
    far = np.concatenate([box(0, 0, 3.4, 9, 0.4), box(0.9, 2.6, 0.5, 0.5, 0.2)])
    angles, rng, other = LIDAR.angles(360), np.random.default_rng(5), []
    for n in range(24, 60):
        seen = ranges(far, compose(np.array([0, -2.0, 1.5]), np.array([0.05 * (n - 24), 0, 0])),
                      angles)  # fmt: skip
        other.append(Chunk("scan", np.array([3 * 10**8 * n]),
                           (seen + 0.01 * rng.normal(size=360))[None]))  # fmt: skip
    _, out = fold(stage(), [*moved[:24], *other])
    kinds = [one.kind for one in told(out)]
    assert kinds.count("tables_unknown") == 1 and "table_moved" not in kinds
    assert not out.rows.tables[-1].any()
