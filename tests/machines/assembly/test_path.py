"""Path planning: profiles, limits, tool paths."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evertwin.errors import UsageError
from evertwin.machines.arm import Arm
from evertwin.machines.assembly import Circle, Joints, Limits, Line, Pause, moves_of, plan
from evertwin.machines.assembly.kinematics import tool

CHAIN = Arm.of("ur5_like").chain
HOME = (0.0, -1.2, 1.5, -1.8, -1.57, 0.0)
LIMITS = Limits((1.0,) * 6, (3.0,) * 6)
distance = st.floats(0.01, 5.0)


@settings(max_examples=60, deadline=None)
@given(distance, distance, distance, st.sampled_from(["trapezoid", "quintic"]))
def test_a_move_keeps_its_limits_and_ends_at_rest(
    way: float, speed: float, acceleration: float, profile: str
) -> None:
    limits = Limits((speed, speed), (acceleration, acceleration))
    motion = plan([Joints((way, -0.3 * way))], (0.0, 0.0), limits, 200.0, profile)  # type: ignore[arg-type]
    assert motion.q[-1] == pytest.approx([way, -0.3 * way], abs=1e-12)
    assert not motion.qd[-1].any() and not motion.qd[0].any()
    assert np.abs(motion.qd).max() <= speed * (1 + 1e-9)
    assert np.abs(motion.qdd).max() <= acceleration * (1 + 1e-9)
    # positions are the integral of speeds
    middle = 0.5 * (motion.qd[1:] + motion.qd[:-1])
    way_of_speeds = motion.q[0] + (middle * np.diff(motion.t)[:, None]).sum(axis=0)
    assert way_of_speeds == pytest.approx(motion.q[-1], abs=0.05 * way)


def test_the_trapezoid_takes_the_time_of_the_textbook() -> None:
    one = Limits((1.0,), (2.0,))
    assert plan([Joints((2.0,))], (0.0,), one, 1000.0).t[-1] == pytest.approx(2.5)
    assert plan([Joints((0.5,))], (0.0,), one, 1000.0).t[-1] == pytest.approx(1.0)
    assert plan([Joints((1.0,))], (0.0,), one, 1000.0, "quintic").t[-1] == pytest.approx(1.875)


def test_a_line_is_straight_and_a_circle_is_round() -> None:
    start = tool(CHAIN, np.array(HOME))[0]
    ahead = start[:3, 3] + [-0.1, 0.05, 0.0]
    centre = ahead - np.array([0.1, 0.0, 0.0])
    moves = [Line(tuple(ahead)), Pause(0.1), Circle(tuple(centre), turns=1.0)]
    motion = plan(moves, HOME, LIMITS, 200.0, "quintic", CHAIN)
    frames = np.array([tool(CHAIN, q)[0] for q in motion.q])
    assert np.abs(frames[:, :3, :3] - start[:3, :3]).max() < 1e-6
    assert np.ptp(frames[:, 2, 3]) < 1e-6
    pause = int(np.flatnonzero(~motion.qd.any(axis=1))[2])
    line = frames[:pause, :3, 3] - start[:3, 3]
    assert np.abs(np.cross(line, ahead - start[:3, 3])).max() < 1e-7
    ring = frames[pause + 20 :, :2, 3] - centre[:2]
    assert np.linalg.norm(ring, axis=1) == pytest.approx(0.1, abs=1e-6)
    assert frames[-1, :3, 3] == pytest.approx(ahead, abs=1e-6)
    assert np.gradient(motion.q, motion.t, axis=0) == pytest.approx(motion.qd, abs=0.02)


def test_a_path_of_the_tool_is_slowed_down_to_the_joints_limits() -> None:
    ahead = tool(CHAIN, np.array(HOME))[0][:3, 3] + [-0.2, 0.0, 0.0]
    slow = Limits((0.1,) * 6, (0.5,) * 6)
    motion = plan([Line(tuple(ahead), speed=2.0)], HOME, slow, 100.0, chain=CHAIN)
    assert 0.08 < np.abs(motion.qd).max() <= 0.1 * (1 + 1e-6)


def test_what_cannot_be_planned_is_said() -> None:
    with pytest.raises(UsageError, match="cannot reach"):
        plan([Line((3.0, 0.0, 0.0))], HOME, LIMITS, chain=CHAIN)
    with pytest.raises(UsageError, match="needs an arm's geometry"):
        plan([Line((0.3, 0.0, 0.0))], HOME, LIMITS)
    with pytest.raises(UsageError, match="expected 6 joint positions, got 1"):
        plan([Joints((0.0,))], HOME, LIMITS)
    with pytest.raises(UsageError, match="expected 6 joints"):
        plan([], (0.0,), LIMITS)
    with pytest.raises(UsageError, match="above 0 for every joint"):
        Limits((1.0,), (0.0,))
    with pytest.raises(UsageError, match="no move 'jump'"):
        moves_of([{"move": "jump"}])
    with pytest.raises(UsageError, match="move 1 \\(line\\)"):
        moves_of([{"move": "line", "towards": [0, 0, 0]}])
    assert moves_of([{"move": "joints", "to": [1.0, 2.0]}]) == (Joints((1.0, 2.0)),)
