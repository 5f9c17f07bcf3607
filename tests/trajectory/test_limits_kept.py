"""Profiles under limits: never beyond a limit, always at one, synchronised, and time-optimal."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx import load
from dynx.errors import ArgumentError, TrajectoryError
from dynx.spatial.scalar import Floats
from dynx.trajectory import Trajectory, s_curve, time_optimal, time_optimal_path, trapezoidal
from dynx.trajectory.curve import TimeScaledTrajectory
from tests.examples import one_robot
from tests.trajectory.motions import bounds, displacements, floating, hundredths

MAX_GAP = 1e-12
"""Largest relative gap between a planned value and its limit: 64 units of rounding, and those of a sum."""

Limits = tuple[Floats, Floats, Floats]


@st.composite
def problems(draw: st.DrawFn) -> tuple[Floats, Floats, Limits]:
    n = draw(st.integers(1, 4))
    q0, q1 = draw(displacements(n))
    return q0, q1, (draw(bounds(n)), draw(bounds(n)), draw(bounds(n)))


def times(motion: Trajectory) -> Floats:
    """Return closely spaced times, and both sides of every knot."""
    knots = motion.knots
    even = np.linspace(0.0, motion.duration, 301)
    every = np.concatenate([even, knots, np.nextafter(knots, -1.0)])
    return np.unique(np.clip(every, 0.0, motion.duration))


def jerks(motion: Trajectory) -> Floats:
    """Return the constant jerk of every piece, from the change of a over its middle."""
    begin, length = motion.knots[:-1], np.diff(motion.knots)
    begin, length = begin[length > 1e-6], length[length > 1e-6]
    first, last = motion(begin + 0.25 * length).a, motion(begin + 0.75 * length).a
    return np.asarray(2.0 * (last - first) / length[:, None])


@given(problems())
def test_a_trapezoid_respects_its_limits_and_is_at_one_at_any_time(
    problem: tuple[Floats, Floats, Limits],
) -> None:
    q0, q1, (velocity, acceleration, _) = problem
    motion = trapezoidal(q0, q1, velocity=velocity, acceleration=acceleration)
    _, v, a = motion(times(motion))
    assert (np.abs(v) <= velocity).all()
    assert (np.abs(a) <= acceleration).all()
    middles = 0.5 * (motion.knots[1:] + motion.knots[:-1])[np.diff(motion.knots) > 1e-6]
    _, v, a = motion(middles)
    part = np.maximum(np.abs(v) / velocity, np.abs(a) / acceleration).max(axis=1)
    assert (part >= 1.0 - MAX_GAP).all()


@given(problems())
def test_a_double_s_respects_its_limits_and_is_at_one_at_any_time(
    problem: tuple[Floats, Floats, Limits],
) -> None:
    q0, q1, (velocity, acceleration, jerk) = problem
    motion = s_curve(q0, q1, velocity=velocity, acceleration=acceleration, jerk=jerk)
    _, v, a = motion(times(motion))
    assert (np.abs(v) <= velocity).all()
    assert (np.abs(a) <= acceleration).all()
    rates = jerks(motion)
    # The jerk is a difference of accelerations over a piece, and of times that are rounded too.
    length = np.diff(motion.knots)[np.diff(motion.knots) > 1e-6, None]
    noise = 8.0 * np.finfo(np.float64).eps * (np.abs(a).max() + jerk * motion.duration) / length
    assert (np.abs(rates) <= jerk + noise).all()
    middles = 0.5 * (motion.knots[1:] + motion.knots[:-1])[np.diff(motion.knots) > 1e-6]
    _, v, a = motion(middles)
    part = np.maximum(np.abs(v) / velocity, np.abs(a) / acceleration)
    part = np.maximum(part, (np.abs(rates) + noise) / jerk).max(axis=1)
    assert (part >= 1.0 - MAX_GAP).all()


@given(problems(), st.floats(0.0, 1.0))
def test_the_joints_stay_on_a_straight_line(problem: tuple[Floats, Floats, Limits], part: float) -> None:
    """At any time every joint has covered the same fraction of its distance."""
    q0, q1, (velocity, acceleration, jerk) = problem
    for motion in (
        trapezoidal(q0, q1, velocity=velocity, acceleration=acceleration),
        s_curve(q0, q1, velocity=velocity, acceleration=acceleration, jerk=jerk),
    ):
        displacement = motion(part * motion.duration).q - q0
        k = int(np.argmax(np.abs(q1 - q0)))
        done = displacement[k] / (q1 - q0)[k]
        size = np.abs(q0) + np.abs(q1)
        assert (np.abs(displacement - done * (q1 - q0)) <= 16.0 * np.finfo(np.float64).eps * size.max()).all()


@given(problems(), hundredths(1.0, 9.0))
def test_a_longer_duration_scales_time_uniformly(
    problem: tuple[Floats, Floats, Limits], factor: float
) -> None:
    q0, q1, (velocity, acceleration, jerk) = problem
    fast = s_curve(q0, q1, velocity=velocity, acceleration=acceleration, jerk=jerk)
    duration = factor * fast.duration
    slow = s_curve(q0, q1, velocity=velocity, acceleration=acceleration, jerk=jerk, duration=duration)
    assert slow.duration == duration
    parts = np.linspace(0.0, 1.0, 41)
    one, other = fast(parts * fast.duration), slow(parts * duration)
    np.testing.assert_allclose(other.q, one.q, atol=1e-12)
    np.testing.assert_allclose(factor * other.v, one.v, atol=1e-12 * np.abs(one.v).max())
    np.testing.assert_allclose(factor**2 * other.a, one.a, atol=1e-9 * np.abs(one.a).max())


@given(problems())
def test_time_optimal_is_within_limits_and_no_slower_than_a_straight_line(
    problem: tuple[Floats, Floats, Limits],
) -> None:
    """Ruckig respects limits to a relative 1e-8."""
    pytest.importorskip("ruckig")
    q0, q1, (velocity, acceleration, jerk) = problem
    motion = time_optimal(q0, q1, velocity=velocity, acceleration=acceleration, jerk=jerk)
    _, v, a = motion(times(motion))
    assert (np.abs(v) <= velocity * (1.0 + 1e-8)).all()
    assert (np.abs(a) <= acceleration * (1.0 + 1e-8)).all()
    straight = s_curve(q0, q1, velocity=velocity, acceleration=acceleration, jerk=jerk)
    assert motion.duration <= straight.duration * (1.0 + 1e-8)
    # The slowest joint alone takes as long, so no faster motion exists.
    slowest = max(
        s_curve([a], [b], velocity=v, acceleration=c, jerk=d).duration
        for a, b, v, c, d in zip(q0, q1, velocity, acceleration, jerk, strict=True)
        if a != b
    )
    assert motion.duration == pytest.approx(slowest, rel=1e-8)


def test_time_optimal_from_one_state_to_another() -> None:
    pytest.importorskip("ruckig")
    v0, a0, v1, a1 = np.array([[0.5, -0.2], [0.1, 0.3], [-0.3, 0.4], [0.2, 0.0]])
    motion = time_optimal(
        [0.0, 1.0], [1.0, -1.0], velocity=1.0, acceleration=2.0, jerk=8.0, v0=v0, v1=v1, a0=a0, a1=a1
    )
    for number, end, v, a in ((0, motion.start, v0, a0), (1, motion.end, v1, a1)):
        np.testing.assert_array_equal(end.v, v)
        np.testing.assert_array_equal(end.a, a)
        inside = motion.inside(np.array([number * motion.duration]))
        for got, wanted in zip(inside, end, strict=True):
            np.testing.assert_allclose(got[0], wanted, atol=1e-8)


@one_robot
@given(st.integers(0, 1000), st.integers(2, 5), st.integers(1, 3))
def test_a_path_respects_limits_and_passes_the_waypoints(seed: int, count: int, nv: int) -> None:
    pytest.importorskip("toppra")
    rng = np.random.default_rng(seed)
    points, velocity, acceleration = rng.uniform(-2.0, 2.0, (count, nv)), *rng.uniform(0.3, 4.0, (2, nv))
    motion = time_optimal_path(points, velocity=velocity, acceleration=acceleration)
    _, v, a = motion(np.linspace(0.0, motion.duration, 5000))
    assert (np.abs(v) <= velocity).all()
    assert (np.abs(a) <= acceleration).all()
    used = np.maximum(np.abs(v) / velocity, np.abs(a) / acceleration).max(axis=1)
    # 0.988 was the least over 40 routes with up to six joints.
    assert used.mean() >= 0.95
    assert isinstance(motion, TimeScaledTrajectory)
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    marks = np.concatenate([[0.0], np.cumsum(lengths)]) / lengths.sum()
    np.testing.assert_allclose(motion.path(marks)[0], points, atol=1e-12)


@one_robot
@given(problems())
def test_between_two_waypoints_the_path_is_straight_and_as_fast_as_a_trapezoid(
    problem: tuple[Floats, Floats, Limits],
) -> None:
    """Each of the two corners may cost the time of one of a hundred grid intervals."""
    pytest.importorskip("toppra")
    q0, q1, (velocity, acceleration, _) = problem
    motion = time_optimal_path([q0, q1], velocity=velocity, acceleration=acceleration)
    best = trapezoidal(q0, q1, velocity=velocity, acceleration=acceleration)
    assert best.duration <= motion.duration <= (1.02 + 1e-3) * best.duration


SLIDER = """
<robot name="slider">
  <link name="rail"/>
  <joint name="lift" type="prismatic">
    <parent link="rail"/><child link="cart"/><axis xyz="0 0 1"/>
    <limit lower="-9" upper="9" effort="40" velocity="100"/>
    <dynamics damping="2.0" friction="3.0"/>
  </joint>
  <link name="cart">
    <inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
