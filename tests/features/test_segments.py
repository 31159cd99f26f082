"""Maps of one recording that are put together; and what a corridor left open, told afterwards."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt, maximum_filter

from evertwin.features.maps import segments
from evertwin.features.maps.mapping import followed
from evertwin.features.maps.occupancy import FREE, OCCUPIED, Occupancy
from evertwin.features.maps.open_ways import evened
from evertwin.features.maps.relocalisation import BEHIND, Barriers, Located, View
from evertwin.features.maps.trajectory_error import trajectory_error
from evertwin.features.scans.poses import Fix, Poses
from evertwin.signals.planar import between, compose
from planted.draws import first_of
from planted.rooms import Sensor, recorded

pytest.importorskip("gtsam", reason="the extra perception is not installed")
COARSE = Sensor(beams=120, step=np.radians(2.0), apart=0.25)


def test_a_segment_joins_where_two_parts_of_it_place_it_alike(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Among pillars that repeat one part fits somewhere: poses leapt by 16 m."""
    scans, _ = recorded(4, COARSE, laps=1.1, slip=0.05)
    poses = followed(scans).poses
    known, keys = segments.solved(scans, poses), segments.keyframes(poses, 0)
    of = known, segments._charted(scans, known)
    looked = segments._Looked(scans, {}, iter(range(100)))
    anchor = next(segments._anchors(looked, poses, keys, of))
    at = np.searchsorted(keys, [anchor.edge.start, anchor.edge.end])
    place = compose(known.graph.poses[at[0]], anchor.edge.step)
    assert np.hypot(*(place - poses.pose[anchor.edge.end])[:2]) < 0.1
    shift = iter(50.0 * np.arange(100))

    def elsewhere(views: list[View], chart: object) -> Located:
        found = np.array([next(shift), 0.0, 0.0])
        return Located(found, np.eye(3) * 1e-4, 1.0)

    monkeypatch.setattr(segments, "looked_for", elsewhere)
    assert not list(segments._anchors(looked, poses, keys, of))


def test_walls_that_beams_pass_through_are_as_distances_tell_them() -> None:
    """Each cell's distance was computed, and again for each place that was looked at: the map of a
    campus took more than ten minutes."""
    rng = np.random.default_rng(0)
    cells = np.full((200, 300), FREE, np.uint8)
    for _ in range(30):
        row, column = rng.integers(5, (190, 280))
        cells[row : row + rng.integers(1, 7), column : column + rng.integers(1, 20)] = OCCUPIED
    told = Barriers.of(Occupancy(cells, 0.05, (0.0, 0.0)))
    walls = cells == OCCUPIED
    deep = distance_transform_edt(walls)
    assert np.array_equal(told.middle, walls & (deep == maximum_filter(deep, 3)))
    assert np.array_equal(told.near, distance_transform_edt(~walls) * 0.05 <= BEHIND)


def cut(poses: Poses, laps: float, at: tuple[float, float]) -> Poses:
    """Three segments of a drive, each in a frame of its own."""
    lap = np.linspace(0, laps, len(poses.t))
    segment = np.searchsorted(at, lap, side="right")
    frames = np.array([[0.0, 0.0, 0.0], [3.0, -8.0, 1.0], [-20.0, 5.0, -2.0]])
    pose, first = poses.pose.copy(), [int(np.argmax(segment == k)) for k in range(3)]
    for k in (1, 2):
        mine = segment == k
        home = between(np.broadcast_to(poses.pose[first[k]], (mine.sum(), 3)), poses.pose[mine])
        pose[mine] = compose(np.broadcast_to(frames[k], home.shape), home)
    keyframe, information = poses.keyframe.copy(), poses.information.copy()
    keyframe[first], information[first] = 1, 0.0
    return poses._replace(pose=pose, segment=segment, keyframe=keyframe, information=information)


@first_of("seed", [0, 2, 3, 4])
def test_segments_that_one_map_tells_are_put_together(seed: int) -> None:
    """The second saw little of the first, and joins once the third has, which saw both. The floor's
    corners are alike: it was put round one of them, 4 m off."""
    scans, truth = recorded(seed, Sensor(longest=8.0), laps=1.6)
    found, maps = segments.joined(scans, cut(followed(scans).poses, 1.6, (0.25, 0.8)))
    assert len(maps) == 1 and not found.segment.any()
    assert trajectory_error(maps[0].graph.poses, truth[maps[0].keys]).absolute < 0.15


@pytest.mark.long
@first_of("seed", [0, 2, 3, 4])
def test_segments_of_corners_that_are_alike_stay_apart(seed: int) -> None:
    """None of the three saw much of another: two of them were put upon each other."""
    scans, truth = recorded(seed, Sensor(longest=8.0), laps=1.0)
    _, maps = segments.joined(scans, cut(followed(scans).poses, 1.0, (0.3, 0.6)))
    off = [trajectory_error(one.graph.poses, truth[one.keys]).absolute for one in maps]
    assert max(off) < 0.2


@pytest.mark.long
@first_of("seed", [0, 2, 3])
def test_a_segment_is_not_put_where_its_way_does_not_lead(seed: int) -> None:
    """A corridor's ends may be alike; which way the robot came through it is known."""
    scans, _ = recorded(seed, Sensor(longest=8.0), laps=1.3)
    parts = cut(followed(scans).poses, 1.3, (1.0, 1.29))
    begin = int(np.argmax(parts.segment == 1))
    assert segments.joined(scans, parts)[0].segment[begin] == 0
    parts.information[begin] = np.diag([0.01, 0.01, 100.0])  # the headings are another map's
    assert segments.joined(scans, parts)[0].segment[begin] == 1


def test_places_that_were_too_unsure_are_told_once_the_next_is_sure() -> None:
    """Two scans of a corridor along x, by habit alone; the third is sure."""
    scans, _ = recorded(0, COARSE, laps=0.2)
    poses = followed(scans).poses
    x, n = np.arange(6.0), 6
    lost, spread = np.array([0, 0, 1, 1, 0, 0], bool), np.tile(np.eye(3) * 1e-4, (n, 1, 1))
    wide = spread.copy()
    wide[2, 0, 0], wide[3, 0, 0] = 0.3, 0.33
    way = np.column_stack([x, np.zeros(n), np.zeros(n)])
    told = Poses(*(field[:n].copy() for field in poses))._replace(
        pose=np.where(lost[:, None], np.nan, way), sighted=way + lost[:, None] * [0.2, 0, 0],
        covariance=np.where(lost[:, None, None], np.nan, spread),
        information=np.linalg.inv(wide), fix=np.where(lost, Fix.LOST, Fix.MATCHED),
        segment=np.zeros(n, np.int64),
    )  # fmt: skip
    found = evened(told, None)
    assert found.fix[3] == Fix.MATCHED and found.covariance[3, 0, 0] < 0.2**2
    assert found.pose[3, 0] == pytest.approx(3.0, abs=0.1)
    nowhere = np.where(x[:, None] > 3, np.nan, told.sighted)
    last = told._replace(fix=np.where(x > 1, Fix.LOST, Fix.MATCHED), sighted=nowhere)
    assert (evened(last, None).fix[2:] == Fix.LOST).all()
