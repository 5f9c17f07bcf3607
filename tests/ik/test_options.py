"""Options of inverse kinematics: free axes, weights, tolerances per axis, margins, several frames."""

from __future__ import annotations

import inspect
from dataclasses import fields
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.backends import Backend, backend, installed_backends
from dynx.errors import ArgumentError, ShapeError, UnknownNameError
from dynx.ik import FrameTarget, IKOptions, Options
from dynx.model.loading import load
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotation_from_rpy
from tests.oracles.closed_form import MODELS

TOLERANCE = 1e-6
"""Default tolerances of `inverse_kinematics` [m, rad]."""
ARM = load(MODELS / "six_axis_arm.urdf")
FRAME = "flange"
ENGINES = ("pinocchio", "compiled")


def placed(engine: Backend, seed: int) -> Floats:
    return engine.forward_kinematics(ARM.random(seed), FRAME)


@pytest.mark.parametrize("name", ENGINES)
@given(seed=st.integers(0, 2**32 - 1), axis=st.sampled_from("xyz"))
def test_a_free_rotation_keeps_the_axis(name: str, seed: int, axis: str) -> None:
    k = "xyz".index(axis)
    with backend(name, ARM) as engine:
        target = placed(engine, seed)
        found = engine.inverse_kinematics(target, FRAME, free=f"rotation_{axis}")
        T = engine.forward_kinematics(found.q, FRAME)
    assert found.success
    assert np.linalg.norm(T[:3, 3] - target[:3, 3]) <= TOLERANCE
    angle = np.linalg.norm(np.cross(T[:3, k], target[:3, k]))
    assert abs(angle - np.sin(float(found.rotation_error))) <= 1e-9
    assert angle <= TOLERANCE
    assert T[:3, k] @ target[:3, k] > 0.0


@pytest.mark.parametrize("name", ENGINES)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_line_in_the_axes_of_the_target_or_the_world(name: str, seed: int) -> None:
    with backend(name, ARM) as engine:
        target = placed(engine, seed)
        for axes, along in (("target", target[:3, :3]), ("world", np.eye(3))):
            found = engine.inverse_kinematics(target, FRAME, free=("position_x", "rotation"), axes=axes)
            offset = along.T @ (engine.forward_kinematics(found.q, FRAME)[:3, 3] - target[:3, 3])
            assert found.success
            assert np.linalg.norm(offset[1:]) <= TOLERANCE
            assert abs(np.linalg.norm(offset[1:]) - float(found.position_error)) <= 1e-12
            assert found.rotation_error == 0.0
        # A plane: a position with one prescribed coordinate.
        found = engine.inverse_kinematics(target[:3, 3], FRAME, free=("position_x", "position_y"))
        assert abs(engine.forward_kinematics(found.q, FRAME)[2, 3] - target[2, 3]) <= TOLERANCE


@pytest.mark.parametrize("name", ENGINES)
@given(seed=st.integers(0, 2**32 - 1))
def test_tolerances_along_axes_are_a_region(name: str, seed: int) -> None:
    bounds, turns = np.array([0.02, 0.2, 1e-6]), np.array([1e-5, 0.3, 1e-6])
    with backend(name, ARM) as engine:
        target = placed(engine, seed)
        found = engine.inverse_kinematics(
            target, FRAME, position_tolerance=bounds, rotation_tolerance=turns, axes="target"
        )
        T = engine.forward_kinematics(found.q, FRAME)
    assert found.success
    assert (np.abs(target[:3, :3].T @ (T[:3, 3] - target[:3, 3])) <= bounds * (1.0 + 1e-9)).all()
    # The vector of a rotation has the same components in the axes of the frame and of the target.
    R = target[:3, :3].T @ T[:3, :3]
    vector = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    assert (np.abs(vector) <= turns * (1.0 + 1e-9)).all()


