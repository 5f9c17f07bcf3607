"""A position and a quaternion (x, y, z, w) are a pose wherever a pose is taken."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.distance import distance
from dynx.errors import ArgumentError, ShapeError
from dynx.ik import FrameTarget
from dynx.ik.velocity import VelocityTask
from dynx.model import Frame
from dynx.model.elements import checked_pose, matrix_of_pair
from dynx.model.geometry import Box
from dynx.trajectory import line
from dynx.world import Scene, SceneRobot, World, box

MODELS = {name: dynx.load(name) for name in ("six_axis_arm", "seven_axis_arm")}
ARM = MODELS["six_axis_arm"]
BACKENDS = ("reference", "pinocchio", "pybullet", "mujoco", "drake", "compiled")
Q = np.array([0.3, -0.4, 0.5, 0.2, 0.6, -0.1])


def pair_of(T: Any) -> tuple[Any, Any]:
    return T[..., :3, 3], dynx.quat_from_rotation(T[..., :3, :3])


@given(st.integers(0, 2**32 - 1), st.sampled_from([(), (3,), (2, 3)]), st.booleans())
def test_a_pair_is_the_matrix(seed: int, batch: tuple[int, ...], listed: bool) -> None:
    rng = np.random.default_rng(seed)
    position, quat = rng.normal(size=(*batch, 3)), rng.normal(size=(*batch, 4))
    quat /= np.linalg.norm(quat, axis=-1, keepdims=True)
    pair: Any = [position.tolist(), quat.tolist()] if listed else (position, quat)
    T = matrix_of_pair(pair, "pose")
    assert T.shape == (*batch, 4, 4)
    assert np.array_equal(T[..., :3, 3], position)
    assert np.abs(T[..., :3, :3] - dynx.rotation_from_quat(quat)).max() < 1e-15
    if not batch:
        assert np.abs(checked_pose("pose", pair).matrix - T).max() < 1e-14


@given(st.integers(0, 2**32 - 1), st.sampled_from([(), (3,)]), st.integers(1, 4), st.booleans())
def test_a_list_of_pairs_is_a_stack_of_matrices(
    seed: int, batch: tuple[int, ...], count: int, listed: bool
) -> None:
    rng = np.random.default_rng(seed)
    pairs: list[Any] = []
    for _ in range(count):
        quat = rng.normal(size=(*batch, 4))
        quat /= np.linalg.norm(quat, axis=-1, keepdims=True)
        pairs.append((rng.normal(size=(*batch, 3)), quat))
    expected = np.stack([matrix_of_pair(each, "pose") for each in pairs])
    given_pairs = [[each.tolist() for each in pair] for pair in pairs] if listed else tuple(pairs)
    assert np.array_equal(matrix_of_pair(given_pairs, "pose"), expected)


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ([((0, 0, 1), (0, 0, 0, 1)), ((0, 0, 1), (0, 0, 1, 1))], r"target\[1\] is a quaternion"),
        (
            [((0, 0, 1), (0, 0, 0, 1)), (np.zeros((2, 3)), (0, 0, 0, 1))],
            "target has pairs of poses with shapes",
        ),
        ([0, 0, 1, 0, 0, 0, 1], r"a pair of a position \(..., 3\) and a quaternion \(x, y, z, w\)"),
    ],
)
def test_what_is_no_pair_is_named(target: Any, message: str) -> None:
    with dynx.backend("reference", ARM) as engine, pytest.raises(ArgumentError, match=message):
        engine.inverse_kinematics(target, "tool0", Q)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", MODELS)
def test_inverse_kinematics_takes_it_in_every_form(backend: str, name: str) -> None:
    model = MODELS[name]
    with dynx.backend(backend, model) as engine:
        q = model.random(3)
        T = engine.forward_kinematics(q, "tool0" if name == "six_axis_arm" else model.frame_names[-1])
        frame = "tool0" if name == "six_axis_arm" else model.frame_names[-1]
        forms: tuple[Callable[[Any], Any], ...] = (
            lambda pose: engine.inverse_kinematics(pose, frame, q),
            lambda pose: engine.inverse_kinematics({frame: pose}, q0=q),
            lambda pose: engine.inverse_kinematics([FrameTarget(frame, pose)], q0=q),
            lambda pose: engine.inverse_kinematics(pose, frame, q, free="rotation"),
            lambda pose: engine.inverse_kinematics(pose, frame, q, free=("rotation_z",)),
            lambda pose: engine.inverse_kinematics(pose, frame, q, free="position"),
        )
        for solve in forms:
            found, expected = solve(pair_of(T)), solve(T)
            assert found.success
            assert np.abs(found.q - expected.q).max() < 1e-6
        for pairs in (pair_of(np.stack([T, T])), [pair_of(T), pair_of(T)]):
            several = engine.inverse_kinematics(pairs, frame, q)
            assert several.success.tolist() == [True, True]


def test_closed_forms_paths_lines_and_velocities_take_it() -> None:
    with dynx.backend("pinocchio", ARM) as engine:
        T = engine.forward_kinematics(Q, "tool0")
        found = engine.inverse_kinematics(pair_of(T), "tool0", all_solutions=True)
        assert np.abs(found.q - Q).max(axis=-1).min() < 1e-9
        by_form = dynx.ik.closed_form(ARM, "tool0").solve(pair_of(T))
        assert len(by_form.q) == len(dynx.ik.closed_form(ARM, "tool0").solve(T).q)
        path = engine.forward_kinematics(Q + np.linspace(0.0, 0.1, 5)[:, None], "tool0")
        for pairs in (pair_of(path), [pair_of(each) for each in path]):
            tracked = engine.track(pairs, "tool0", Q)
            assert np.abs(tracked.q - engine.track(path, "tool0", Q).q).max() < 1e-9
        end = engine.forward_kinematics(Q + 0.1, "tool0")
        reached = line(ARM, "tool0", Q, pair_of(end), 2.0)(2.0)[0]
        assert np.abs(engine.forward_kinematics(reached, "tool0") - end).max() < 1e-4
        tasks = [VelocityTask("tool0", target=each) for each in (end, pair_of(end))]
        moved = [engine.velocity_ik(Q, task, dt=0.01) for task in tasks]
        assert np.abs(moved[0].v - moved[1].v).max() < 1e-9


@given(st.integers(0, 2**32 - 1))
def test_models_scenes_worlds_and_distances_take_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    quat = rng.normal(size=4)
    pair = rng.normal(size=3), quat / np.linalg.norm(quat)
    T, pose = matrix_of_pair(pair, "pose"), checked_pose("pose", pair)
    assert ARM.with_base_pose(pair).base_pose == pose
    assert dynx.load("planar_2r", base_pose=pair).base_pose == pose
    framed = ARM.with_frame("camera", "tool0", pair)
    assert isinstance(framed.extra_frames[-1], Frame)
    assert framed.extra_frames[-1].placement == pose
    assert SceneRobot("arm", ARM).at(pair).model.base_pose == pose
    assert box("b", (0.1, 0.1, 0.1), mass=1.0, pose=pair).pose == pose
    apart = distance(Box((0.1, 0.2, 0.3)), pair, Box((0.1, 0.1, 0.1)), np.eye(4))
    assert apart.distance == distance(Box((0.1, 0.2, 0.3)), T, Box((0.1, 0.1, 0.1)), np.eye(4)).distance


def test_the_state_of_a_body_takes_it() -> None:
    pair = (0.1, 0.2, 0.3), (0.0, 0.6, 0.0, 0.8)
    with World(Scene("s", bodies=(box("b", (0.1, 0.1, 0.1), mass=1.0),))) as world:
        world.set_state(bodies={"b": (pair, np.zeros(6))})
        T = world.state.bodies["b"].T_world_body
    assert np.abs(T - matrix_of_pair(pair, "pose")).max() < 1e-12


@pytest.mark.parametrize(
    ("pair", "error", "message"),
    [
        (((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 2.0)), ArgumentError, r"quaternion \(x, y, z, w\) of length 2;"),
        (((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)), ArgumentError, "of length 0; wanted length 1"),
        (((0.0, 0.0, np.nan), (0.0, 0.0, 0.0, 1.0)), ArgumentError, "NaN|nan|finite"),
        ((np.zeros((2, 3)), np.tile([0, 0, 0, 1.0], (3, 1))), ShapeError, "do not broadcast"),
    ],
)
def test_a_wrong_pair_is_refused_at_every_door(pair: Any, error: type[Exception], message: str) -> None:
    with dynx.backend("reference", ARM) as engine:
        doors: tuple[Callable[[], Any], ...] = (
            lambda: engine.inverse_kinematics(pair, "tool0"),
            lambda: engine.inverse_kinematics({"tool0": pair}),
            lambda: engine.inverse_kinematics(pair, "tool0", all_solutions=True),
            lambda: engine.track(pair, "tool0", Q),
            lambda: line(ARM, "tool0", Q, pair, 1.0),
            lambda: ARM.with_base_pose(pair),
            lambda: box("b", (0.1, 0.1, 0.1), mass=1.0, pose=pair),
        )
        for call in doors:
            with pytest.raises(error, match=message):
                call()
