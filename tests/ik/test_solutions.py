"""Properties of every result on random robots: correct errors, limits, repeatability, locality."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.backends import backend
from dynx.model import Joint, Limits, Link, Mimic, Model, Pose
from dynx.model.loading import load
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import pose_error
from dynx.testing.strategies import configurations, models, poses
from tests.oracles.closed_form import MODELS

TOLERANCE = 1e-6
"""Default tolerances of `inverse_kinematics` [m, rad]."""
SIX_AXIS_ARM = load(MODELS / "six_axis_arm.urdf")
SEVEN_AXIS_ARM = load(MODELS / "seven_axis_arm.urdf")


pytestmark = pytest.mark.parametrize("name", ["pinocchio", "compiled"])
"""A backend that the solver asks for every pose, and one that solves in kernels."""


def errors(T_world_target: Floats, T_world_frame: Floats) -> tuple[float, float]:
    """Return distance [m] and angle [rad], by other formulas than the solver's."""
    position, rotation = pose_error(T_world_target, T_world_frame)
    return float(np.linalg.norm(position)), float(np.linalg.norm(rotation))


def same_error(measured: float, reported: float) -> bool:
    """Return whether two errors agree, up to rounding of an angle near 0, where its cosine is insensitive."""
    return bool(abs(measured - reported) <= np.sqrt(np.finfo(float).eps))


@given(st.data())
def test_reported_errors_equal_those_of_forward_kinematics(name: str, data: st.DataObject) -> None:
    model = data.draw(models(max_links=6))
    frame = data.draw(st.sampled_from(model.frame_names))
    q_start = data.draw(configurations(model))
    with backend(name, model) as engine:
        if data.draw(st.booleans(), label="reachable"):
            target = engine.forward_kinematics(data.draw(configurations(model, within_limits=True)), frame)
        else:
            target = data.draw(poses())
        result = engine.inverse_kinematics(target, frame, q_start, max_restarts=3)
        distance, angle = errors(target, engine.forward_kinematics(result.q, frame))
    assert same_error(distance, float(result.position_error))
    assert same_error(angle, float(result.rotation_error))
    within = result.position_error <= TOLERANCE and result.rotation_error <= TOLERANCE
    assert bool(result) == bool(result.success) == within
    assert (result.q >= model.lower).all()
    assert (result.q <= model.upper).all()
    assert result.q.shape == (model.nq,)
    assert 0 <= result.restarts <= 3


def test_a_position_without_its_rotation_is_not_a_success(name: str) -> None:
    turned = np.diag([-1.0, -1.0, 1.0, 1.0])
    with backend(name, load(MODELS / "pendulum.urdf")) as engine:
        assert engine.inverse_kinematics(np.eye(4), "base").success
        result = engine.inverse_kinematics(turned, "base")
    assert result.position_error <= TOLERANCE
    assert result.rotation_error > 1.0
    assert not result.success


@given(st.data())
def test_a_start_on_the_target_is_returned(name: str, data: st.DataObject) -> None:
    model = data.draw(models(max_links=6))
    frame = data.draw(st.sampled_from(model.frame_names))
    q = data.draw(configurations(model, within_limits=True))
    with backend(name, model) as engine:
        result = engine.inverse_kinematics(engine.forward_kinematics(q, frame), frame, q)
    assert result.success
    assert result.iterations == 0
    # The quaternion of a floating base is normalised.
    np.testing.assert_allclose(result.q, model.clip(q), rtol=4 * np.finfo(float).eps, atol=0)


@given(st.data())
def test_coordinates_of_other_branches_stay(name: str, data: st.DataObject) -> None:
    model = data.draw(models(min_links=3, max_links=7, base="fixed"))
    frame = data.draw(st.sampled_from(model.frame_names))
    q = data.draw(configurations(model, within_limits=True))
    with backend(name, model) as engine:
        moving = np.abs(engine.jacobian(model.random(0, 20), frame)).max(axis=(0, 1), initial=0.0) > 0.0
        result = engine.inverse_kinematics(data.draw(poses()), frame, q, max_restarts=2)
    changed = result.q != q
    above = _joints_above(model, frame)
    assert not (changed & ~above).any()
    assert not (moving & ~above).any()


