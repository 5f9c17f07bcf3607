"""Tasks in worlds: Push, Stand and Walk on every engine, and what `WorldTask` promises of all of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import dynx.envs  # noqa: F401  (registers the environments)
from dynx.envs import register_task
from dynx.envs.environment import TaskEnvironment
from dynx.envs.task import WorldTask
from dynx.envs.tasks.push import ARM, FINGER_WEIGHT, NEAR, START, TIP, TIP_START, Push
from dynx.envs.tasks.quadruped import POSTURE
from dynx.envs.tasks.stand import Stand
from dynx.envs.tasks.walk import Walk
from dynx.errors import ArgumentError, EpisodeError, UnknownNameError
from dynx.steppers.registry import installed_worlds
from dynx.world import Imu, SensorErrors
from tests.envs.hail import Hail
from tests.envs.scripted import Controller, posture, pushing, run, trot

ENGINES = installed_worlds()
TASKS = (Push(), Stand(), Walk())


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(params=TASKS, ids=lambda task: type(task).__name__)
def env(request: pytest.FixtureRequest, engine: str) -> Iterator[TaskEnvironment]:
    with TaskEnvironment(request.param, engine) as made:
        yield made


def test_episodes_after_a_seed_are_the_same_bits(env: TaskEnvironment) -> None:
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1.0, 1.0, (4, *(env.action_space.shape or ()))).astype(np.float32)

    def episode() -> list[Any]:
        seen: list[Any] = [env.reset(seed=3)[0].tobytes()]
        for action in actions:
            observation, reward, *_ = env.step(action)
            seen += [observation.tobytes(), reward]
        return seen

    first = episode()
    env.reset(seed=4)
    env.step(actions[0])
    assert episode() == first


class Thrown(Push):
    """A hand that is thrown away by its first action."""

    def loads(self, episode: Any, action: Any) -> Any:
        return {"torques": {"arm": np.full(7, 1e15)}}


def test_a_world_that_diverges_is_truncated(engine: str) -> None:
    if engine == "dynx":
        pytest.skip("its joints stop at their limits under any torque")
    with TaskEnvironment(Thrown(), engine) as env:
        first, _ = env.reset(seed=0)
        action = np.zeros(3, dtype=np.float32)
        observation, reward, terminated, truncated, info = env.step(action)
        assert (reward, terminated, truncated) == (0.0, False, True)
        assert np.array_equal(observation, first)
        assert f"{engine} failed" in info["diverged"] or "diverged in" in info["diverged"]
        assert "likely cause: the torque of 1e+15 on 'arm/" in info["diverged"]
        with pytest.raises(EpisodeError, match="ended"):
            env.step(action)
        assert np.array_equal(env.reset(seed=0)[0], first)


def test_a_straight_push_brings_the_cube_to_the_goal(engine: str) -> None:
    with TaskEnvironment(Push(reward_kind="sparse"), engine) as env:
        observation, _ = env.reset(seed=0, options={"cube": (0.46, 0.0), "goal": (0.56, 0.0)})
        assert observation[:3] == pytest.approx(TIP_START, abs=1e-4)
        rewards = []
        for _ in range(25):
            forward = np.clip(5.0 * (observation[21] - observation[6]), 0.0, 0.5)
            observation, reward, _, _, info = env.step(np.array([forward, 0.0, 0.0], dtype=np.float32))
            rewards.append(reward)
    assert rewards[0] == -1.0
    assert (rewards[-1], info["is_success"]) == (0.0, True)
    assert abs(observation[6] - 0.56) < NEAR
    assert abs(observation[7]) < 0.02


def test_the_posture_stands_on_every_engine(engine: str) -> None:
    with TaskEnvironment(Stand(), engine) as env:
        env.reset(seed=1, options={"disturbance": 1.0})
        total = 0.0
        for _ in range(90):
            observation, reward, terminated, _, _ = env.step(np.zeros(len(POSTURE), dtype=np.float32))
            assert not terminated
            total += reward
    assert total > 0.8 * 90
    # The legs are springs, on which the trunk sways for some seconds.
    assert np.abs(observation[:6]).max() < 0.1
    assert observation[8] < -0.99


def test_a_fall_ends_the_episode() -> None:
    with TaskEnvironment(Stand(), ENGINES[0]) as env:
        env.reset(seed=0)
        folded = np.array([0.0, 1.0, -1.0] * 2 + [0.0, -1.0, 1.0] * 2, dtype=np.float32)
        for _ in range(200):
            *_, terminated, _, _ = env.step(folded)
            if terminated:
                return
    pytest.fail("the robot did not fall")


def test_walking_is_rewarded_by_the_velocity() -> None:
    with TaskEnvironment(Walk(), ENGINES[0]) as env:
        still = np.zeros(len(POSTURE), dtype=np.float32)
        rewards = []
        for velocity in ((0.0, 0.0, 0.0), (0.6, 0.0, 0.0)):
            _, info = env.reset(seed=0, options={"velocity": velocity, "disturbance": 0.0})
            assert info["velocity"].tolist() == list(velocity)
            for _ in range(40):
                observation, reward, *_ = env.step(still)
            rewards.append(reward)
    v = observation[:2].astype(float)
    expected = np.exp(-(v @ v) / 0.25) - np.exp(-((v[0] - 0.6) ** 2 + v[1] ** 2) / 0.25)
    assert rewards[0] == pytest.approx(1.5, abs=0.05)
    assert rewards[0] - rewards[1] == pytest.approx(expected, abs=1e-5)


def test_a_trot_walks_and_earns_more_than_the_posture(engine: str) -> None:
    def episode(env: TaskEnvironment, controller: Controller) -> tuple[float, float]:
        observation, _ = env.reset(seed=0, options={"velocity": (0.5, 0.0, 0.0), "disturbance": 0.0})
        total, speeds = 0.0, []
        for step in range(100):
            action = controller(step, observation).astype(np.float32)
            observation, reward, terminated, *_ = env.step(action)
            assert not terminated
            total += reward
            speeds.append(float(observation[0]))
        return total, float(np.mean(speeds[50:]))

    with TaskEnvironment(Walk(), engine) as env:
        (walking, speed), (standing, _) = episode(env, trot), episode(env, posture)
    assert speed == pytest.approx(0.47, abs=0.08)
    assert walking > standing + 15.0


def test_a_trot_follows_the_wanted_velocity() -> None:
    with TaskEnvironment(Walk(), ENGINES[0]) as env:
        for velocity in [(-0.5, 0.0, 0.0), (0.4, 0.2, -0.4), (-0.4, -0.2, 0.4)]:
            walking, *_ = run(env, trot, 100, 0, velocity=velocity)
            standing, *_ = run(env, posture, 100, 0, velocity=velocity)
            assert walking > standing + 10.0


def test_rewards_of_quadrupeds_are_not_negative() -> None:
    for task in (Stand(), Walk()):
        rng = np.random.default_rng(0)
        with TaskEnvironment(task, ENGINES[0]) as env:
            env.reset(seed=0)
            rewards = [env.step(rng.choice([-1.0, 1.0], 12).astype(np.float32))[1] for _ in range(15)]
        assert min(rewards) == 0.0


def test_the_disturbance_of_an_option_is_that_of_reset(engine: str) -> None:
    with TaskEnvironment(Stand(disturbance=2.0), engine) as one, TaskEnvironment(Stand(), engine) as other:
        first, _ = one.reset(seed=3)
        second, _ = other.reset(seed=3, options={"disturbance": 2.0})
    assert np.array_equal(first, second)


@pytest.mark.parametrize("seed", [0, 1, 3])
def test_a_scripted_push_succeeds(engine: str, seed: int) -> None:
    with TaskEnvironment(Push(), engine) as env:
        total, observation, info = run(env, pushing, 100, seed)
        still, *_ = run(env, lambda *_: np.zeros(3), 100, seed)
    assert info["is_success"]
    assert np.linalg.norm(observation[6:8] - observation[21:23]) < 0.02
    assert total > 0.6 * still


def test_the_shaped_reward_draws_the_fingers_behind_the_cube() -> None:
    options = {"cube": (0.5, 0.0), "goal": (0.6, 0.0)}
    backwards = np.array([-1.0, 0.0, 0.0], dtype=np.float32)
    rewards = {}
    for kind in ("shaped", "dense"):
        with TaskEnvironment(Push(reward_kind=kind), ENGINES[0]) as env:
            env.reset(seed=0, options=options)
            rewards[kind] = [env.step(action)[1] for action in (backwards, *3 * [-backwards])]
    # The fingers do not reach the cube: they are at (0.35, 0, 0.03), the place to push from (0.45, 0, 0.025).
    assert np.ptp(rewards["dense"]) < 1e-4
    assert (np.diff(rewards["shaped"]) > 0.0).all()
    assert rewards["shaped"][1] == pytest.approx(-0.1 - FINGER_WEIGHT * np.hypot(0.1, 0.005), abs=2e-3)


@pytest.mark.parametrize("action", [(0.0, 0.0, 0.0), (0.5, 0.5, 0.2)])
def test_the_fingers_turn_back_to_point_down(action: tuple[float, float, float]) -> None:
    task = Push()
    with TaskEnvironment(task, ENGINES[0]) as env:
        env.reset(seed=0)
        episodes: Any = env.episodes
        world = episodes.world
        q = np.array(START)
        q[4:] += 0.15, -0.2, 0.25
        world.set_state(robots={ARM: (q, np.zeros_like(q))})
        angles = []
        for _ in range(30):
            R = task.kinematics.forward_kinematics(world.state.robots[ARM].q, TIP)[:3, :3]
            angles.append(
                np.arccos(np.clip(0.5 * (np.trace(R @ np.diag([1.0, -1.0, -1.0])) - 1.0), -1.0, 1.0))
            )
            env.step(np.array(action, dtype=np.float32))
    assert angles[0] > 0.2
    assert angles[-1] < 0.1 * angles[0]


def test_wrong_options_are_refused() -> None:
    with pytest.raises(ArgumentError, match="did you mean 'sparse'"):
        Push(reward_kind="sparce")
    with pytest.raises(ArgumentError, match="max_speed is '-1'"):
        Walk(max_speed=-1)
    with pytest.raises(ArgumentError, match="did you mean 'mujoco'"):
        TaskEnvironment(Stand(), "mujocco")
    with TaskEnvironment(Push(), ENGINES[0]) as env:
        with pytest.raises(ArgumentError, match="goal is"):
            env.reset(options={"goal": (3.0, 0.0)})
        with pytest.raises(ArgumentError, match="where the fingers are"):
            env.reset(options={"cube": (0.35, 0.0)})
        with pytest.raises(UnknownNameError, match="'goal'"):
            env.reset(options={"gaol": (0.5, 0.0)})
    with TaskEnvironment(Walk(), ENGINES[0]) as env:
        with pytest.raises(ArgumentError, match="three numbers"):
            env.reset(options={"velocity": (1.0, np.nan, 0.0)})
        with pytest.raises(ArgumentError, match="disturbance is 'big'; wanted a number from 0 to 5"):
            env.reset(options={"disturbance": "big"})
    with pytest.raises(ArgumentError, match="disturbance is '-1'; wanted a number from 0 to 5"):
        Stand(disturbance=-1)


def test_a_task_is_a_world_task() -> None:
    assert all(isinstance(task, WorldTask) for task in TASKS)
    assert set(Push.engines()) >= set(ENGINES)


def test_a_part_of_a_task_that_is_no_method_is_named() -> None:
    class Wrong(WorldTask):
        scene = property(lambda self: None)

    with pytest.raises(ArgumentError, match="scene of Wrong is a property; wanted a method"):
        register_task("test/Wrong-v0", Wrong)


def test_an_episode_with_a_scene_of_its_own_is_that_of_its_seed(engine: str) -> None:
    env, again = TaskEnvironment(Hail(), engine), TaskEnvironment(Hail(), engine)
    actions = np.random.default_rng(1).uniform(-1.0, 1.0, (10, 3)).astype(np.float32)
    try:
        seen: dict[int, list[Any]] = {}
        for seed in (0, 1, 2, 0):
            found = [env.reset(seed=seed)[0], *(env.step(each)[0] for each in actions)]
            if seed in seen:
                np.testing.assert_array_equal(seen[seed], found)
            seen[seed] = found
        np.testing.assert_array_equal(
            seen[2], [again.reset(seed=2)[0], *(again.step(each)[0] for each in actions)]
        )
        assert len({each[0][3] for each in seen.values()}) > 1, "the seeds draw different numbers of stones"
    finally:
        env.close()
        again.close()


class Noisy(Stand):
    """A robot that sees its acceleration by a sensor with noise, and by one without."""

    def scene(self) -> Any:
        errors = SensorErrors(noise=1.0, random_walk=1.0)
        scene = super().scene()
        (robot,) = scene.robots
        exact = Imu("exact", f"{robot.name}/{robot.model.root}")
        return replace(scene, sensors=(exact, replace(exact, name="noisy", accelerometer=errors)))

    def info(self, episode: Any) -> dict[str, Any]:
        return {name: each.values for name, each in episode.world.read_sensors().items()}


def test_the_noise_of_sensors_differs_between_episodes_and_follows_the_seed() -> None:
    with TaskEnvironment(Noisy(), "mujoco") as env:
        still = np.zeros(env.action_space.shape or (), dtype=np.float32)

        def errors(seed: int | None) -> Any:
            env.reset(seed=seed)
            found = [env.step(still)[-1] for _ in range(3)]
            return np.array([each["noisy"] - each["exact"] for each in found])[:, :3]

        first, second = errors(3), errors(None)
        assert np.abs(first).min() > 1e-6 < np.abs(first - second).min()
        np.testing.assert_array_equal(errors(3), first)
        np.testing.assert_array_equal(errors(None), second)