</robot>
"""


def test_a_limit_of_effort_is_one_of_acceleration_for_a_mass_that_slides() -> None:
    pytest.importorskip("toppra")
    level = load(SLIDER).with_gravity((0.0, 0.0, 0.0))
    points = [[0.0], [2.0]]
    by_force = time_optimal_path(points, effort=True, model=level)
    by_acceleration = time_optimal_path(points, acceleration=20.0, model=level)
    assert by_force.duration == pytest.approx(by_acceleration.duration, rel=1e-6)
    # The weight of 19.62 N is taken from the force, and helps to brake: v^2/2 = up s = down (2 - s).
    heavy = time_optimal_path(points, effort=True, model=load(SLIDER))
    up, down = 20.0 - 9.81, 20.0 + 9.81
    speed = np.sqrt(2.0 * 2.0 / (1.0 / up + 1.0 / down))
    assert heavy.duration == pytest.approx(speed / up + speed / down, rel=5e-3)


@pytest.mark.parametrize(("name", "velocity"), [("ur10", 20.0), ("z1", 20.0), ("kinova", None)])
@pytest.mark.parametrize("joint_dynamics", [False, True])
def test_a_path_respects_limits_of_effort_and_uses_them(
    name: str, velocity: float | None, joint_dynamics: bool
) -> None:
    pytest.importorskip("toppra")
    model = load(name)
    points = model.clip(0.6 * np.clip(model.random(5, 4), -2.0, 2.0))
    motion = time_optimal_path(
        points,
        effort=True,
        velocity=velocity,
        joint_dynamics=joint_dynamics,
        model=model,
        backend="reference",
    )
    q, v, a = motion(np.linspace(0.0, motion.duration, 3000))
    with dynx.backend("compiled", model) as engine:
        tau = engine.inverse_dynamics(q, v, a, joint_dynamics=joint_dynamics)
    largest = model.velocity_limit if velocity is None else velocity
    used = np.maximum(np.abs(tau) / model.effort_limit, np.abs(v) / largest)
    assert used.max() <= 1.0
    assert used.max(axis=1).mean() >= 0.9


def test_effort_that_does_not_hold_the_robot_is_refused() -> None:
    pytest.importorskip("toppra")
    model, points = load(SLIDER), [[0.0], [1.0]]
    with pytest.raises(TrajectoryError, match=r"effort limit of lift is 15, but gravity .* need 19\.62"):
        time_optimal_path(points, effort=15.0, model=model)
    assert time_optimal_path(points, effort=21.0, model=model).duration > 0.5
    with pytest.raises(TrajectoryError, match=r"effort limit of lift is 21, but .* need 22\.62"):
        time_optimal_path(points, effort=21.0, joint_dynamics=True, model=model)
    with pytest.raises(TrajectoryError, match="the limit of effort of joint 'lift' is 0"):
        time_optimal_path(points, effort=0.0, model=model)
    with pytest.raises(ArgumentError, match="effort is limited for a robot; wanted its model="):
        time_optimal_path(points, effort=20.0, velocity=1.0)
    with pytest.raises(ArgumentError, match="acceleration is None and effort False; wanted a limit"):
        time_optimal_path(points, model=model)


PENDULUM = """
<robot name="pendulum">
  <link name="wall"/>
  <joint name="hinge" type="continuous">
    <parent link="wall"/><child link="rod"/><axis xyz="0 1 0"/><limit effort="40" velocity="100"/>
  </joint>
  <link name="rod">
    <inertial>
      <origin xyz="1 0 0"/><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
