"""Properties that every kind of trajectory has."""

from __future__ import annotations

import pickle
from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from dynx.errors import DTypeError, DynxError, NotFiniteError
from dynx.spatial.scalar import Floats
from dynx.trajectory import Setpoint, Trajectory, cycloidal
from tests.contract.test_import import ENGINES, modules_after
from tests.trajectory.motions import Motion, motions, of_a_floating_base, slow_motions, within_limits

EPS = float(np.finfo(np.float64).eps)
STEP = 1e-4
"""Step of central differences [s]."""

parts_of_the_duration = st.lists(st.floats(-0.5, 1.5), min_size=1, max_size=40)


def central_difference(motion: Motion, t: Floats) -> tuple[Floats, Floats]:
    """Return the central differences of q and v over STEP to either side of t (n,)."""
    before, after = motion.trajectory(t - STEP), motion.trajectory(t + STEP)
    displacement = after.q - before.q if motion.model is None else motion.model.difference(before.q, after.q)
    return displacement / (2.0 * STEP), (after.v - before.v) / (2.0 * STEP)


def smooth_times(trajectory: Trajectory, parts: list[float]) -> Floats:
    """Return the times at which the motion is smooth over STEP to either side."""
    t = np.clip(parts, 0.0, 1.0) * trajectory.duration
    return np.asarray(t[np.abs(t[:, None] - trajectory.knots).min(axis=1) > 1.01 * STEP])


def assert_derivatives(motion: Motion, parts: list[float]) -> None:
    """Check v and a against central differences.

    A central difference of x is off by at most h/4 times the span of x'' over the step, and by rounding.

    (x(t + h) - x(t - h)) / 2h - x'(t) is the mean over u in [0, h] of x'(t + u)/2 + x'(t - u)/2 - x'(t),
    and that is at most u/2 times the span of x''. The span is looked at in nine places and doubled.
    """
    t = smooth_times(motion.trajectory, parts)
    if not t.size:
        return
    places = t[:, None] + STEP * np.linspace(-1.0, 1.0, 9)
    near = motion.trajectory(places)
    span_of_a = np.ptp(near.a, axis=1)
    fine = STEP / 4.0
    jerk = np.diff(near.a, axis=1) / fine
    noise = 32.0 * EPS * np.abs(near.a).max(axis=1) / fine
    q_rate, v_rate = central_difference(motion, t)
    q_size, v_size = 1.0 + np.abs(near.q).max(), 1.0 + np.abs(near.v).max()
    assert (np.abs(q_rate - near.v[:, 4]) <= STEP / 2.0 * span_of_a + 64.0 * EPS * q_size / STEP).all()
    wanted = STEP / 2.0 * (np.ptp(jerk, axis=1) + noise) + 64.0 * EPS * v_size / STEP
    assert (np.abs(v_rate - near.a[:, 4]) <= wanted).all()


@given(motions(), parts_of_the_duration)
def test_v_and_a_are_the_derivatives(motion: Motion, parts: list[float]) -> None:
    assert_derivatives(motion, parts)


@given(of_a_floating_base(), parts_of_the_duration)
def test_v_and_a_are_the_derivatives_on_a_floating_base(motion: Motion, parts: list[float]) -> None:
    assert_derivatives(motion, parts)


def test_v_and_a_are_the_derivatives_of_the_slow_motions() -> None:
    """These motions are fixed examples, too slow to be drawn at random."""
    assert len(slow_motions()) >= 2
    for motion in slow_motions():
        assert_derivatives(motion, np.linspace(0.01, 0.99, 301).tolist())


@given(motions())
def test_start_and_end_are_exactly_the_requested_ones(motion: Motion) -> None:
    made = motion.trajectory
    np.testing.assert_array_equal(made(0.0).q, motion.q0)
    end = made(made.duration).q
    if motion.model is not None and end[3:7] @ motion.q1[3:7] < 0.0:
        # The quaternion of opposite sign is the same orientation.
        end = np.concatenate([end[:3], -end[3:7], end[7:]])
    np.testing.assert_array_equal(end, motion.q1)


@given(motions())
def test_q_and_v_are_continuous_at_the_ends(motion: Motion) -> None:
    """Over a step from an end, q changes by v dt and v by a dt, to twice the variation of v and a."""
    made = motion.trajectory
    step = 1e-6 * made.duration
    for end, inner in ((0.0, step), (made.duration, made.duration - step)):
        here, there = made(end), made(inner)
        limit = step * (np.abs(here.v) + np.abs(there.v)) + 64.0 * EPS * (1.0 + np.abs(here.q).max())
        displacement = there.q - here.q if motion.model is None else motion.model.difference(here.q, there.q)
        assert (np.abs(displacement) <= limit).all()
        size = 64.0 * EPS * (1.0 + np.abs(made(np.linspace(0.0, made.duration, 50)).v).max())
        change = step * (np.abs(here.a) + np.abs(there.a)) + size
        assert (np.abs(there.v - here.v) <= change).all()


