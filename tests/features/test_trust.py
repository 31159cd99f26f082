"""Wheels, gyro and scans: two that agree outvote the third, which is named and left out."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from evertwin.features.maps.mapping import mapped
from evertwin.features.scans.poses import Fix
from evertwin.features.scans.trust import without_repeats
from evertwin.features.scans.voting import outvoted
from evertwin.signals.planar import between, compose
from evertwin.sources.columns.scans import Lidar, Scans, Track
from planted.draws import first_of
from planted.rooms import box, ranges

pytest.importorskip("gtsam", reason="the extra perception is not installed")
RATE = 5
SECONDS = 24


def driven(seed: int, noise: float = 0.01) -> tuple[Scans, np.ndarray]:
    """A robot that turns this way and that in a room with boxes, with wheels and a gyro."""
    rng = np.random.default_rng(seed)
    walls = np.concatenate(
        [box(0, 0, 9, 7), *(box(*rng.uniform(-3.5, 3.5, 2), 0.5, 0.8, k) for k in range(4))]
    )
    t, fine = np.arange(0, SECONDS, 1 / RATE), np.arange(0, SECONDS, 0.02)
    turn = 0.8 * np.sin(2 * np.pi * fine / rng.uniform(5, 8))
    heading = np.cumsum(turn) * 0.02
    way = np.column_stack([0.15 * np.cos(heading), 0.15 * np.sin(heading)]).cumsum(axis=0) * 0.02
    true = np.column_stack([way - way.mean(axis=0), heading])[:: 50 // RATE]
    angles = np.radians(np.arange(-180.0, 180.0, 2.0))
    seen = np.array([ranges(walls, pose, angles) for pose in true])
    seen = seen + noise * rng.normal(size=seen.shape)
    stamps, ns = (t * 1e9).astype(np.int64), (fine * 1e9).astype(np.int64)
    steps = between(true[:-1], true[1:]) * [1.02, 1.02, 0.98]
    wheels = [np.zeros(3)]
    for step in steps:
        wheels.append(compose(wheels[-1], step))
    odometry = np.array(wheels)
    rate = (turn + 0.01 + 0.004 * rng.normal(size=len(turn)))[:, None]
    scans = Scans(
        "scan", stamps, seen, Lidar(float(angles[0]), float(np.radians(2.0)), 20.0),
        odometry=odometry, wheels=Track("/odom", stamps, stamps, odometry),
        gyro=Track("/imu", ns, ns, rate), arrived=stamps,
    )  # fmt: skip
    return scans, between(np.broadcast_to(true[0], true.shape), true)


def wheels_of(scans: Scans, poses: np.ndarray) -> Scans:
    assert scans.wheels is not None
    return replace(scans, odometry=poses, wheels=scans.wheels._replace(values=poses))


@pytest.mark.parametrize("factor", [-1.0, 57.3])
def test_a_gyro_of_another_sign_or_unit_is_named_and_left_out(factor: float) -> None:
    scans, truth = driven(1)
    assert scans.gyro is not None
    gyro = scans.gyro._replace(values=factor * scans.gyro.values)
    found = mapped(replace(scans, gyro=gyro))
    [said] = [line for line in found.findings if "the gyro turns" in line]
    named = re.search(r"the gyro turns ([-\d.]+) times as far", said)
    assert named is not None and float(named[1]) == pytest.approx(factor, rel=0.1)
    assert (found.poses.fix == Fix.MATCHED).mean() > 0.95 and found.fused is not None
    off = found.fused.pose[:, :2] - truth[-len(found.fused.t) :, :2]
    assert np.hypot(*off.T).max() < 0.05


def test_wheels_that_stand_while_gyro_and_scans_turn_are_left_out_from_then_on() -> None:
    scans, truth = driven(2)
    assert scans.odometry is not None
    stands = np.minimum(np.arange(len(scans.t)), 40)
    found = mapped(wheels_of(scans, scans.odometry[stands]))
    assert any("the wheels turn 0 times as far" in line for line in found.findings)
    off = found.poses.pose - truth
    assert np.hypot(*off[:, :2].T).max() < 0.05
    assert found.fused is not None and found.fused.t[-1] < scans.t[60]


def test_wheels_that_turn_the_other_way_do_not_turn_the_map_over() -> None:
    scans, truth = driven(3)
    assert scans.odometry is not None
    found = mapped(wheels_of(scans, scans.odometry * [1.0, -1.0, -1.0]))
    assert any("the wheels turn -" in line for line in found.findings)
    assert not any("other way round" in line for line in found.findings)
    assert np.hypot(*(found.poses.pose - truth)[:, :2].T).max() < 0.05


def test_a_frozen_lidar_with_jitter_is_outvoted_by_wheels_and_gyro() -> None:
    scans, truth = driven(4)
    rng = np.random.default_rng(4)
    frozen = scans.ranges.copy()
    frozen[40:80] = frozen[40] + 0.002 * rng.normal(size=(40, frozen.shape[1]))
    found = mapped(replace(scans, ranges=frozen))
    assert any("a frozen lidar" in line for line in found.findings)
    coarse = frozen.copy()
    coarse[40:80] += 0.02 * rng.normal(size=(40, frozen.shape[1]))  # more than its noise
    assert any("a frozen lidar" in x for x in mapped(replace(scans, ranges=coarse)).findings)
    assert (found.poses.fix[42:79] == Fix.PREDICTED).all()
    assert np.hypot(*(found.poses.pose - truth)[:, :2].T).max() < 0.2


def test_a_lidar_that_repeats_itself_by_less_than_its_noise_is_frozen() -> None:
    """Wheels alone tell; those that spin while the machine stands are another thing."""
    scans, truth = driven(6)
    rng, n = np.random.default_rng(6), scans.ranges.shape[1]
    frozen, stuck = scans.ranges.copy(), scans.ranges.copy()
    frozen[40:80] = frozen[40] + 0.002 * rng.normal(size=(40, n))
    stuck[40:80] += np.median(stuck[35:41], axis=0) - stuck[40:80]
    stuck[40:80] += 0.01 * rng.normal(size=(40, n))
    found = without_repeats(replace(scans, ranges=frozen, gyro=None))
    assert np.isnan(found.ranges[41:80]).all() and np.isfinite(found.ranges[:41]).all()
    assert "scans 40 to 79 repeat one another" in " ".join(found.findings)
    for one in (scans, replace(scans, ranges=stuck, gyro=None)):
        assert without_repeats(one).findings == ()
    assert (
        np.hypot(*(mapped(replace(scans, ranges=frozen)).poses.pose - truth)[:, :2].T).max() < 0.2
    )


@first_of("seed", range(3))
def test_three_that_agree_are_left_alone(seed: int) -> None:
    scans, _ = driven(seed)
    assert mapped(scans).findings == ()


@first_of("seed", range(3))
def test_of_noisy_ranges_the_covariance_is_honest(seed: int) -> None:
    """Errors from the first scan on: squared over their covariance, 3 on average asked."""
    scans, truth = driven(seed, noise=0.05)
    found = mapped(scans)
    assert found.fused is not None
    fused = truth[np.searchsorted(scans.t, found.fused.t)]
    pairs = ((found.poses.pose, found.poses.covariance, truth),
             (found.fused.pose, found.fused.covariance, fused))  # fmt: skip
    for pose, covariance, true in pairs:
        off = pose - true
        square = np.einsum("ni,nij,nj->n", off, np.linalg.inv(covariance), off)
        assert np.mean(square < 7.8) > 0.8 and square.mean() > 0.1


def test_nobody_is_outvoted_where_only_two_are_known() -> None:
    ends = np.arange(40.0)
    angles = np.column_stack([0.3 * ends, -0.3 * ends, np.full(40, np.nan)])
    assert outvoted(ends, angles) == []


def test_half_a_lidar_that_is_covered_is_left_out() -> None:
    scans, truth = driven(5)
    covered = scans.ranges.copy()
    covered[30:100, 60:150] = 0.25
    found = mapped(replace(scans, ranges=covered))
    [said] = [line for line in found.findings if "a part of the lidar is blocked" in line]
    assert said.startswith("90 of 180 beams, 60 to 149") and "scans 30 to 99" in said
    assert np.hypot(*(found.poses.pose - truth)[:, :2].T).max() < 0.05
    assert not found.poses.slip.any()
