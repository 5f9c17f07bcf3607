"""Tasks of a robot on the ground in worlds of all engines and in kernels: contact forces and statistics."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dynx.backends.registry import backend
from dynx.envs.environment import TaskEnvironment
from dynx.envs.ground_task import GroundState, GroundTask
from dynx.envs.runner import GroundEpisodes, WorldEpisodes
from dynx.envs.tasks.quadruped import FEET
from dynx.envs.tasks.stand import Stand
from dynx.envs.tasks.walk import Walk
from dynx.envs.vector import RobotVectorEnvironment
from dynx.errors import ArgumentError, DTypeError, UnknownNameError
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotation_from_quat
from dynx.steppers.registry import world_names

IN_WORLD = "dynx in a world"


def environment(task: GroundTask, engine: str, **options: Any) -> TaskEnvironment:
    """Return an environment on an engine; `IN_WORLD` for engine dynx without a kernel."""
    env = TaskEnvironment(task, engine.partition(" ")[0], **options)
    if engine == IN_WORLD:
        env.episodes.close()
        env._episodes = WorldEpisodes(task, "dynx")
    return env


def robot_state(env: TaskEnvironment) -> tuple[Floats, Floats]:
    """Return q and v of the robot."""
    episodes = env.episodes
    if isinstance(episodes, WorldEpisodes):
        ((q, v),) = episodes.world.state.robots.values()
        return q, v
    assert isinstance(episodes, GroundEpisodes)
    return episodes.state.q, episodes.state.v


@pytest.mark.parametrize("engine", [*world_names(), IN_WORLD])
def test_forces_on_the_feet_are_those_that_change_the_momentum(engine: str) -> None:
    """In each control step, also at impacts."""
    task = Stand(contacts="feet", foot_forces=True)
    mass, weight, dt = task.model.total_mass, task.weight, task.control_dt
    actions = np.random.default_rng(1).uniform(-0.3, 0.3, (25, 12)).astype(np.float32)
    with environment(task, engine) as env, backend("compiled", task.model) as robot:
        observation, _ = env.reset(seed=3, options={"disturbance": 0.5})
        assert np.array_equal(observation[45:], np.zeros(12))
        momentum = robot.centroidal_momentum(*robot_state(env))[:3]
        largest = 0.0
        for action in [*actions, *np.zeros((25, 12), dtype=np.float32)]:
            before, observation = momentum, env.step(action)[0]
            q, v = robot_state(env)
            forces = observation[45:].reshape(4, 3) @ rotation_from_quat(q[3:7]).T
            momentum = robot.centroidal_momentum(q, v)[:3]
            change = (momentum - before) / dt / weight + [0.0, 0.0, mass * 9.81 / weight]
            # Legs move during a step, which changes momentum by terms of the order of the step.
            np.testing.assert_allclose(forces.sum(axis=0), change, rtol=0.0, atol=5e-3)
            largest = max(largest, forces[:, 2].max())
    assert largest > 0.4
    assert (forces[:, 2] > 0.1).all()


def test_forces_are_named_and_optional() -> None:
    for kind, size in ((Stand, 45), (Walk, 48)):
        for given, more in ((False, 0), (True, 12)):
            task = kind(foot_forces=given)
            assert task.observation_space.shape == (size + more,)
            assert len(task.observation_names) == size + more
            assert task.contact_links == (FEET if given else ())
    assert Walk(foot_forces=True).observation_names[45] == "FR_foot force x"
    with pytest.raises(DTypeError, match="foot_forces is 'yes'"):
        Walk(foot_forces="yes")  # type: ignore[arg-type]


class Elsewhere(Stand):
    """A task that reads the forces of a link by another name."""

    link = "FR_fot"

    @property
    def contact_links(self) -> tuple[str, ...]:
        return (self.link,)


class Massless(Elsewhere):
    """A task that reads the forces of a link that nothing touches."""

    link = "base"


@pytest.mark.parametrize("engine", ["dynx", "mujoco"])
def test_links_without_contacts_are_refused_by_name(engine: str) -> None:
    for kind, error, message in (
        (Elsewhere, UnknownNameError, "did you mean 'FR_foot'"),
        (Massless, ArgumentError, "base has no collision shape"),
    ):
        with pytest.raises(error, match=message):
            TaskEnvironment(kind(contacts="feet"), engine)
    with pytest.raises(UnknownNameError, match="FR_foot"):
        RobotVectorEnvironment(Elsewhere(contacts="feet"), 2)


class Rewarded(Stand):
    """A task whose reward is the vertical force on the feet in units of the weight."""

    def terms(self, before: GroundState, action: Any, after: GroundState) -> dict[str, Any]:
        first, last = (np.sum(each.forces[:, 2]) / self.weight for each in (before, after))
        return {"before": -1e-3 * first, "after": last}


def test_hooks_read_the_forces_of_states() -> None:
    task, actions = Rewarded(contacts="feet", foot_forces=True), np.zeros((8, 12), dtype=np.float32)
    found = []
    for engine in ("dynx", IN_WORLD, "mujoco"):
        with environment(task, engine) as env:
            env.reset(seed=0, options={"disturbance": 0.0})
            found.append([(env.step(each)[1], *env.reward_terms.values()) for each in actions])
    rewards = np.array(found)
    assert rewards[:, :, 0] == pytest.approx(rewards[:, :, 1:].sum(axis=2), abs=1e-12)
    np.testing.assert_allclose(-1e3 * rewards[:, 1:, 1], rewards[:, :-1, 2], rtol=1e-9)
    np.testing.assert_allclose(rewards[0, :, 2], rewards[1, :, 2], rtol=0.0, atol=5e-3)
    np.testing.assert_allclose(rewards[0, :, 2].mean(), rewards[2, :, 2].mean(), rtol=0.05)


class Yielding(Stand):
    """A stand whose targets follow the velocities at the beginning of a control step."""

    def targets(self, state: GroundState, action: Any) -> Any:
        return super().targets(state, action) + 0.05 * state.v[6:]


def test_targets_are_those_of_the_beginning_of_a_control_step() -> None:
    """In free flight, where no sweeps end at a tolerance."""
    found = []
    for engine in ("dynx", IN_WORLD):
        with environment(Yielding(contacts="feet"), engine) as env:
            env.reset(seed=3, options={"disturbance": 5.0})
            observation = env.step(np.full(12, 0.3, dtype=np.float32))[0]
            found.append(observation)
    np.testing.assert_allclose(found[0], found[1], rtol=0.0, atol=1e-5)


def test_returns_with_pushes_and_delays_are_those_of_other_engines() -> None:
    """Mean returns of pushed robots differ by less than three standard errors."""
    task, count, steps = Stand(contacts="feet", disturbance=0.5), 8, 40
    drawn = {"pushes": {"speed": (0.2, 0.6), "interval": 0.4}, "delay": (0.0, 0.06)}
    actions = np.repeat(np.random.default_rng(0).uniform(-0.2, 0.2, (steps // 4, count, 12)), 4, axis=0)
    actions = actions.astype(np.float32)
    envs = RobotVectorEnvironment(task, count, randomize=drawn, autoreset_mode="Disabled")
    envs.reset(seed=0)
    returns, alive = np.zeros((2, count)), np.ones(count, dtype=np.bool_)
    for each in actions:
        _, rewards, terminated, _, _ = envs.step(each)
        returns[0] += np.where(alive, rewards, 0.0)
        alive &= ~terminated
        if terminated.any():
            envs.reset(options={"reset_mask": terminated})
    envs.close()
    with TaskEnvironment(task, "mujoco", randomize=drawn) as env:
        for k in range(count):
            env.reset(seed=k)
            for each in actions[:, k]:
                _, reward, over, _, _ = env.step(each)
                returns[1, k] += reward
                if over:
                    break
    error = np.sqrt(np.sum(np.var(returns, axis=1, ddof=1)) / count)
    assert abs(np.mean(returns[0]) - np.mean(returns[1])) < 3.0 * error