</robot>
"""


@pytest.mark.parametrize("lack", [1e-5, 1e-6])
def test_gravity_that_is_largest_between_grid_points_is_refused(lack: float) -> None:
    """Gravity needs 9.81 cos q; the grid points nearest to q = 0 are at -0.005 and 0.015 of 2 rad."""
    pytest.importorskip("toppra")
    with pytest.raises(
        TrajectoryError, match=r"effort limit of hinge is 9\.8099.*, but gravity .* need 9\.81"
    ):
        time_optimal_path([[-1.005], [0.995]], effort=9.81 * (1.0 - lack), model=load(PENDULUM))


def test_the_end_of_a_path_is_held_without_friction() -> None:
    """Friction helps to lower a weight, down to the end, where the joint bears all of the weight."""
    pytest.importorskip("toppra")
    with pytest.raises(TrajectoryError, match=r"effort limit of lift is 18, but gravity .* need 19\.62"):
        time_optimal_path([[1.0], [0.0]], effort=18.0, joint_dynamics=True, model=load(SLIDER))


def test_an_acceleration_that_no_effort_limits_is_refused() -> None:
    pytest.importorskip("toppra")
    unlimited = load(SLIDER.replace('effort="40"', ""))
    wanted = "the effort of lift is unlimited, and nothing else limits its acceleration"
    with pytest.raises(ArgumentError, match=wanted):
        time_optimal_path([[0.0], [1.0]], effort=True, model=unlimited)
    motion = time_optimal_path([[0.0], [1.0]], effort=True, acceleration=4.0, model=unlimited)
    assert motion.duration == pytest.approx(1.0, rel=1e-3)
    gantry = load(
        SLIDER.replace("</robot>", "")
        + """
  <joint name="across" type="prismatic">
    <parent link="cart"/><child link="hook"/><axis xyz="1 0 0"/>
    <limit lower="-9" upper="9" velocity="100"/>
  </joint>
  <link name="hook">
    <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