def _joints_above(model: Model, frame: str) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    link = model.frames[model.frame_index(frame)].link
    by_child = {joint.child: joint for joint in model.joints}
    names = set()
    while link in by_child:
        joint = by_child[link]
        names.add(joint.name if joint.mimic is None else joint.mimic.joint)
        link = joint.parent
    return np.array([name in names for name in model.joint_names], dtype=bool)


@given(configurations(SEVEN_AXIS_ARM, within_limits=True))
def test_a_target_reachable_within_limits_is_reached(name: str, q: Floats) -> None:
    frame = SEVEN_AXIS_ARM.frame_names[-1]
    with backend(name, SEVEN_AXIS_ARM) as engine:
        target = engine.forward_kinematics(q, frame)
        result = engine.inverse_kinematics(target, frame)
        assert result.success, result.message
        distance, angle = errors(target, engine.forward_kinematics(result.q, frame))
    assert max(distance, angle) <= TOLERANCE


@given(st.integers(0, 2**32 - 1))
def test_a_start_near_a_solution_stays_near_it(name: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    frame = "flange"
    with backend(name, SIX_AXIS_ARM) as engine:
        q = SIX_AXIS_ARM.random(rng)
        near = SIX_AXIS_ARM.clip(q + 1e-3 * rng.uniform(-1.0, 1.0, SIX_AXIS_ARM.nv))
        smallest = np.linalg.svd(engine.jacobian(near, frame), compute_uv=False)[-1]
        result = engine.inverse_kinematics(engine.forward_kinematics(q, frame), frame, near)
    assert result.success
    # Newton's basin: the change of J must be small compared with its smallest singular value.
    if smallest > 0.05:
        assert result.restarts == 0
        assert np.abs(result.q - near).max() <= 0.1


@given(st.integers(0, 2**32 - 1))
def test_a_batch_equals_its_samples_solved_alone(name: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    frame = "flange"
    with backend(name, SIX_AXIS_ARM) as engine:
        targets = engine.forward_kinematics(SIX_AXIS_ARM.random(rng, (2, 1)), frame)
        starts = SIX_AXIS_ARM.random(rng, 3)
        together = engine.inverse_kinematics(targets, frame, starts, rng=seed)
        assert together.q.shape == (2, 3, SIX_AXIS_ARM.nq)
        assert together.success.shape == together.restarts.shape == (2, 3)
        for i in range(2):
            for k in range(3):
                alone = engine.inverse_kinematics(targets[i, 0], frame, starts[k], rng=seed)
                np.testing.assert_array_equal(alone.q, together.q[i, k])
                assert alone.iterations == together.iterations[i, k]
                assert alone.position_error == together.position_error[i, k]


@given(st.integers(0, 2**32 - 1))
def test_equal_seeds_give_equal_results(name: str, seed: int) -> None:
    frame = "flange"
    with backend(name, SIX_AXIS_ARM) as engine:
        target = engine.forward_kinematics(SIX_AXIS_ARM.random(seed), frame)
        by_seed = [engine.inverse_kinematics(target, frame, rng=seed) for _ in range(2)]
        generator = np.random.default_rng(seed)
        by_generator = engine.inverse_kinematics(target, frame, rng=generator)
    np.testing.assert_array_equal(by_seed[0].q, by_seed[1].q)
    np.testing.assert_array_equal(by_seed[0].q, by_generator.q)


@given(configurations(SIX_AXIS_ARM, within_limits=True), st.integers(0, 2**32 - 1))
def test_position_targets_and_points_of_the_frame(name: str, q: Floats, seed: int) -> None:
    frame = "flange"
    point = np.random.default_rng(seed).uniform(-0.2, 0.2, 3)
    with backend(name, SIX_AXIS_ARM) as engine:

        def place(q: Floats) -> Floats:
            T = engine.forward_kinematics(q, frame)
            T[:3, 3] += T[:3, :3] @ point
            return T

        target = place(q)
        result = engine.inverse_kinematics(target[:3, 3], frame, point=point)
        assert result.success
        assert result.rotation_error == 0.0
        assert np.linalg.norm(place(result.q)[:3, 3] - target[:3, 3]) <= TOLERANCE
        result = engine.inverse_kinematics(target, frame, point=point)
        assert result.success
        assert max(errors(target, place(result.q))) <= TOLERANCE


@given(st.integers(0, 2**32 - 1))
def test_rotation_targets(name: str, seed: int) -> None:
    frame, wanted = "flange", SIX_AXIS_ARM.random(seed, (2, 1))
    starts = SIX_AXIS_ARM.random(seed + 1, 3)
    with backend(name, SIX_AXIS_ARM) as engine:
        targets = engine.forward_kinematics(wanted, frame)
        found = engine.inverse_kinematics(targets[..., :3, :3], frame, starts, free="position")
        assert found.success.all()
        assert found.q.shape == (2, 3, SIX_AXIS_ARM.nq)
        assert not found.position_error.any()
        reached = engine.forward_kinematics(found.q, frame)
        same = engine.inverse_kinematics(targets[1, 0], frame, starts[2], free="position")
        np.testing.assert_array_equal(same.q, found.q[1, 2])
        for i in range(2):
            for k in range(3):
                angle = errors(targets[i, 0], reached[i, k])[1]
                assert angle <= TOLERANCE
                assert same_error(angle, float(found.rotation_error[i, k]))


@given(configurations(SIX_AXIS_ARM, within_limits=True))
def test_the_position_of_a_pose_with_free_rotation(name: str, q: Floats) -> None:
    with backend(name, SIX_AXIS_ARM) as engine:
        target = engine.forward_kinematics(q, "flange")
        by_pose = engine.inverse_kinematics(target, "flange", free="rotation")
        by_position = engine.inverse_kinematics(target[:3, 3], "flange")
    np.testing.assert_array_equal(by_pose.q, by_position.q)


@given(st.data())
def test_angles_are_returned_nearest_to_the_start(name: str, data: st.DataObject) -> None:
    turns = [data.draw(st.integers(-3, 3)) for _ in range(2)]
    model = _two_turning_joints()
    q_start = 2.0 * np.pi * np.array(turns)
    with backend(name, model) as engine:
        target = engine.forward_kinematics(np.array([2.0, -1.5]), "tip")
        result = engine.inverse_kinematics(target, "tip", q_start)
    assert result.success
    assert np.abs(result.q - q_start).max() <= np.pi


def _two_turning_joints() -> Model:
    arm = Pose((1.0, 0.0, 0.0))
    return Model.build(
        "turning",
        [Link("base"), Link("upper"), Link("lower"), Link("tip")],
        [
            Joint("first", "continuous", "base", "upper", axis=(0.0, 0.0, 1.0)),
            Joint("second", "continuous", "upper", "lower", arm, axis=(0.0, 0.0, 1.0)),
            Joint("tool", "fixed", "lower", "tip", arm),
        ],
    )


def test_a_joint_that_drives_others_is_not_shifted_by_a_turn(name: str) -> None:
    """A full turn of the driver is half a turn of its follower, which is another pose."""
    limits = Limits(-4.0, 8.0)
    model = Model.build(
        "geared",
        [Link("base"), Link("driver"), Link("follower"), Link("tip")],
        [
            Joint("drive", "revolute", "base", "driver", axis=(0.0, 0.0, 1.0), limits=limits),
            Joint(
                "follow", "continuous", "driver", "follower", Pose((1.0, 0.0, 0.0)),
                axis=(0.0, 0.0, 1.0), mimic=Mimic("drive", 0.5),
            ),
            Joint("tool", "fixed", "follower", "tip", Pose((1.0, 0.0, 0.0))),
        ],
    )  # fmt: skip
    with backend(name, model) as engine:
        for q in np.linspace(-4.0, 8.0, 25):
            target = engine.forward_kinematics(np.array([q]), "tip")
            result = engine.inverse_kinematics(target, "tip", [2.0])
            assert result.success
            np.testing.assert_allclose(np.cos(1.5 * result.q), np.cos(1.5 * q), atol=10 * TOLERANCE)


@given(st.integers(0, 2**32 - 1), poses())
def test_a_floating_base_reaches_any_pose(name: str, seed: int, target: Floats) -> None:
    model = SIX_AXIS_ARM.with_base("floating")
    q_start = model.random(seed)
    with backend(name, model) as engine:
        result = engine.inverse_kinematics(target, "flange", q_start)
    assert result.success, result.message
    assert abs(float(np.linalg.norm(result.q[3:7])) - 1.0) <= 4 * np.finfo(float).eps
