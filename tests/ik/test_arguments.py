"""Invalid arguments raise errors that name them; unusual ones are handled."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from dynx.agreement.tolerances import BAR
from dynx.backends import Backend, backend, installed_backends
from dynx.errors import ArgumentError, ClosedError, DTypeError, NotFiniteError, ShapeError, UnknownNameError
from dynx.ik import FrameTarget, IKResult, inverse_kinematics
from dynx.model import Link, Model, Pose
from dynx.model.loading import load
from dynx.spatial.so3 import rotation_from_rpy
from tests.oracles.closed_form import MODELS

REFLECTION = np.diag([1.0, 1.0, -1.0, 1.0])
STRETCHED = np.diag([1.0, 1.0, 1.00001, 1.0])
PROJECTIVE = np.eye(4) + np.eye(4, k=-3)
TURN = rotation_from_rpy(np.array([0.3, -0.4, 2.0]))


@pytest.fixture(params=["pinocchio", "compiled"])
def engine(request: pytest.FixtureRequest) -> Iterator[Backend]:
    with backend(request.param, load(MODELS / "six_axis_arm.urdf")) as engine:
        yield engine


def test_a_pose_object_is_a_target(engine: Backend) -> None:
    """Alone, in a list, of one frame among several, and along a path."""
    T = engine.forward_kinematics(0.3 * np.ones(6), "flange")
    pose = Pose.from_matrix(T)
    expected = engine.inverse_kinematics(pose.matrix, "flange").q
    for target, frame in ((pose, "flange"), ({"flange": pose}, None), ([FrameTarget("flange", pose)], None)):
        np.testing.assert_array_equal(engine.inverse_kinematics(target, frame).q, expected)
    several = engine.inverse_kinematics([pose, pose], "flange")
    np.testing.assert_array_equal(several.q, [expected, expected])
    assert engine.track([pose, pose], "flange", 0.3 * np.ones(6))


@pytest.mark.parametrize(
    ("target", "error", "message"),
    [
        (REFLECTION, ArgumentError, "reflection"),
        (STRETCHED, ArgumentError, "not orthonormal"),
        (PROJECTIVE, ArgumentError, "last row"),
        (np.zeros((4, 4)), ArgumentError, "rigid transform"),
        (np.stack([np.eye(4), REFLECTION]), ArgumentError, r"target\[1\]"),
        (np.full((4, 4), np.nan), NotFiniteError, "finite"),
        (np.array([0.0, np.inf, 0.0]), NotFiniteError, r"target\[1\]"),
        (np.eye(3)[:, :2], ShapeError, r"\(3, 2\)"),
        (np.eye(3), ArgumentError, r"\(3, 3\) may be a rotation or three positions: free='position' reads"),
        (np.stack([TURN, TURN.T]), ArgumentError, r"\(2, 3, 3\) may be a rotation"),
        (TURN.round(3).tolist(), ArgumentError, "may be a rotation"),
        (-np.eye(3), ArgumentError, "may be a rotation"),
        (np.zeros(7), ShapeError, r"\(7,\)"),
        (1.0, ShapeError, "wanted a pose"),
        ([[1.0], [1.0, 2.0]], ShapeError, "ragged"),
        ("flange", DTypeError, "real numbers"),
        (np.eye(4) * 1j, DTypeError, "complex"),
    ],
)
def test_invalid_targets_raise(engine: Backend, target: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        engine.inverse_kinematics(target, "flange")


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"q0": np.zeros(5)}, ShapeError),
        ({"q0": np.full(6, np.nan)}, NotFiniteError),
        ({"point": [0.0, 1.0]}, ShapeError),
        ({"point": np.zeros((2, 3))}, ShapeError),
        ({"position_tolerance": 0.0}, ArgumentError),
        ({"rotation_tolerance": float("nan")}, ArgumentError),
        ({"position_tolerance": "small"}, ArgumentError),
        ({"max_iterations": -1}, ArgumentError),
        ({"max_restarts": 1.5}, ArgumentError),
        ({"max_restarts": True}, ArgumentError),
        ({"rng": "seed"}, ArgumentError),
        ({"rng": -1}, ArgumentError),
        ({"method": "newton"}, ArgumentError),
        ({"method": "engine"}, ArgumentError),
        ({"free": "orientation"}, ArgumentError),
        ({"free": np.zeros(2)}, ArgumentError),
        ({"free": "position", "point": np.zeros(3)}, ArgumentError),
        ({"free": "position", "method": "engine"}, ArgumentError),
    ],
)
def test_invalid_options_raise(engine: Backend, options: dict[str, Any], error: type[Exception]) -> None:
    with pytest.raises(error):
        engine.inverse_kinematics(np.eye(4), "flange", **options)


@pytest.mark.parametrize(
    ("target", "free", "message"),
    [
        (np.zeros(3), "position", r"\(3,\); wanted a rotation"),
        (np.zeros((2, 3)), "position", "wanted a rotation"),
        (np.diag([1.0, 1.0, -1.0]), "position", "reflection"),
        (np.diag([1.0, 1.0, 1.1]), "position", "not orthonormal"),
        (np.zeros(4), "rotation", r"\(4,\); wanted a position"),
        (1.0, "rotation", "wanted a position"),
    ],
)
def test_targets_with_a_free_part_that_raise(engine: Backend, target: Any, free: str, message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        engine.inverse_kinematics(target, "flange", free=free)


def test_three_positions_are_read_as_such(engine: Backend) -> None:
    near = 0.2 * np.eye(3) + 0.3
    assert engine.inverse_kinematics(near, "flange").q.shape == (3, 6)
    assert engine.inverse_kinematics(np.eye(3), "flange", free="rotation", max_restarts=0).q.shape == (3, 6)


def test_axes_that_do_not_broadcast(engine: Backend) -> None:
    with pytest.raises(ShapeError, match="broadcast"):
        engine.inverse_kinematics(np.zeros((2, 3)), "flange", np.zeros((3, 6)))


@pytest.mark.parametrize("frame", ["flang", None, 3, ["flange"]])
def test_unknown_frames_raise(engine: Backend, frame: Any) -> None:
    with pytest.raises(UnknownNameError):
        engine.inverse_kinematics(np.eye(4), frame)


def test_a_start_outside_the_limits_is_moved_and_noted(engine: Backend) -> None:
    q0, target = engine.model.neutral(), engine.forward_kinematics(engine.model.neutral(), "flange")
    assert engine.inverse_kinematics(target, "flange", q0).note == ""
    q0[1] = 99.0
    found = engine.inverse_kinematics(target, "flange", q0)
    assert found
    assert f"joint2 from 99 to {engine.model.upper[1]:.6g}" in found.note
    assert found.note in found.message
    batch = engine.inverse_kinematics(target, "flange", np.array([q0, 0.0 * q0]))
    degrees = engine.inverse_kinematics(target, "flange", np.array([0.0, 90.0, *q0[2:]]))
    assert degrees.note == (
        f"q0 was outside the limits and moved into them: joint2 from 90 to {engine.model.upper[1]:.6g} "
        "(90 degrees are 1.5708 rad)"
    )
    assert batch.note == "1 of 2 q0 were outside the limits and moved into them (joint2)"


def test_a_closed_backend_refuses(engine: Backend) -> None:
    engine.close()
    with pytest.raises(ClosedError):
        engine.inverse_kinematics(np.eye(4), "flange")


def test_an_empty_batch(engine: Backend) -> None:
    result = engine.inverse_kinematics(np.zeros((0, 3)), "flange")
    assert result.q.shape == (0, 6)
    assert result
    assert result.message.startswith("0 of 0")


@pytest.mark.parametrize("name", installed_backends())
def test_a_frame_that_nothing_moves(name: str) -> None:
    for model in (load(MODELS / "six_axis_arm.urdf"), Model.build("stone", [Link("stone")], [])):
        with backend(name, model) as engine:
            there = engine.inverse_kinematics(np.eye(4), model.root)
            elsewhere = engine.inverse_kinematics([0.0, 3.0, 4.0], model.root)
        assert there.success
        assert not elsewhere.success
        assert elsewhere.position_error == 5.0
        assert there.iterations == elsewhere.iterations == elsewhere.restarts == 0
        np.testing.assert_array_equal(there.q, model.clip(model.neutral()))


def test_a_start_outside_the_limits_is_moved_to_them(engine: Backend) -> None:
    model = engine.model
    target = engine.forward_kinematics(model.upper, "flange")
    result = engine.inverse_kinematics(target, "flange", model.upper + 1.0)
    assert result.iterations == 0
    np.testing.assert_array_equal(result.q, model.upper)


def test_a_pose_in_single_precision_is_reached(engine: Backend) -> None:
    target = engine.forward_kinematics(engine.model.random(1), "flange").astype(np.float32)
    assert engine.inverse_kinematics(target, "flange").success


def test_arguments_are_not_written_to(engine: Backend) -> None:
    target = engine.forward_kinematics(engine.model.random(1), "flange")
    q_start = engine.model.random(2)
    before = target.copy(), q_start.copy()
    result = engine.inverse_kinematics(target, "flange", q_start)
    result.q[:] = 0.0
    np.testing.assert_array_equal(target, before[0])
    np.testing.assert_array_equal(q_start, before[1])


def test_with_zero_iterations_the_start_is_evaluated(engine: Backend) -> None:
    q_start = engine.model.random(1)
    result = engine.inverse_kinematics(np.eye(4), "flange", q_start, max_iterations=0, max_restarts=0)
    assert isinstance(result, IKResult)
    assert not result.success
    assert result.iterations == 0
    np.testing.assert_array_equal(result.q, q_start)


@pytest.mark.skipif("pybullet" not in installed_backends(), reason="PyBullet is not installed")
def test_the_engine_s_own_solver_is_evaluated_by_forward_kinematics() -> None:
    model = load(MODELS / "six_axis_arm.urdf")
    with backend("pybullet", model) as engine:
        targets = engine.forward_kinematics(model.random(0, 20), "flange")
        result = engine.inverse_kinematics(targets, "flange", method="engine", position_tolerance=1e-3)
        reached = engine.forward_kinematics(result.q, "flange")
        distance = np.linalg.norm(targets[:, :3, 3] - reached[:, :3, 3], axis=-1)
        # The positions are metres apart, so both distances carry their rounding.
        np.testing.assert_allclose(result.position_error, distance, rtol=0.0, atol=BAR)
        assert (result.q >= model.lower).all()
        assert (result.q <= model.upper).all()
        assert not result.success[distance > 1e-3].any()
        with pytest.raises(ArgumentError, match="poses"):
            engine.inverse_kinematics(targets[0, :3, 3], "flange", method="engine")


@pytest.mark.parametrize("given", [load("six_axis_arm"), "six_axis_arm", None])
def test_anything_but_a_backend_is_refused(given: Any) -> None:
    with pytest.raises(ArgumentError, match=r"the backend is of type \w+; wanted a dynx.Backend"):
        inverse_kinematics(given, [0.4, 0.2, 0.3])


def test_names_that_went_say_where_to_look() -> None:
    with pytest.raises(ImportError, match=r"dynx\.ik\.proofs is now dynx\.ik\.reach"):
        from dynx.ik import proofs  # type: ignore[attr-defined]  # noqa: F401
