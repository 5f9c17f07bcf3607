"""Reach: arms, actions, goals that can be reached, and equal steps on every engine and in one kernel."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.backends import installed_backends
from dynx.compiled.array_dynamics import ArrayDynamics
from dynx.envs.environment import TaskEnvironment
from dynx.envs.task import State
from dynx.envs.tasks.reach import ROTATION_WEIGHT, SERVO_RATE, Reach
from dynx.envs.vector import RobotVectorEnvironment
from dynx.errors import ArgumentError, UnknownNameError
from dynx.spatial.so3 import rotation_about
from tests.envs.scripted import Reaching, run

N = 4


@pytest.mark.parametrize("actions", ["torque", "velocity"])
def test_engines_and_the_kernel_take_equal_steps(actions: str) -> None:
    task = Reach(robot="planar_3r", actions=actions)
    envs = RobotVectorEnvironment(task, N)
    envs.reset(seed=3)
    starts = envs.states
    given = np.random.default_rng(0).uniform(-1.0, 1.0, (N, 3))
    observations, rewards, *_ = envs.step(given)
    for engine in installed_backends():
        env: Any = TaskEnvironment(task, engine)
        env.reset(seed=0)
        for k in range(N):
            env.episodes.state = State(*np.split(starts[k], [3, 6]))
            observation, reward, _, _, info = env.step(given[k])
            assert observation == pytest.approx(observations[k], abs=1e-6)
            assert reward == pytest.approx(rewards[k], abs=1e-9)
            assert info["distance"] == pytest.approx(np.linalg.norm(observation[9:12]), rel=1e-5)
        env.close()


def test_the_goal_is_a_pose_of_the_frame_and_has_no_error() -> None:
    task = Reach(robot="six_axis_arm")
    env: Any = TaskEnvironment(task, "reference")
    env.reset(seed=1)
    model, random = task.model, np.random.default_rng(5).random(task.random_size)
    state = task.start(random)
    q_goal = task._range[0] + (task._range[1] - task._range[0]) * random[model.nq :]
    T = dynx.backend("reference", model).forward_kinematics(q_goal, task.tool)
    assert state.memory[:3] == pytest.approx(T[:3, 3])
    env.episodes.state = State(q_goal, np.zeros(model.nv), state.memory)
    _, distance, rotation = task.errors(env.episodes._robot, env.episodes.state)
    assert max(np.linalg.norm(distance), np.linalg.norm(rotation)) < 1e-12


@given(st.floats(0.0, 3.14), st.integers(0, 2**32 - 1))
def test_the_rotation_error_grows_up_to_half_a_turn(angle: float, seed: int) -> None:
    task, rng = Reach(robot="six_axis_arm"), np.random.default_rng(seed)
    robot = ArrayDynamics(task.model)
    state = task.start(rng.random(task.random_size))
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    T = robot.forward_kinematics(state.q, task.tool)
    R_goal = np.asarray(rotation_about(axis, np.array(angle))) @ T[:3, :3]
    turned = state._replace(memory=np.concatenate([T[:3, 3], R_goal.ravel()]))
    _, distance, rotation = task.errors(robot, turned)
    assert np.abs(distance).max() < 1e-12
    assert rotation == pytest.approx(angle * axis, abs=1e-7)
    reward = task.reward(robot, turned, np.zeros(6), turned)
    assert reward == pytest.approx(-ROTATION_WEIGHT * angle, abs=1e-7)


@pytest.mark.parametrize("actions", ["torque", "velocity"])
def test_every_goal_is_reached_by_joint_control(actions: str) -> None:
    with TaskEnvironment(Reach(actions=actions), "compiled") as env:
        for seed in range(5):
            still, *_ = run(env, lambda *_: np.zeros(6), 200, seed)
            total, _, info = run(env, Reaching(env), 200, seed)
            assert max(info["distance"], info["angle"]) < 1e-3
            assert total > 0.7 * still


def test_velocities_follow_the_action_and_gravity_is_carried() -> None:
    env: Any = TaskEnvironment(Reach(robot="six_axis_arm", actions="velocity"), "compiled")
    env.reset(seed=0)
    wanted = np.array([0.2, -0.1, 0.3, 0.0, 0.1, -0.3])
    for _ in range(50):
        env.step(wanted)
    remaining = (1.0 - SERVO_RATE * 0.004) ** 250
    assert env.episodes.state.v == pytest.approx(wanted * (1.0 - remaining), abs=1e-3)
    still: Any = TaskEnvironment(Reach(robot="six_axis_arm"), "compiled")
    still.reset(seed=0)
    for _ in range(50):
        still.step(np.zeros(6))
    assert np.abs(still.episodes.state.v).max() < 1e-9


def test_unknown_names_are_refused() -> None:
    with pytest.raises(ArgumentError, match="did you mean 'torque'"):
        Reach(actions="torqe")
    with pytest.raises(UnknownNameError, match="frame"):
        Reach(robot="planar_2r", frame="tipp")


@pytest.mark.parametrize("robot", ["planar_3r", "six_axis_arm", "ur5", "panda", "z1"])
def test_the_camera_sees_the_arm_from_the_front(robot: str) -> None:
    task = Reach(robot=robot)
    camera, low, high = task.camera, *task._range
    with dynx.backend("reference", task.model) as engine:
        middle = engine.forward_kinematics(0.5 * (low + high), task.tool)[:3, 3]
        near_middle = 0.5 * (low + high) + 0.1 * (high - low) * np.linspace(-1.0, 1.0, 9)[:, None]
        reached = engine.forward_kinematics(near_middle, task.tool)[:, :3, 3]
    T_world_camera = camera.pose.matrix
    x, y, z = T_world_camera[:3, 3]
    assert y < 0.0 < min(x, z)
    # It is a metre farther along x than the frame is from the origin, and looks halfway to the frame.
    assert x == pytest.approx(z) == pytest.approx(1.0 + np.linalg.norm(middle))
    for point in (np.zeros(3), middle, *reached):
        right, down, ahead = T_world_camera[:3, :3].T @ (point - T_world_camera[:3, 3])
        half = np.tan(0.5 * camera.field_of_view)
        assert ahead > 0.0
        assert abs(down) < half * ahead
        assert abs(right) < half * ahead * camera.size[0] / camera.size[1]
    right, down, _ = T_world_camera[:3, :3].T @ (0.5 * middle - T_world_camera[:3, 3])
    assert max(abs(right), abs(down)) < 1e-9
