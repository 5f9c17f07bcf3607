"""Properties of every tracked path: errors, limits, continuity, agreement of engines, pieces and batches."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynx import trajectory
from dynx.backends import Backend, backend
from dynx.ik.tracking import TrackResult, TrackStatus
from dynx.model import Model
from dynx.model.loading import load
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import pose_error
from dynx.testing.strategies import configurations, models, poses
from tests.oracles.closed_form import MODELS

TOLERANCE = 1e-6
"""Default tolerances of `track` [m, rad]."""
MAX_STEP = 0.2
"""Default largest change of a joint in one descent [rad or m]."""
ARM = load(MODELS / "six_axis_arm.urdf")
FIELDS = ("q", "status", "position_error", "rotation_error", "jump", "iterations")

both_kinds = pytest.mark.parametrize("name", ["pinocchio", "compiled"])


def reachable_path(engine: Backend, q: Floats, frame: str, n: int, step: float) -> Floats:
    """Return poses (n, 4, 4) of configurations that move from q into the limits by `step` a sample."""
    model = engine.model
    path = [q]
    direction = np.where(q[model.nq - len(model.joint_names) :] > 0.0, -1.0, 1.0)
    for _ in range(n - 1):
        v = np.zeros(model.nv)
        v[model.nv - len(direction) :] = step * direction
        path.append(model.clip(model.integrate(path[-1], v)))
    return engine.forward_kinematics(np.array(path), frame)


def assert_consistent(engine: Backend, result: TrackResult, T: Floats, frame: str) -> None:
    """Check errors by another formula, the limits, and what each status promises."""
    model = engine.model
    distance, rotation = pose_error(T, engine.forward_kinematics(result.q, frame))
    rounding = np.sqrt(np.finfo(float).eps)
    np.testing.assert_allclose(result.position_error, np.linalg.norm(distance, axis=-1), atol=rounding)
    np.testing.assert_allclose(result.rotation_error, np.linalg.norm(rotation, axis=-1), atol=rounding)
    assert (result.q >= model.lower).all()
    assert (result.q <= model.upper).all()
    reached = (result.position_error <= TOLERANCE) & (result.rotation_error <= TOLERANCE)
    claimed = (result.status == TrackStatus.OK) | (result.status == TrackStatus.JUMPED)
    np.testing.assert_array_equal(reached, claimed)
    np.testing.assert_array_equal(result.jump > 0.0, result.status == TrackStatus.JUMPED)


@both_kinds
@settings(max_examples=12)  # most of the time compiles kernels
@given(st.data())
def test_a_continuous_path_of_any_robot_stays_ok(name: str, data: st.DataObject) -> None:
    model = data.draw(models(max_links=6))
    frame = data.draw(st.sampled_from(model.frame_names))
    q = model.clip(data.draw(configurations(model, within_limits=True)))
    with backend(name, model) as engine:
        T = reachable_path(engine, q, frame, 12, 1e-3)
        result = engine.track(T, frame, q, jumps=False)
        assert_consistent(engine, result, T, frame)
    assert result, result.message


@both_kinds
@settings(max_examples=12)  # most of the time compiles kernels
@given(st.data())
def test_a_path_anywhere_keeps_limits_and_changes_joints_by_no_more_than_a_step(
    name: str, data: st.DataObject
) -> None:
    model = data.draw(models(max_links=5, base="fixed"))
    frame = data.draw(st.sampled_from(model.frame_names))
    q = model.clip(data.draw(configurations(model, within_limits=True)))
    T = np.array(data.draw(st.lists(poses(), min_size=2, max_size=4)))
    dt = data.draw(st.sampled_from([0.01, 0.1]))
    with backend(name, model) as engine:
        result = engine.track(T, frame, q, dt=dt)
        assert_consistent(engine, result, T, frame)
        held = engine.track(T, frame, q, jumps=False)
        assert_consistent(engine, held, T, frame)
    changes = np.abs(np.diff(np.concatenate([q[None], result.q]), axis=0))
    assert (changes <= model.velocity_limit * dt * (1.0 + 1e-9) + 1e-12).all()
    missed = np.flatnonzero(held.status != TrackStatus.OK)
    steps = np.abs(np.diff(np.concatenate([q[None], held.q]), axis=0))
    assert (steps[missed] <= MAX_STEP * (1.0 + 1e-9)).all()


def circle(engine: Backend, q: Floats, radius: float, n: int) -> Floats:
    """Return poses (n, 4, 4) on a circle through the pose at q."""
    T = np.tile(engine.forward_kinematics(q, "flange"), (n, 1, 1))
    s = np.linspace(0.0, 2.0 * np.pi, n)
    T[:, 0, 3] += radius * (np.cos(s) - 1.0)
    T[:, 2, 3] += radius * np.sin(s)
    return T


BENT = np.array([0.3, 0.2, 0.0, 0.5, 0.9, 0.1])


def test_kernels_find_the_path_of_the_other_backends() -> None:
    with backend("pinocchio", ARM) as one, backend("compiled", ARM) as two:
        T = circle(one, BENT, 0.1, 50)
        a, b = one.track(T, "flange", BENT), two.track(T, "flange", BENT)
        sigma = np.linalg.svd(one.jacobian(a.q, "flange"), compute_uv=False)[:, -1].min()
    assert a
    assert b
    np.testing.assert_allclose(a.q, b.q, atol=4.0 * TOLERANCE / sigma)


@both_kinds
def test_pieces_and_batches_have_the_result_of_the_whole(name: str) -> None:
    with backend(name, ARM) as engine:
        T = np.array([circle(engine, BENT, radius, 30) for radius in (0.05, 0.4)])
        both = engine.track(T, "flange", BENT, jumps=False)
        assert both.q.shape == (2, 30, 6)
        assert not both
        for k in range(2):
            alone = engine.track(T[k], "flange", BENT, jumps=False)
            for field in FIELDS:
                np.testing.assert_array_equal(getattr(alone, field), getattr(both, field)[k], field)
        first = engine.track(T[0, :11], "flange", BENT)
        second = engine.track(T[0, 11:], "flange", first.q[-1])
    np.testing.assert_array_equal(np.concatenate([first.q, second.q]), both.q[0])


@both_kinds
def test_a_motion_is_sampled_and_followed(name: str) -> None:
    motion = trajectory.cycloidal(BENT, BENT + 0.3, 1.0)
    with backend(name, ARM) as engine:
        result = engine.track(motion, "flange", BENT, dt=0.02)
    assert result
    assert result.dt == 0.02
    np.testing.assert_allclose(result.q, motion(np.arange(51) * 0.02).q, atol=1e-4)


@both_kinds
def test_only_joints_that_move_the_frame_change(name: str) -> None:
    model: Model = load("panda")
    with backend(name, model) as engine:
        q = 0.5 * (model.lower + model.upper)
        T = reachable_path(engine, q, "panda_link8", 10, 0.01)
        result = engine.track(T[:, :3, 3], "panda_link8", q)
    assert result
    np.testing.assert_array_equal(result.q[:, 7:], np.tile(q[7:], (10, 1)))
    assert not result.rotation_error.any()


@both_kinds
def test_a_limited_sample_has_the_least_error_within_its_bounds(name: str) -> None:
    """No coordinate can move from its bound, or between its bounds, so that the error falls."""
    q0, count, dt = np.array([0.1, -1.3, 1.6, -1.9, -1.5, 0.2]), 30, 0.01
    with backend(name, ARM) as engine:
        T = np.repeat(engine.forward_kinematics(q0, "flange")[None], count, axis=0)
        angle = np.linspace(0.0, 1.0, count)
        T[:, :3, 3] += 0.15 * np.stack([np.cos(angle) - 1.0, np.sin(angle), 0.0 * angle], axis=-1)
        result = engine.track(T, "flange", q0, dt=dt, velocity_limit=0.3)
        assert (result.status[1:] == TrackStatus.LIMITED).all()
        before = np.concatenate([q0[None], result.q[:-1]])
        lower, upper = np.maximum(ARM.lower, before - 0.3 * dt), np.minimum(ARM.upper, before + 0.3 * dt)
        error = np.concatenate(pose_error(T, engine.forward_kinematics(result.q, "flange")), axis=-1)
        descent = np.einsum("nij,ni->nj", engine.jacobian(result.q, "flange"), error)
    assert np.abs(np.clip(result.q + descent, lower, upper) - result.q).max() < TOLERANCE