</robot>
"""
    )
    with pytest.raises(ArgumentError, match="the effort of across is unlimited"):
        time_optimal_path([[0.0, 0.0], [0.0, 1.0]], effort=True, model=gantry)
    # On a slope the force of the lift limits the acceleration across, too.
    motion = time_optimal_path([[0.0, 0.0], [1.0, 1.0]], effort=True, model=gantry)
    assert np.abs(motion(np.linspace(0.0, motion.duration, 1000)).a).max() <= (40.0 + 3.0 * 9.81) / 3.0


@pytest.mark.parametrize("damping", [50.0, 1e4])
def test_strong_damping_slows_a_path_down(damping: float) -> None:
    """The joint reaches the speed at which damping takes what gravity and friction leave of the effort."""
    pytest.importorskip("toppra")
    model = load(SLIDER.replace('damping="2.0"', f'damping="{damping}"'))
    motion = time_optimal_path([[0.0], [1.0]], effort=25.0, joint_dynamics=True, model=model)
    speed = (25.0 - 2.0 * 9.81 - 3.0) / damping
    # Speeding up and braking take some mass / damping [s], far less than the motion.
    assert motion.duration == pytest.approx(1.0 / speed, rel=0.03)
    q, v, a = motion(np.linspace(0.0, motion.duration, 3000))
    with dynx.backend("reference", model) as engine:
        tau = engine.inverse_dynamics(q, v, a, joint_dynamics=True)
    assert np.abs(tau).max() <= 25.0


@given(st.integers(0, 1000))
def test_limits_of_a_floating_base(seed: int) -> None:
    model = floating()
    q0, q1 = model.random(seed, 2)
    limit = np.array([0.5] * 3 + [0.8] * 3 + [1.0] * (model.nv - 6))
    motion = s_curve(q0, q1, velocity=limit, acceleration=2.0 * limit, jerk=9.0, model=model)
    _, v, a = motion(times(motion))
    assert (np.abs(v) <= limit).all()
    assert (np.abs(a) <= 2.0 * limit).all()
    # The profile is the same for joints and for a screw motion.
    displacement = model.difference(q0, q1)
    joints = s_curve(0.0 * displacement, displacement, velocity=limit, acceleration=2.0 * limit, jerk=9.0)
    assert motion.duration == joints.duration
    np.testing.assert_array_equal(v, joints(times(motion)).v)
