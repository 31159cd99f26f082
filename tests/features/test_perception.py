"""The pose while scans come: the laws of a stage, what is waited for, and what is told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from evertwin.errors import DataError
from evertwin.features.perception import WAITING, Perception, PerceptionState
from evertwin.features.placed import Placed
from evertwin.fold import Chunk, Out
from evertwin.fold.laws import join
from evertwin.fold.state import copy, equal, load, save
from evertwin.sources.columns.scans import Scans
from planted.rooms import Sensor, recorded

SMALL = Sensor(beams=90, step=np.radians(2.0), apart=0.25)
STEP = 5 * 10**8


@pytest.fixture(scope="module")
def drive() -> tuple[Scans, np.ndarray]:
    return recorded(3, SMALL, laps=0.3, slip=0.05)


def stage(scans: Scans, **more: Any) -> Perception:
    return Perception("scan", scans.lidar, 90, **more)


def seen(scans: Scans, first: int = 0, stop: int = 20, task: int = 0) -> list[Chunk]:
    return [Chunk("scan", scans.t[k : k + 1], scans.ranges[k : k + 1], task)
            for k in range(first, stop)]  # fmt: skip


def words(scans: Scans, first: int = 0, stop: int = 20) -> list[Chunk]:
    """Wheels four times as often as scans, and a gyro that says what they say."""
    assert scans.odometry is not None
    at = np.arange(scans.t[first], scans.t[stop - 1] + 1, STEP // 4)
    whole = scans.odometry.copy()
    whole[:, 2] = np.unwrap(whole[:, 2])
    v = np.column_stack([np.interp(at, scans.t, column) for column in whole.T])
    rate = np.gradient(v[:, 2], at * 1e-9)
    wheels = [Chunk("odom", at[k : k + 1], v[k : k + 1]) for k in range(len(at))]
    gyro = [Chunk("imu", at[k : k + 1], rate[k : k + 1, None]) for k in range(len(at))]
    return [one for both in zip(wheels, gyro) for one in both]


def merged(*chunks: Chunk) -> list[Chunk]:
    return sorted(chunks, key=lambda one: int(one.t[0]))


def fold(
    on: Perception, chunks: Sequence[Chunk], state: PerceptionState | None = None
) -> tuple[PerceptionState, Out]:
    state, outs = on.init() if state is None else state, []
    for chunk in chunks:
        state, out = on.step(state, chunk)
        outs.append(out)
    return state, join(outs)


def poses(on: Perception, chunks: Sequence[Chunk]) -> tuple[Placed, list[str]]:
    state, out = fold(on, chunks)
    last = on.flush(state)[1]
    whole = join([out, last])
    return whole.rows, [one.kind for one in whole.records]


def larger(chunks: list[Chunk], rng: np.random.Generator) -> list[Chunk]:
    """The same samples, several of one source at once where they follow each other."""
    out: list[Chunk] = []
    for chunk in chunks:
        if out and out[-1].source == chunk.source and rng.random() < 0.7:
            t, v = (np.concatenate(both) for both in zip(out[-1][1:3], chunk[1:3]))
            out[-1] = chunk._replace(t=t, v=v)
        else:
            out.append(chunk)
    return out


@pytest.mark.parametrize("wheels", [False, True])
def test_the_laws_of_a_stage_hold(drive: tuple[Scans, np.ndarray], wheels: bool) -> None:
    scans = drive[0]
    more = {"wheels": "odom", "gyro": "imu"} if wheels else {}
    on, chunks = stage(scans, **more), seen(scans)
    blind = chunks[9]._replace(v=np.full((1, 90), np.nan))
    chunks = [*chunks[:9], blind, *chunks[10:14], *chunks[16:]]
    chunks = merged(*chunks, *(words(scans)[:100] if wheels else ()))
    whole = fold(on, chunks)
    rng = np.random.default_rng(1)
    late = [*chunks[: len(chunks) // 2 : 2], *chunks[1 : len(chunks) // 2 : 2]]
    for told in (chunks, late):
        a, b = fold(on, told), fold(on, larger(list(told), rng))
        assert equal(a[0], b[0]) and equal(a[1].rows, b[1].rows) and a[1].records == b[1].records
    half = len(chunks) // 2
    state, first = fold(on, chunks[:half])
    state = load(save(copy(state)), like=on.init())
    state, second = fold(on, chunks[half:], state)
    assert equal(state, whole[0]) and equal(join([first, second]).rows, whole[1].rows)
    assert equal(on.init(), on.init())


def test_poses_are_those_of_the_drive(drive: tuple[Scans, np.ndarray]) -> None:
    scans, truth = drive
    for on, more in ((stage(scans), []), (stage(scans, wheels="odom", gyro="imu"), words(scans))):
        found, told = poses(on, merged(*seen(scans), *more))
        turn = truth[0, 2]
        c, s = np.cos(turn), np.sin(turn)
        off = (truth[:20, :2] - truth[0, :2]) @ np.array([[c, -s], [s, c]])
        assert found.t.tolist() == scans.t[:20].tolist() and told == []
        assert np.hypot(*(found.pose[:, :2] - off).T).max() < 0.05


def test_a_scan_waits_for_wheels_and_gyro(drive: tuple[Scans, np.ndarray]) -> None:
    """That come later than it, as long as they come in time."""
    scans = drive[0]
    on = stage(scans, wheels="odom", gyro="imu")
    inorder, _ = poses(on, merged(*words(scans), *seen(scans)))
    late = sorted([*((int(c.t[0]) + STEP * (c.t[0] > 0), c) for c in words(scans)),
                   *((int(c.t[0]), c) for c in seen(scans))], key=lambda one: one[0])  # fmt: skip
    found, told = poses(on, [chunk for _, chunk in late])
    assert told == [] and equal(found, inorder)


def test_wheels_that_fall_silent_are_told_of_and_not_waited_for(
    drive: tuple[Scans, np.ndarray],
) -> None:
    scans = drive[0]
    on = stage(scans, wheels="odom")
    spoken = [one for one in words(scans) if one.source == "odom"]
    chunks = merged(*seen(scans), *(c for c in spoken if not 6 * STEP < c.t[0] < 14 * STEP))
    found, told = poses(on, chunks)
    assert told == ["unheard", "heard"] and np.isfinite(found.pose).all()
    state, _ = fold(on, [c for c in chunks if c.t[0] <= 12 * STEP])
    assert state.came - state.read == 0, "once unheard, nobody waits for them"
    never, none = poses(on, seen(scans))
    assert none == [] and equal(never, poses(stage(scans), seen(scans))[0])


def test_without_a_pose_there_is_none_and_it_is_said(drive: tuple[Scans, np.ndarray]) -> None:
    scans = drive[0]
    chunks = seen(scans)
    covered = [c._replace(v=np.full((1, 90), 0.1)) for c in chunks[8:13]]
    found, told = poses(stage(scans), [*chunks[:8], *covered, *chunks[13:]])
    assert told[:1] == ["pose_lost"] and np.isnan(found.pose[8:13]).all()
    assert "pose_found" in told and np.isfinite(found.pose[-1]).all()


def test_scans_that_are_missing_or_out_of_order_are_told_of(
    drive: tuple[Scans, np.ndarray],
) -> None:
    scans = drive[0]
    chunks = seen(scans)
    gone, told = poses(stage(scans), [*chunks[:8], *chunks[16:]])
    assert told[0] == "scans_missing" and len(gone.t) == 12
    swapped = [*chunks[:6], chunks[7], chunks[6], chunks[7], *chunks[8:]]
    found, said = poses(stage(scans), swapped)
    assert said == ["late"] and len(found.t) == 19


def test_a_later_task_is_another_drive(drive: tuple[Scans, np.ndarray]) -> None:
    scans = drive[0]
    second = [c._replace(t=c.t + 10**12) for c in seen(scans, 5, 15, task=1)]
    found, _ = poses(stage(scans, silent=1.0), [*seen(scans, 0, 10), *second, seen(scans)[11]])
    assert found.task.tolist() == [0] * 10 + [1] * 10
    assert found.pose[10].tolist() == [0.0, 0.0, 0.0]


def test_poses_as_often_as_asked(drive: tuple[Scans, np.ndarray]) -> None:
    scans = drive[0]
    every = poses(stage(scans), seen(scans))[0]
    chunks = seen(scans)
    found = poses(stage(scans, every=1.0), [*chunks[:4], *chunks[5:]])[0]
    assert (found.t * 1e-9).tolist()[:5] == [0.0, 1.0, 2.5, 3.0, 4.0]
    assert found.pose[1].tolist() == every.pose[2].tolist()


def test_memory_is_bounded(drive: tuple[Scans, np.ndarray]) -> None:
    """Scans that come faster than wheels allow are matched with what was said."""
    scans = drive[0]
    on = stage(scans, wheels="odom", silent=1e3)
    state, _ = fold(on, [c for c in words(scans) if c.source == "odom"][:5])
    crowd = [Chunk("scan", np.array([STEP + k]), scans.ranges[:1]) for k in range(WAITING + 8)]
    state, _ = fold(on, crowd, state)
    assert state.came - state.read <= WAITING and state.ranges.shape == (WAITING, 90)


def test_what_does_not_fit_is_refused(drive: tuple[Scans, np.ndarray]) -> None:
    on = stage(drive[0])
    with pytest.raises(DataError, match="source 'scan': expected 90 values, got"):
        on.step(on.init(), Chunk("scan", np.array([0]), np.ones((1, 91))))


def driving(speed: float, t: int = -1) -> Chunk:
    return Chunk("drives", np.array([t]), np.array([[0.0, speed]]))


def standing_still(scans: Scans, first: int = 8, stop: int = 14) -> list[Chunk]:
    """Scans of a drive, of which one comes again and again."""
    chunks = seen(scans)
    again = [c._replace(v=chunks[first - 1].v) for c in chunks[first:stop]]
    return [*chunks[:first], *again, *chunks[stop:]]


def test_a_frozen_lidar_is_named_and_none_of_its_scans_tells_a_pose(
    drive: tuple[Scans, np.ndarray],
) -> None:
    scans = drive[0]
    on = stage(scans, drives=("drives",))
    chunks = [driving(0.5), *standing_still(scans)]
    found, told = poses(on, chunks)
    assert np.isnan(found.pose[8:14]).all() and np.isfinite(found.pose[:8]).all()
    assert told[:2] == ["scans_frozen", "pose_lost"] and told.count("scans_frozen") == 1
    [event] = [one for one in fold(on, chunks)[1].records if one.kind == "scans_frozen"]
    assert event.evidence["first"] == scans.t[7] and "while the inputs drive" in event.reason
    turns = [*chunks[:11], driving(0.0, int(scans.t[9]) + 1), *chunks[11:]]
    assert np.isnan(poses(on, turns)[0].pose[8:14]).all(), "it stays frozen where the drive stops"
    state, first = fold(on, chunks[:12])
    state = load(save(copy(state)), like=on.init())
    assert equal(join([first, fold(on, chunks[12:], state)[1]]).rows, fold(on, chunks)[1].rows)


def test_a_machine_that_stands_may_see_the_same_again(drive: tuple[Scans, np.ndarray]) -> None:
    """Without noise, as in a simulation."""
    scans = drive[0]
    on = stage(scans, drives=("drives",))
    stops, goes = driving(0.0, int(scans.t[7])), driving(0.5, int(scans.t[13]))
    chunks = [driving(0.5), *standing_still(scans)]
    found, told = poses(on, merged(*chunks, stops, goes))
    assert told == [] and np.isfinite(found.pose[:14]).all()
    unsaid, why = poses(stage(scans), chunks[1:])
    assert np.isfinite(unsaid.pose[:10]).all() and np.isnan(unsaid.pose[10:14]).all()
    assert "scans_frozen" in why, "nobody says whether it drives: only after a few"


@pytest.mark.parametrize(("factor", "meant"), [(1e3, "mm"), (1e2, "cm"), (1e-3, "m")])
def test_ranges_in_another_unit_are_named(
    drive: tuple[Scans, np.ndarray], factor: float, meant: str
) -> None:
    scans = drive[0]
    wide = replace(scans.lidar, longest=np.inf)
    declared = "mm" if factor < 1.0 else "m"
    on = Perception("scan", wide, 90, unit=declared)
    chunks = [c._replace(v=factor * c.v) for c in seen(scans)]
    found, told = poses(on, chunks)
    assert told[:2] == ["pose_lost", "unit_doubted"] and told.count("unit_doubted") == 1
    assert np.isnan(found.pose[2:, 0]).mean() > (0.6 if meant == "cm" else 0.99)
    [event] = [one for one in fold(on, chunks)[1].records if one.kind == "unit_doubted"]
    assert f"unit = '{meant}'" in event.reason and "[perception]" in event.reason
    assert event.reason.endswith(f"it is '{declared}' now")


def test_a_loss_is_told_once_however_many_maps_are_begun(drive: tuple[Scans, np.ndarray]) -> None:
    """A map is one where a second scan is found in it."""
    scans = drive[0]
    rng, chunks = np.random.default_rng(1), seen(scans, 0, 16)
    fog = [c._replace(v=rng.uniform(1.0, 9.0, (1, 90))) for c in chunks[4:]]
    rest = [c._replace(t=c.t + 16 * STEP) for c in seen(scans, 0, 10)]
    found, told = poses(stage(scans), [*chunks[:4], *fog, *rest])
    assert told == ["pose_lost", "pose_found"]
    assert np.isnan(found.pose[4:16]).all() and np.isfinite(found.pose[-3:]).all()
