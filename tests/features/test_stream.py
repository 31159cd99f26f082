"""Late and out-of-order poses: the order of arrival changes nothing."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.features.scans.fusion import Belief, Sighting, Step, measured, predicted
from evertwin.features.scans.stream import HOLD, Seen, Stream, Turned
from evertwin.fold import equal

TICK = 5 * 10**7


def events(seed: int, n: int = 60) -> tuple[list[Turned], list[Seen]]:
    """A drive with a gyro that is off by 0.02 rad/s, wheels that say 4 % too much, and scans."""
    rng = np.random.default_rng(seed)
    wheels, seen, true, said, angle = [], [], np.zeros(3), np.zeros(3), 0.0
    for k in range(n):
        wheels.append(Turned(k * TICK, said.copy(), angle))
        if k % 8 == 3:
            pose = true + 0.002 * rng.normal(size=3)
            seen.append((k * TICK, Sighting(pose, np.eye(3) / 0.002**2)))
        step, turn = 0.02, 0.01
        true = true + np.array([step * np.cos(true[2]), step * np.sin(true[2]), turn])
        said = said + 1.04 * np.array([step * np.cos(said[2]), step * np.sin(said[2]), turn / 1.04])
        angle += turn + 0.02 * TICK * 1e-9
    return wheels, seen


def told(wheels: list[Turned], seen: list[Seen], delays: np.ndarray) -> Stream:
    """What is known when all has arrived, each so much after its stamp [ns]."""
    stamps = [one.t for one in wheels[1:]] + [t for t, _ in seen]
    live = Stream.begun(Belief.at_rest(0, np.zeros(3), np.eye(3) * 1e-6), wheels[0])
    for k in np.argsort(np.array(stamps) + delays, kind="stable"):
        late = int(k) - len(wheels) + 1
        live = live.moved(wheels[int(k) + 1]) if late < 0 else live.seen(*seen[late])
    return live


@pytest.mark.parametrize("seed", range(3))
def test_the_order_of_arrival_changes_no_bit(seed: int) -> None:
    wheels, seen = events(seed)
    delays = 0.9 * HOLD * np.random.default_rng(seed).uniform(size=len(wheels) - 1 + len(seen))
    known, shuffled = (told(wheels, seen, d) for d in (0.0 * delays, delays))
    assert shuffled.late == 0 and equal(known.belief, shuffled.belief)


def test_bias_and_scale_are_learned_and_what_comes_too_late_is_counted() -> None:
    wheels, seen = events(1, 400)
    live = told(wheels, seen, np.zeros(len(wheels) - 1 + len(seen)))
    assert live.belief.bias == pytest.approx(0.02, abs=0.004)
    assert live.belief.scale == pytest.approx(1 / 1.04, abs=0.02)
    assert live.seen(*seen[0]).late == 1 and live.moved(wheels[1]).late == 1
    assert len(live.passed) < 2 * HOLD // TICK


def test_slip_is_named_by_the_innovation_and_followed() -> None:
    belief = Belief.at_rest(0, np.zeros(3), np.eye(3) * 1e-6)
    flags: list[bool] = []
    for k in range(40):
        belief = predicted(belief, Step(5 * 10**8, np.array([0.08, 0.0, 0.0]), 0.0))
        true = 0.08 * min(k + 1, 20) + 0.056 * max(k - 19, 0)
        found = measured(belief, Sighting(np.array([true, 0, 0]), np.eye(3) / 0.002**2), 0.08)
        belief, flags = found.belief, [*flags, found.slip]
        assert abs(belief.pose[0] - true) < 0.01
    assert flags.index(True) == 20
    assert belief.scale == pytest.approx(0.7, abs=0.02)


def test_a_direction_that_the_scan_leaves_open_stays_open() -> None:
    belief = Belief.at_rest(0, np.zeros(3), np.diag([0.04, 0.04, 0.01]))
    corridor = Sighting(np.array([5.0, 0.1, 0.0]), np.diag([0.0, 1e6, 1e6]))
    found = measured(belief, corridor, 0.0).belief
    assert abs(found.pose[0]) < 1e-3 and found.pose[1] == pytest.approx(0.1, abs=1e-3)
    assert found.covariance[0, 0] == pytest.approx(0.04, rel=0.01)