def test_weights_decide_what_is_given_up() -> None:
    """Two joints reach a position or an angle: of both, the heavier error is the smaller one."""
    errors = []
    with backend("compiled", load(MODELS / "planar_2r.urdf")) as engine:
        frame = engine.model.frame_names[-1]
        target = engine.forward_kinematics(np.array([0.3, 0.9]), frame)
        target[:3, :3] = engine.forward_kinematics(np.array([1.0, 1.2]), frame)[:3, :3]
        for weight in (0.1, 1.0, 10.0):
            weights = [1.0, 1.0, 1.0, weight, weight, weight]
            found = engine.inverse_kinematics(target, frame, weights=weights, max_restarts=10)
            assert not found.success
            errors.append((float(found.position_error), float(found.rotation_error)))
        assert errors[0][0] < errors[1][0] < errors[2][0]
        assert errors[0][1] > errors[1][1] > errors[2][1]
    # A weight of zero is a free axis.
    with backend("compiled", ARM) as engine:
        position = engine.inverse_kinematics(placed(engine, 4), FRAME, weights=[1, 1, 1, 0, 0, 0])
        assert position.success
        assert position.rotation_error == 0.0


@pytest.mark.parametrize("name", ENGINES)
def test_a_margin_is_kept(name: str) -> None:
    rng = np.random.default_rng(7)
    low, high = ARM.lower + 0.2, ARM.upper - 0.2
    with backend(name, ARM) as engine:
        for seed in range(15):
            inside = seed % 2 == 0
            q = low + (high - low) * rng.random(ARM.nq) if inside else ARM.random(rng)
            target = engine.forward_kinematics(q, FRAME)
            for start in (None, ARM.random(seed)):
                found = engine.inverse_kinematics(target, FRAME, start, limit_margin=0.2, max_restarts=20)
                assert (found.q >= low).all()
                assert (found.q <= high).all()
                assert found.success or not inside


@pytest.mark.parametrize("name", installed_backends())
@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_several_frames_of_a_humanoid(name: str, base: Literal["fixed", "floating"]) -> None:
    """Both hands, and with a floating base both feet held: the pose of the base is solved too."""
    model = load("talos_reduced").with_base(base)
    hands = ("gripper_left_base_link", "gripper_right_base_link")
    feet = ("left_sole_link", "right_sole_link") if base == "floating" else ()
    start = model.clip(model.neutral())
    with backend(name, model) as engine:
        near = model.integrate(start, 0.1 * np.random.default_rng(5).standard_normal(model.nv))
        targets = {frame: engine.forward_kinematics(model.clip(near), frame) for frame in hands + feet}
        found = engine.inverse_kinematics(targets, q0=start)
        assert found.success, found.message
        for frame, target in targets.items():
            T = engine.forward_kinematics(found.q, frame)
            assert np.linalg.norm(T[:3, 3] - target[:3, 3]) <= TOLERANCE
            assert np.abs(T - target).max() <= 10 * TOLERANCE
            assert found.by_frame[frame][0] <= found.position_error <= TOLERANCE
        # The joints of the head are on no path.
        head = [k for k, joint in enumerate(model.joint_names) if joint.startswith("head")]
        offset = model.nq - len(model.joint_names)
        assert all(found.q[offset + k] == start[offset + k] for k in head)