@given(motions(), st.floats(1e-12, 1e6))
def test_the_robot_is_at_rest_outside_the_duration(motion: Motion, beyond: float) -> None:
    made = motion.trajectory
    for t, end in ((-beyond, made.start), (made.duration * (1.0 + 2.0 * EPS) + beyond, made.end)):
        q, v, a = made(t)
        np.testing.assert_array_equal(q, end.q)
        assert not v.any()
        assert not a.any()


@given(motions(), parts_of_the_duration)
def test_an_array_of_times_equals_single_times_bit_for_bit(motion: Motion, parts: list[float]) -> None:
    made = motion.trajectory
    t = np.array([*parts, 0.0, 1.0]) * made.duration
    together = made(t)
    for k, time in enumerate(t.tolist()):
        for many, one in zip(together, made(time), strict=True):
            np.testing.assert_array_equal(many[k], one)


@given(motions(), parts_of_the_duration)
def test_a_pickled_trajectory_is_the_same(motion: Motion, parts: list[float]) -> None:
    t = np.array(parts) * motion.trajectory.duration
    copy = pickle.loads(pickle.dumps(motion.trajectory))
    for one, other in zip(motion.trajectory(t), copy(t), strict=True):
        np.testing.assert_array_equal(one, other)


@given(motions())
def test_shapes(motion: Motion) -> None:
    made = motion.trajectory
    for batch in ((), (1,), (0,), (2, 3)):
        q, v, a = made(np.full(batch, 0.3))
        assert q.shape == (*batch, made.nq)
        assert v.shape == a.shape == (*batch, made.nv)


@given(motions())
def test_knots_ascend_from_0_to_the_duration(motion: Motion) -> None:
    knots = motion.trajectory.knots
    assert knots[0] == 0.0
    assert knots[-1] == motion.trajectory.duration > 0.0
    assert (np.diff(knots) >= 0.0).all()


@given(within_limits())
def test_a_trajectory_cannot_be_changed(motion: Motion) -> None:
    made = motion.trajectory
    for name in ("duration", "start", "curve"):
        with pytest.raises(FrozenInstanceError):
            setattr(made, name, None)
    before = made(0.5)
    for array in (*made.start, *made.end):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    # Returned arrays are copies.
    for time in (0.0, 0.5 * made.duration):
        for array in made(time):
            array[...] = 99.0
    for one, other in zip(before, made(0.5), strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(made(0.0).q, motion.q0)


@pytest.mark.parametrize(
    ("t", "error"),
    [(np.nan, NotFiniteError), ([0.0, np.inf], NotFiniteError), ("now", DTypeError), (1j, DTypeError)],
)
def test_invalid_times_raise(t: ArrayLike, error: type[DynxError]) -> None:
    with pytest.raises(error, match="t"):
        cycloidal([0.0], [1.0], 1.0)(t)


def test_a_user_defined_trajectory() -> None:
    class Still(Trajectory):
        def inside(self, t: Floats) -> Setpoint:
            nothing = np.zeros((len(t), self.nv))
            return Setpoint(np.broadcast_to(self.start.q, (len(t), self.nq)), nothing, nothing)

    rest = Setpoint(np.array([0.3]), np.zeros(1), np.zeros(1))
    made = Still(2.0, rest, rest)
    assert made([-1.0, 0.5, 3.0]).q.tolist() == [[0.3], [0.3], [0.3]]


def test_a_motion_prints_in_one_line() -> None:
    motion = cycloidal(np.zeros(6), np.ones(6), duration=2.0)
    assert repr(motion) == f"<{type(motion).__name__} of 6 coordinates, 2 s>"


def test_engines_and_planners_are_imported_on_first_use() -> None:
    program = (
        "import dynx; dynx.trajectory.s_curve([0.0], [1.0], velocity=1.0, acceleration=1.0, jerk=1.0)(0.5)"
    )
    assert modules_after(program).isdisjoint({*ENGINES, "ruckig", "toppra", "matplotlib", "scipy"})


def test_modules_of_a_package_are_its_attributes() -> None:
    """Although the package imports none of them by itself."""
    program = (
        "import dynx; dynx.world.scene, dynx.world.camera, dynx.control.bullet, "
        "dynx.trajectory.waypoints, dynx.distance; assert not hasattr(dynx.world, 'weather')"
    )
    assert modules_after(program).isdisjoint(ENGINES)
