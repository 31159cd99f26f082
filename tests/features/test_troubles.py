"""Bad scans: each is named, and none becomes a confident wrong pose."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from evertwin.errors import DataError
from evertwin.features.maps.mapping import Mapped, mapped
from evertwin.features.maps.troubles import troubles
from evertwin.features.scans.poses import Fix
from evertwin.signals.planar import between, chained, compose
from evertwin.sources.columns.scans import Lidar, Scans
from planted.draws import first_of
from planted.rooms import Sensor, box, ranges, recorded

pytest.importorskip("gtsam", reason="the extra perception is not installed")
SMALL = Sensor(beams=120, step=np.radians(3.0), apart=0.25)


@pytest.fixture(scope="module")
def drive() -> tuple[Scans, np.ndarray]:
    return recorded(3, SMALL, laps=0.45, slip=0.05)


def off(found: Mapped, truth: np.ndarray) -> np.ndarray:
    """Distance of each pose from the true one [m], both from the first scan on."""
    true = between(np.broadcast_to(truth[0], truth.shape), truth)
    return np.asarray(np.hypot(*(found.poses.pose - true)[:, :2].T))


def told(found: Mapped) -> str:
    return " ".join(found.findings)


def test_a_blocked_lidar_goes_on_by_odometry_and_is_named(drive: tuple[Scans, np.ndarray]) -> None:
    scans, truth = drive
    ranges, rng = scans.ranges.copy(), np.random.default_rng(0)
    ranges[20:26] = 0.2 + 0.005 * rng.normal(size=(6, 120))
    ranges[30:33] = np.nan
    found = mapped(replace(scans, ranges=ranges))
    fix = found.poses.fix
    assert np.all(fix[20:26] == Fix.PREDICTED) and np.all(fix[30:33] == Fix.PREDICTED)
    assert off(found, truth).max() < 0.25
    assert "scans 20 to 25 end nearer than 0.35 m" in told(found)
    assert "scans 30 to 32 see nothing" in told(found)


def test_a_frozen_lidar_on_wheels_that_turn_is_not_believed(
    drive: tuple[Scans, np.ndarray],
) -> None:
    scans, truth = drive
    ranges = scans.ranges.copy()
    ranges[21:28] = ranges[20]
    found = mapped(replace(scans, ranges=ranges))
    assert np.all(found.poses.fix[21:28] == Fix.PREDICTED) and off(found, truth).max() < 0.25
    assert "scans 20 to 27 say number by number the same" in told(found)


@first_of("turn", [-1.6, 3.1])
def test_a_lidar_that_looks_elsewhere_than_was_said(
    drive: tuple[Scans, np.ndarray], turn: float
) -> None:
    scans, truth = drive
    lidar = replace(scans.lidar, start=scans.lidar.start - turn)
    found = mapped(replace(scans, lidar=lidar))
    assert off(found, truth).max() < 0.25 and "further to the" in told(found)
    assert abs(np.angle(np.exp(1j * (found.lidar.mount[2] - turn)))) < 0.05


def test_beams_that_run_the_other_way_round(drive: tuple[Scans, np.ndarray]) -> None:
    scans, truth = drive
    lidar = replace(scans.lidar, start=-scans.lidar.start, step=-scans.lidar.step)
    found = mapped(replace(scans, lidar=lidar))
    assert off(found, truth).max() < 0.25 and "the other way round" in told(found)


def test_turns_of_a_log_whose_beams_run_one_way_are_counted_the_other_way(
    drive: tuple[Scans, np.ndarray],
) -> None:
    scans, truth = drive
    assert scans.odometry is not None
    found = mapped(replace(scans, odometry=scans.odometry * [1, -1, -1], handed=True))
    assert off(found, truth).max() < 0.25 and "its turns are taken the other way" in told(found)


@pytest.mark.parametrize("handed", [False, True])
@pytest.mark.parametrize("aside", [(0.35, 0.0), pytest.param((-0.2, 0.15), marks=pytest.mark.long)])
def test_a_lidar_beside_the_middle(aside: tuple[float, float], handed: bool) -> None:
    scans, lidar = recorded(3, SMALL, laps=1.0, slip=0.05)
    assert scans.odometry is not None and "the left of where" not in told(mapped(scans))
    back = np.broadcast_to([-aside[0], -aside[1], 0.0], lidar.shape)
    there = replace(scans, odometry=compose(scans.odometry, back), handed=handed)
    found = mapped(there)
    assert "the left of where was said: taken to be there" in told(found)
    if handed:  # poses stay the lidar's
        assert found.lidar.mount == (0.0, 0.0, 0.0)
        assert off(found, lidar).max() < 0.25
    else:
        assert found.lidar.mount[:2] == pytest.approx(aside, abs=0.06)
        assert off(found, compose(lidar, back)).max() < 0.25


@pytest.mark.parametrize(("factor", "most"), [(1.6, 0.1), (0.0, 1.0)])
@pytest.mark.parametrize("seed", [3, 4])
def test_wheels_that_slip_or_stand_are_denied(seed: int, factor: float, most: float) -> None:
    """Standing ones led up to 8 m astray; what is left are the steps that a scan barely tells."""
    scans, truth = recorded(seed, Sensor(apart=0.3), laps=0.4)
    steps = between(truth[:-1], truth[1:])
    steps[20:35] *= factor
    found = mapped(replace(scans, odometry=chained(np.zeros(3), steps)))
    first = found.poses.segment == 0
    assert np.nanmax(off(found, truth)[first]) < most
    assert (found.poses.fix[first] != Fix.LOST).mean() > 0.85


def test_odometry_that_leaps_leads_no_scan_astray(drive: tuple[Scans, np.ndarray]) -> None:
    scans, truth = drive
    assert scans.odometry is not None
    odometry = scans.odometry.copy()
    onward = between(np.broadcast_to(odometry[29], odometry[30:].shape), odometry[30:])
    odometry[30:] = compose(np.broadcast_to([1.0, 2.0, 0.5], onward.shape), onward)
    found = mapped(replace(scans, odometry=odometry))
    assert off(found, truth).max() < 0.25


def test_beams_that_end_on_the_machine_itself(drive: tuple[Scans, np.ndarray]) -> None:
    scans, truth = drive
    ranges = scans.ranges.copy()
    ranges[:, 50:80] = 0.15
    found = mapped(replace(scans, ranges=ranges))
    assert off(found, truth).max() < 0.1 and "30 beams always end at 0.15" in told(found)


def test_a_robot_that_is_carried_away_is_lost_and_found_again(
    drive: tuple[Scans, np.ndarray],
) -> None:
    """From one place of its drive to one where it was before, its wheels standing."""
    scans, truth = drive
    n = len(scans.t)
    order = np.concatenate([np.arange(n), np.arange(8, 30)])
    assert scans.odometry is not None
    onward = between(np.broadcast_to(scans.odometry[8], (22, 3)), scans.odometry[8:30])
    wheels = compose(np.broadcast_to(scans.odometry[-1], (22, 3)), onward)
    rng = np.random.default_rng(1)
    both = replace(
        scans, t=np.arange(len(order), dtype=np.int64) * 5 * 10**8,
        ranges=scans.ranges[order] + 0.01 * rng.normal(size=(len(order), 120)),
        odometry=np.concatenate([scans.odometry, wheels]),
    )  # fmt: skip
    found = mapped(both)
    carried = found.poses.fix[n : n + 8]
    assert Fix.LOST in carried and np.all(found.poses.fix[-10:] == Fix.MATCHED)
    known = np.isfinite(found.poses.pose[:, 0]) & (found.poses.segment == 0)
    assert known[-10:].all()
    assert np.nanmax(off(found, truth[order])[known & (np.arange(len(order)) >= n)]) < 0.2


@first_of("seed", range(3))
def test_a_robot_that_is_carried_among_pillars_that_repeat_is_not_placed_at_another(
    seed: int,
) -> None:
    """After five scans one of the map around where it had been fitted: 9 m off, and sure."""
    walls = np.concatenate(
        [
            box(0, 0, 32, 24),
            *(box(4 * i - 12, 4 * k - 8, 0.4, 0.4) for i in range(7) for k in range(5)),
        ]
    )
    rng, angles = np.random.default_rng(seed), np.radians(np.arange(-180.0, 180.0))
    before, after = np.arange(-12.0, 2.7, 0.2), np.r_[np.full(4, -2.0), np.arange(-2.0, 2.0, 0.12)]
    x, y = np.r_[before, after], np.r_[np.full(len(before), 6.0), np.full(len(after), -2.0)]
    truth = np.column_stack([x, y, np.zeros(len(x))])
    seen = np.array([ranges(walls, pose, angles) for pose in truth])
    seen = np.where(seen < 10, seen + 0.02 * rng.normal(size=seen.shape), np.nan)
    steps = np.where(np.diff(x) < 0, 0.0, np.diff(x)) * (1.02 + 0.02 * rng.normal(size=len(x) - 1))
    wheels = np.column_stack([np.r_[0.0, np.cumsum(steps)], np.zeros((len(x), 2))])
    t = np.arange(len(x), dtype=np.int64) * 2 * 10**8
    lidar = Lidar(float(angles[0]), float(np.radians(1.0)), 10.0)
    found = mapped(Scans("scan", t, seen, lidar, odometry=wheels))
    here = (found.poses.segment == 0) & (found.poses.fix == Fix.MATCHED)
    assert off(found, truth)[here].max() < 0.2 and here.sum() >= len(before) - 2
    assert found.poses.fix[-1] == Fix.MATCHED


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_ranges_of_another_scale_than_the_wheels_are_named(
    drive: tuple[Scans, np.ndarray], factor: float
) -> None:
    scans, _ = drive
    assert "times that by the wheels" not in told(mapped(scans))
    other = replace(scans, ranges=factor * scans.ranges)
    named = re.search(r"by the scans is ([\d.]+) times that by the wheels", told(mapped(other)))
    assert named is not None and float(named[1]) == pytest.approx(factor, rel=0.1)


@first_of("seed", [1, 2, 3])
def test_beams_that_are_further_apart_than_was_taken_are_named(seed: int) -> None:
    one = Sensor(beams=240, step=np.radians(1.0), apart=0.1)
    scans, _ = recorded(seed, one, laps=0.3, slip=0.05)
    assert "as far as the wheels" not in told(mapped(scans))
    narrow = replace(scans.lidar, start=0.6 * scans.lidar.start, step=0.6 * scans.lidar.step)
    named = re.search(r"beams are ([\d.]+)° apart", told(mapped(replace(scans, lidar=narrow))))
    assert named is not None and float(named[1]) == pytest.approx(1.0, rel=0.1)


def test_scans_of_few_beams_are_not_said_to_see_nothing() -> None:
    seen = np.full((6, 40), np.nan)
    seen[:, :3] = 2.0 + 0.01 * np.random.default_rng(0).normal(size=(6, 3))
    few = Scans("scan", np.arange(6), seen, Lidar(0.0, 0.1, 30.0))
    assert troubles(few) == ["scans 0 to 5 get fewer than 10 % of their beams back"]


def test_ranges_in_millimetres_are_asked_about(drive: tuple[Scans, np.ndarray]) -> None:
    scans, _ = drive
    with pytest.raises(DataError, match="in millimetres"):
        mapped(replace(scans, ranges=np.full_like(scans.ranges, np.nan), odometry=None))


def test_ranges_that_are_no_metres_are_asked_about_before_they_are_followed(
    drive: tuple[Scans, np.ndarray],
) -> None:
    scans, _ = drive
    with pytest.raises(DataError, match="in millimetres"):
        mapped(replace(scans, ranges=1000 * scans.ranges))
