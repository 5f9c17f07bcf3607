"""Straight lines: the deviation stays within its bound; impossible lines raise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dynx
from dynx.errors import TrajectoryError
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import pose_error
from dynx.trajectory import LineTrajectory, cubic, line, trapezoidal
from tests.trajectory.motions import REACH, turned, ur5

FRAME = "tool0"


def pose(q: Floats) -> Floats:
    with dynx.backend("pinocchio", ur5()) as engine:
        return engine.forward_kinematics(q, FRAME)


def target(displacement: tuple[float, float, float], angle: float) -> Floats:
    T = pose(REACH) @ turned(angle)
    T[:3, 3] += displacement
    return T


def distances_from_the_line(motion: LineTrajectory, goal: Floats, t: Floats) -> tuple[Floats, Floats]:
    """Return the distances of origin [m] and axes [rad] from the straight line."""
    T = pose(motion(t).q)
    start = pose(REACH)
    displacement = goal[:3, 3] - start[:3, 3]
    from_start = T[:, :3, 3] - start[:3, 3]
    part = np.clip(from_start @ displacement / (displacement @ displacement), 0.0, 1.0)
    off = np.linalg.norm(from_start - part[:, None] * displacement, axis=1)
    # The z axis of the tool is constant, since the rotation is about it.
    tilt = np.linalg.norm(np.cross(T[:, :3, 2], start[:3, 2]), axis=1)
    return off, tilt


@settings(max_examples=10)
@given(
    st.tuples(*[st.integers(-15, 15).map(lambda n: n / 100)] * 3).filter(any),
    st.integers(-10, 10).map(lambda n: n / 10),
    st.sampled_from([1e-3, 1e-5, 1e-7]),
)
def test_the_frame_is_on_the_line(
    displacement: tuple[float, float, float], angle: float, bound: float
) -> None:
    goal = target(displacement, angle)
    motion = line(ur5(), FRAME, REACH, goal, 2.0, deviation=bound, rotation_deviation=bound)
    assert motion.deviation <= bound
    assert motion.rotation_deviation <= bound
    # Between the points where it was measured, the deviation may be slightly larger.
    off, tilt = distances_from_the_line(motion, goal, np.linspace(0.0, 2.0, 97))
    assert off.max() <= 1.5 * bound
    assert tilt.max() <= 1.5 * bound
    position, rotation = pose_error(goal, pose(motion.end.q))
    assert np.linalg.norm(position) <= 1e-9
    assert np.linalg.norm(rotation) <= 1e-9
    np.testing.assert_array_equal(motion(0.0).q, REACH)
    assert not motion(2.0).v.any()


def test_the_motion_law_holds_along_the_line() -> None:
    """Position and speed along the line at each time are those of the motion law."""
    goal = target((0.1, 0.1, -0.1), 0.0)
    law = trapezoidal([0.0], [1.0], velocity=0.8, acceleration=2.0)
    motion = line(ur5(), FRAME, REACH, goal, law=law)
    assert motion.duration == law.duration
    t = np.linspace(0.0, law.duration, 33)
    start = pose(REACH)[:3, 3]
    displacement = goal[:3, 3] - start
    s, rate, _ = law(t)
    q, v, _ = motion(t)
    assert np.abs(pose(q)[:, :3, 3] - start - s * displacement).max() <= 2.0 * motion.deviation + 1e-9
    with dynx.backend("pinocchio", ur5()) as engine:
        speed = engine.frame_velocity(q, v, FRAME)[:, :3]
    # The spline deviates by d within an interval of 1/n, so its slope by about n d.
    assert np.abs(speed - rate * displacement).max() <= 20.0 * motion.intervals * motion.deviation


def test_a_law_without_acceleration_moves_the_frame_at_constant_speed() -> None:
    """Within the deviation, the frame is where a point of constant speed is."""
    goal, start, duration, bound = target((0.1, -0.05, 0.1), 0.3), pose(REACH), 2.0, 1e-7
    rate = [1.0 / duration]
    law = cubic([0.0], [1.0], duration, v0=rate, v1=rate)
    motion = line(ur5(), FRAME, REACH, goal, law=law, deviation=bound, rotation_deviation=bound)
    t = np.linspace(0.0, duration, 41)
    expected = start[:3, 3] + t[:, None] / duration * (goal[:3, 3] - start[:3, 3])
    assert np.linalg.norm(pose(motion(t).q)[:, :3, 3] - expected, axis=1).max() <= 1.5 * bound
    assert np.abs(motion(0.0).v).max() > 0.0


def test_too_few_joints_for_the_line_raise() -> None:
    """Three joints can reach the pose, but not along a straight line."""
    with dynx.backend("pinocchio", ur5()) as engine:
        goal = engine.forward_kinematics(REACH + np.array([0.3, 0.2, -0.2, 0.0, 0.0, 0.0]), "forearm_link")
    with pytest.raises(TrajectoryError, match=r"'forearm_link' cannot follow the line beyond 0\.0000"):
        line(ur5(), "forearm_link", REACH, goal, 1.0)


def test_joints_that_do_not_move_the_frame_stay() -> None:
    panda = dynx.load("panda")
    q0 = np.array([0.1, -0.3, 0.2, -2.0, 0.1, 1.8, 0.5, 0.01])
    with dynx.backend("pinocchio", panda) as engine:
        goal = engine.forward_kinematics(q0, "panda_hand")
        goal[:3, 3] += (0.1, 0.05, -0.05)
        motion = line(panda, "panda_hand", q0, goal, 1.0, backend=engine)
        # The fingers are outboard of the hand. The caller's backend is still open.
        assert not motion(np.linspace(0.0, 1.0, 11)).v[:, 7:].any()
        reached = engine.forward_kinematics(motion.end.q, "panda_hand")
    np.testing.assert_allclose(reached, goal, atol=1e-9)


@pytest.mark.parametrize("further", [1.3, 2.0])
def test_the_error_states_where_the_line_leaves_the_workspace(further: float) -> None:
    """A planar arm of three links reaches their total length, so a known fraction of the line."""
    model, length = dynx.load("planar_3r"), 0.6 + 0.45 + 0.2
    q0 = np.array([0.0, 1.2, -0.4])
    with dynx.backend("pinocchio", model) as engine:
        start = engine.forward_kinematics(q0, "tip")[:3, 3]
    reach = float(np.linalg.norm(start))
    direction = start / reach
    with pytest.raises(TrajectoryError, match="'tip' cannot follow the line beyond") as caught:
        line(model, "tip", q0, further * length * direction, 1.0)
    possible = (length - reach) / (further * length - reach)
    assert caught.value.at is not None
    # Solutions are then 1/256 apart, and near the edge of the workspace the arm is nearly singular.
    assert possible - 3.0 / 256.0 <= caught.value.at <= possible
    motion = line(model, "tip", q0, 0.99 * length * direction, 1.0)
    assert motion.deviation <= 1e-5
    assert motion.rotation_deviation == 0.0


def test_a_line_through_the_base_raises_with_its_position() -> None:
    goal = pose(REACH)
    goal[:2, 3] *= -1.0
    with pytest.raises(TrajectoryError, match="of the way") as caught:
        line(ur5(), FRAME, REACH, goal, 2.0)
    # The wrist cannot pass the axis of the first joint, which is halfway.
    assert caught.value.at is not None
    assert 0.3 <= caught.value.at <= 0.5
