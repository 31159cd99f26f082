"""Where walls are alike all along the way: what noise says of the place there, which is nothing."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.features.maps.mapping import mapped
from evertwin.features.scans.fusion import Belief, Sighting, Step, measured, predicted
from evertwin.features.scans.poses import Fix
from evertwin.features.scans.scan_fit import Expected
from evertwin.features.scans.surface import noise, surface
from planted.corridors import ANGLES, WAY, corridor, driven, scanned
from planted.draws import first_of


@pytest.mark.parametrize("seed", range(5))
def test_a_noisy_wall_of_dense_points_is_a_wall(seed: int) -> None:
    """Its points looked like posts, which stood beside the robot wherever it went."""
    ranges = corridor(20.0, np.random.default_rng(seed), 4.0)
    assert noise(ranges) == pytest.approx(0.02, abs=0.004)
    found = np.zeros((len(ranges), 4))
    found = found[: surface(ranges, ANGLES, found)]
    assert np.mean((found[:, 2] == 0) & (found[:, 3] == 0)) < 0.03


@pytest.mark.parametrize("seed", range(5))
def test_walls_whose_direction_wavers_tell_no_place_along_them(seed: int) -> None:
    rng = np.random.default_rng(seed)
    belief = Belief.at_rest(0, np.zeros(3), np.eye(3) * 1e-6)
    for _ in range(200):
        belief = predicted(belief, Step(10**8, np.array([0.1, 0.0, 0.0]), np.nan))
        lean = rng.normal(0, 0.002)
        across = np.array([-np.sin(lean), np.cos(lean), 0.0])
        told = 4e5 * np.outer(across, across) + np.diag([0.0, 0.0, 1e6])
        pose = np.array([belief.pose[0], rng.normal(0, 0.0015), rng.normal(0, 0.001)])
        belief = measured(belief, Sighting(pose, told), 0.1).belief
    assert belief.pose[0] == pytest.approx(20.0, abs=0.05)
    assert belief.scale == pytest.approx(1.0, abs=0.002)
    assert belief.covariance[0, 0] > 0.9**2


@pytest.mark.long
def test_the_way_through_a_bare_corridor_is_that_of_the_wheels() -> None:
    """The walls' noise made 97 m of 141, and wheels were said to slip. `python -m proofs.corridors`
    asks it of more drives."""
    found = mapped(driven(0)).poses
    told = found.fix == Fix.MATCHED
    assert told.sum() > 100 and not found.slip.any()
    off = np.abs(found.pose[told, 0] - (WAY - WAY[0])[told])
    assert np.all(off < np.maximum(3 * np.sqrt(found.covariance[told, 0, 0]), 0.05))
    assert off.max() < 0.6


@first_of("seed", range(3))
def test_behind_a_corridor_of_unknown_length_a_new_segment_begins(seed: int) -> None:
    """Without odometry; its two ends are alike, and are not taken for one."""
    x = np.arange(1.5, 38.5, 0.1)
    found = mapped(scanned(x, seed)).poses
    told = found.fix != Fix.LOST
    assert not told[100:300].all() and told[-1] and found.segment[-1] >= 1
    for k in range(int(found.segment[-1]) + 1):
        one = np.flatnonzero(told & (found.segment == k))
        way = found.pose[one, 0] - found.pose[one[0], 0] - (x[one] - x[one[0]])
        sigma = np.sqrt(found.covariance[one, 0, 0] + found.covariance[one, 1, 1])
        assert np.all(np.abs(way) < np.maximum(3 * sigma, 0.5))


@pytest.mark.parametrize("seed", range(5))
def test_slip_may_end_where_no_scan_tells(seed: int) -> None:
    """Its scale was held on to through a corridor, and surely."""
    rng = np.random.default_rng(seed)
    belief, x = Belief.at_rest(0, np.zeros(3), np.eye(3) * 1e-6), 0.0
    across = np.diag([0.0, 4e5, 1e6])
    for k in range(300):
        slips, told = 100 <= k < 150, k < 150
        x += 0.1
        belief = predicted(belief, Step(10**8, np.array([0.16 if slips else 0.1, 0, 0]), np.nan))
        seen = np.array([x, 0.0, 0.0]) + rng.normal(0, [0.002, 0.0015, 0.001])
        information = across + np.diag([2e5, 0.0, 0.0]) * told
        belief = measured(belief, Sighting(seen, information), 0.16 if slips else 0.1).belief
        if k == 149:
            assert belief.scale == pytest.approx(0.625, abs=0.03)
    assert abs(belief.pose[0] - x) < 2.5 * np.sqrt(belief.covariance[0, 0])


@pytest.mark.parametrize("seed", range(5))
def test_few_noisy_points_at_the_edge_of_a_scan_have_no_direction(seed: int) -> None:
    """One that faced along a corridor told the place there to a centimetre."""
    rng, angles, odd = np.random.default_rng(seed), np.radians(np.arange(-90, 91, 1.0)), 0
    with np.errstate(divide="ignore"):
        walls = 1 / np.abs(np.sin(angles))
    for _ in range(40):
        found = np.zeros((len(angles), 4))
        seen = np.where(walls < 8, walls + rng.normal(0, 0.02, len(angles)), np.nan)
        count = surface(seen, angles, found)
        odd += int((np.abs(found[:count, 2]) > 0.4).sum())
    assert odd <= 5


@first_of("seed", range(3))
def test_a_robot_that_drives_off_is_not_sure_to_stand(seed: int) -> None:
    """Without odometry; all it did so far was to stand."""
    x = np.r_[np.full(20, 2.0), np.arange(2.0, 38.0, 0.12)]
    found = mapped(scanned(x, seed))
    told = (found.poses.fix != Fix.LOST) & (found.poses.segment == 0)
    way = found.poses.pose[told, 0] - (x[told] - x[0])
    assert told.sum() > 30 and np.abs(way).max() < 0.8


def test_a_scan_says_which_of_the_places_it_was_expected_in_it_is_not() -> None:
    """A metre on, as usual, or still at rest: all of them made the pose too unsure to be told."""
    places = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    near = np.diag([0.1, 0.1, 0.1]) ** 2
    expected = Expected(places[0], near, places=places, weights=np.array([0.6, 0.4]))
    alike, told = np.zeros(2), np.array([0.0, -20.0])
    assert expected.others(places[0], list(places), alike)[0, 0] == pytest.approx(0.4)
    assert expected.others(places[0], list(places), told)[0, 0] < 1e-6
    assert expected.others(places[1], list(places), told)[0, 0] == pytest.approx(1.0)