def test_frames_with_options_of_their_own_and_batches() -> None:
    model = load("talos_reduced")
    with backend("compiled", model) as engine:
        left, right = "gripper_left_base_link", "gripper_right_base_link"
        q = model.random(2, 3)
        wanted = [
            FrameTarget(left, engine.forward_kinematics(q, left), free="rotation_x"),
            FrameTarget(right, engine.forward_kinematics(q[0], right)[:3, 3]),
        ]
        found = engine.inverse_kinematics(wanted)
        assert found.q.shape == (3, model.nq)
        alone = engine.inverse_kinematics(
            [FrameTarget(left, engine.forward_kinematics(q[0], left), free="rotation_x"), wanted[1]]
        )
        assert alone.success
        np.testing.assert_array_equal(alone.q, found.q[0])
        far = engine.inverse_kinematics({left: [9.0, 0.0, 0.0], right: [0.0, 0.0, 9.0]}, max_restarts=1)
        assert far.status == "UNREACHABLE"
        assert left in far.message or right in far.message


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"free": "rotationz"}, ArgumentError, "did you mean 'rotation_z'"),
        ({"free": ("position", "rotation")}, ArgumentError, "nothing remains"),
        ({"free": 3}, ArgumentError, "wanted a name or several"),
        ({"axes": "worlds"}, ArgumentError, "did you mean 'world'"),
        ({"axes": None}, ArgumentError, "axes is 'None'; known: target, world"),
        ({"weights": [1.0, 1.0, 1.0]}, ShapeError, r"weights has shape \(3,\)"),
        ({"weights": [-1.0] * 6}, ArgumentError, "at least 0"),
        ({"weights": [0.0] * 6}, ArgumentError, "nothing remains"),
        ({"position_tolerance": [1.0, 1.0]}, ShapeError, r"position_tolerance has shape \(2,\)"),
        ({"rotation_tolerance": [1.0, 0.0, 1.0]}, ArgumentError, "wanted a positive number, or three"),
        ({"limit_margin": -0.1}, ArgumentError, "at least 0"),
        ({"limit_margin": 100.0}, ArgumentError, "no range: its limits are"),
        ({"limit_margin": [0.1, 0.1]}, ShapeError, r"limit_margin has shape \(2,\)"),
        ({"postion_tolerance": 1.0}, UnknownNameError, "did you mean 'position_tolerance'"),
        ({"method": "dynxx"}, ArgumentError, "did you mean 'dynx'"),
        ({"all_solutions": True, "weights": [1.0] * 6}, ArgumentError, "without free, point, weights"),
    ],
)
def test_invalid_options_name_what_is_valid(
    options: dict[str, Any], error: type[Exception], message: str
) -> None:
    with backend("compiled", ARM) as engine, pytest.raises(error, match=message):
        engine.inverse_kinematics(np.eye(4), FRAME, **options)


@pytest.mark.parametrize(
    ("target", "frame", "options", "message"),
    [
        ({}, None, {}, "names no frame"),
        ({FRAME: np.eye(4)}, FRAME, {}, "in addition to targets"),
        ({"flang": np.eye(4)}, None, {}, "did you mean 'flange'"),
        (np.eye(4), None, {}, "no frame is given"),
        ([FrameTarget(FRAME, np.eye(4)), np.eye(4)], None, {}, "wanted FrameTarget only"),
        ([FrameTarget(FRAME, np.eye(4))] * 2, None, {}, "twice"),
        ([FrameTarget(FRAME, np.eye(4))], None, {"free": "rotation"}, "is given in each FrameTarget"),
        (np.zeros(3), FRAME, {"free": "rotation_z"}, "whose rotation is free"),
        (rotation_from_rpy(np.ones(3)), FRAME, {"free": "position", "point": np.ones(3)}, "no effect"),
    ],
)
def test_invalid_targets_of_frames(target: Any, frame: Any, options: dict[str, Any], message: str) -> None:
    with backend("compiled", ARM) as engine, pytest.raises(ArgumentError, match=message):
        engine.inverse_kinematics(target, frame, **options)


def test_a_misspelt_field_of_a_target_has_the_nearest_name() -> None:
    misspelt: dict[str, Any] = {"wieghts": [1.0] * 6}
    with pytest.raises(UnknownNameError, match="FrameTarget has no option 'wieghts'; did you mean 'weights'"):
        FrameTarget(FRAME, np.eye(4), **misspelt)


def test_signatures_list_every_option() -> None:
    names = [field.name for field in fields(Options)]
    assert list(IKOptions.__annotations__) == names
    with backend("compiled", ARM) as compiled, backend("reference", ARM) as reference:
        for engine in (compiled, reference):
            listed = inspect.signature(engine.inverse_kinematics).parameters
            assert list(listed) == ["target", "frame", "q0", *names]
            assert listed["max_restarts"].default == 200
