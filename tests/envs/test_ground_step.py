"""Vectors of environments with contacts: against single ones, worlds, and themselves in other partitions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from dynx.envs.environment import TaskEnvironment
from dynx.envs.ground_step import SWEEPS
from dynx.envs.ground_task import GroundTask
from dynx.envs.runner import GroundEpisodes, WorldEpisodes
from dynx.envs.task import State
from dynx.envs.tasks.stand import Stand
from dynx.envs.tasks.walk import Walk
from dynx.envs.vector import RobotVectorEnvironment
from dynx.errors import ArgumentError, UnknownNameError, UnsupportedFeatureError
from dynx.spatial.scalar import Floats

DRAWN = {
    "mass_scale": {"trunk": (0.8, 1.2), "FR_calf": (0.9, 1.1)},
    "payload": {"frame": "trunk", "mass": (0.0, 2.0), "center": (0.1, 0.0, 0.1)},
    "friction_scale": {"ground": (0.5, 1.2), "FR_foot": (0.5, 1.0)},
    "joint_damping": (0.0, 0.05),
    "joint_friction": {"FR_calf_joint": (0.0, 0.2)},
    "gain_scale": (0.8, 1.2),
    "motor_strength": (0.7, 1.1),
    "gravity_scale": (0.9, 1.1),
    "pushes": {"speed": (0.5, 1.0), "interval": 0.2, "duration": 0.06},
    "delay": (0.0, 0.08),
    "observation_noise": 0.01,
    "action_noise": 0.02,
}


def actions_of(steps: int, count: int, size: float = 1.0) -> Any:
    return np.random.default_rng(1).uniform(-size, size, (steps, count, 12)).astype(np.float32)


@contextmanager
def vector(task: GroundTask, count: int, **options: Any) -> Iterator[RobotVectorEnvironment]:
    made = RobotVectorEnvironment(task, count, **options)
    try:
        yield made
    finally:
        made.close()


@pytest.mark.parametrize(
    ("task", "randomize"),
    [
        (Walk(contacts="feet"), None),
        (Stand(contacts="feet"), None),
        (Walk(contacts="feet"), DRAWN),
        (
            Stand(contacts="feet", foot_forces=True),
            {"pushes": DRAWN["pushes"], "delay": (0.0, 0.08), "observation_noise": 0.01},
        ),
    ],
    ids=["Walk", "Stand", "drawn", "pushed, delayed, with forces"],
)
def test_each_lane_is_the_single_environment(task: GroundTask, randomize: Mapping[str, Any] | None) -> None:
    """Bit for bit, with episodes that end and start anew by a mask."""
    count, actions = 11, actions_of(45, 11)
    seen: list[list[Any]] = [[] for _ in range(count)]
    with vector(task, count, randomize=randomize, autoreset_mode="Disabled", max_episode_steps=30) as envs:
        observations, info = envs.reset(seed=4)
        for k in range(count):
            seen[k].append((observations[k], {name: x[k] for name, x in info.get("parameters", {}).items()}))
        for each in actions:
            observations, rewards, terminated, truncated, _ = envs.step(each)
            for k in range(count):
                seen[k].append((observations[k], rewards[k], terminated[k]))
            ended = terminated | truncated
            if ended.any():
                observations, info = envs.reset(options={"reset_mask": ended})
                for k in np.flatnonzero(ended).tolist():
                    drawn = {name: x[k] for name, x in info.get("parameters", {}).items()}
                    seen[k].append((observations[k], drawn))
    for k in (0, 7, 10):
        with TaskEnvironment(task, "dynx", randomize=randomize) as env:
            assert isinstance(env.episodes, GroundEpisodes)
            found: list[Any] = []
            observation, info = env.reset(seed=4 + k)
            found.append((observation, info.get("parameters", {})))
            count_steps = 0
            for each in actions:
                observation, reward, terminated, _, _ = env.step(each[k])
                found.append((observation, reward, terminated))
                count_steps += 1
                if terminated or count_steps == 30:
                    observation, info = env.reset()
                    found.append((observation, info.get("parameters", {})))
                    count_steps = 0
        assert len(found) == len(seen[k]) > len(actions) + 1
        for mine, wanted in zip(found, seen[k], strict=True):
            assert np.array_equal(mine[0], wanted[0])
            assert mine[1:] == wanted[1:]


@pytest.mark.parametrize(
    ("task", "options"),
    [
        (Walk(contacts="feet"), {"velocity": (0.5, 0.0, -0.1), "disturbance": 0.1}),
        (Stand(contacts="feet"), {"disturbance": 0.5}),
    ],
    ids=["Walk", "Stand"],
)
def test_a_reset_with_options_is_that_of_a_lane(task: GroundTask, options: dict[str, Any]) -> None:
    actions = actions_of(5, 3)
    with vector(task, 3) as envs, TaskEnvironment(task, "dynx") as env:
        assert isinstance(env.episodes, GroundEpisodes)
        for name in ("options", "velocty"):
            for each in (env, envs):
                with pytest.raises(UnknownNameError, match=f"{type(task).__name__} has no option '{name}'"):
                    each.reset(seed=4, options={name: {}})
        many = [envs.reset(seed=4, options=options)[0], *(envs.step(each)[0] for each in actions)]
        one = [env.reset(seed=6, options=options)[0], *(env.step(each[2])[0] for each in actions)]
    assert np.array_equal([each[2] for each in many], one)


def test_states_need_unit_quaternions() -> None:
    with vector(Walk(contacts="feet"), 9) as envs, vector(Walk(contacts="feet"), 9) as others:
        for each in (envs, others):
            each.reset(seed=0)
        before = envs.states
        for factor in (2.0, 0.0, 1.0 + 1e-5):
            wrong = before.copy()
            wrong[4, 3:7] *= factor
            with pytest.raises(ArgumentError, match=r"states\[4, 3:7\] is a quaternion .* of length"):
                envs.set_states(wrong)
            assert np.array_equal(envs.states, before)
        rounded = before.copy()
        rounded[4, 3:7] *= 1.0 + 1e-9
        envs.set_states(rounded)
        others.set_states(before)
        assert np.linalg.norm(envs.states[:, 3:7], axis=1) == pytest.approx(1.0, abs=1e-15)
        (given,) = actions_of(1, 9)
        rest = np.arange(9) != 4
        found, wanted = envs.step(given)[0], others.step(given)[0]
        assert np.array_equal(found[rest], wanted[rest])
        np.testing.assert_allclose(found[4], wanted[4], rtol=0.0, atol=1e-5)


def states_after(count: int, threads: int, rows: slice = slice(None)) -> Floats:
    """Return the states of 600 environments, or of some of them alone, after a few steps."""
    task = Walk(contacts="feet")
    with vector(task, count, threads=threads) as envs:
        envs.reset(seed=[*range(600)][rows])
        for each in actions_of(6, 600):
            envs.step(each[rows])
        return envs.states


def test_states_depend_neither_on_threads_nor_on_the_partition() -> None:
    whole = states_after(600, 1)
    assert np.array_equal(whole, states_after(600, 3))
    for rows in (slice(0, 1), slice(17, 30), slice(250, 600)):
        assert np.array_equal(whole[rows], states_after(len(whole[rows]), 2, rows))


class Fine(Walk):
    """Walk in steps of the robot of 0.1 ms."""

    substeps = 200


def test_the_kernel_moves_as_the_world_does_in_small_steps() -> None:
    """Both have the same laws in the limit: motors, impacts, friction. Later impacts amplify differences."""
    task = Fine(contacts="feet")
    observed: list[Floats] = []
    for in_world in (False, True):
        with TaskEnvironment(task, "dynx") as env:
            if in_world:
                env.episodes.close()
                env._episodes = WorldEpisodes(task, "dynx")
            env.reset(seed=3)
            observed.append(np.array([env.step(each[0])[0] for each in actions_of(3, 1, 0.5)]))
    np.testing.assert_allclose(observed[0], observed[1], rtol=0.0, atol=2e-3)


@pytest.mark.parametrize("kind", [Walk, Fine])
def test_motors_of_kernels_and_worlds_have_one_law(kind: type[Walk]) -> None:
    """In free flight, where no sweeps end at a tolerance; pushes have one law too."""
    task = kind(contacts="feet")
    found: list[list[Floats]] = [[], []]
    drawn = {"pushes": {"speed": 1.0, "interval": 0.02, "duration": 0.02}}
    with (
        TaskEnvironment(task, "dynx", randomize=drawn) as env,
        TaskEnvironment(task, "dynx", randomize=drawn) as other,
    ):
        other.episodes.close()
        other._episodes = in_world = WorldEpisodes(task, "dynx")
        in_kernel = env.episodes
        assert isinstance(in_kernel, GroundEpisodes)
        (name,) = in_world.world.state.robots
        for seed, action in enumerate(actions_of(3, 1)[:, 0]):
            env.reset(seed=seed)
            other.reset(seed=seed)
            q, v, memory = in_kernel.state
            q[2] += 1.0
            in_kernel.state = State(q, v, memory)
            in_world.world.set_state(robots={name: (q, v)})
            env.step(action)
            other.step(action)
            found[0].append(in_kernel.state.v)
            found[1].append(in_world.world.state.robots[name].v)
    np.testing.assert_allclose(found[0], found[1], rtol=0.0, atol=1e-8)


def test_joints_stop_at_their_limits() -> None:
    """A lane in which a joint reaches a stop is stepped with stops, and ends within them."""
    with (
        vector(Walk(contacts="feet"), 9) as envs,
        vector(Walk(contacts="feet"), 9, joint_limits=False) as free,
    ):
        lower, upper = envs.task.model.lower[7:], envs.task.model.upper[7:]
        for each in (envs, free):
            each.reset(seed=0)
            states = each.states
            states[4, 7:19], states[4, 25:37] = upper - 0.01, 20.0
            each.set_states(states)
        (given,) = actions_of(1, 9)
        wanted = free.step(given)[0]
        found = envs.step(given)[0]
        q = envs.states[4, 7:19]
    rest = np.arange(9) != 4
    assert not np.array_equal(found[4], wanted[4])
    assert ((lower <= q) & (q <= upper)).all()
    assert np.array_equal(found[rest], wanted[rest])


def test_residuals_are_those_of_the_sweeps() -> None:
    with vector(Walk(contacts="feet"), 200) as envs:
        envs.reset(seed=0)
        found = []
        for each in actions_of(20, 200):
            envs.step(each)
            found.append(envs.contact_residuals)
    largest = np.max(found, axis=0)
    assert largest.shape == (200,)
    assert 0.0 < np.median(largest) <= SWEEPS.tolerance
    assert largest.max() <= 100.0 * SWEEPS.tolerance


def test_an_action_that_is_not_finite_is_named_and_changes_nothing() -> None:
    with vector(Walk(contacts="feet"), 9) as envs, vector(Walk(contacts="feet"), 9) as others:
        for each in (envs, others):
            each.reset(seed=0)
        first, second = actions_of(2, 9)
        wrong = first.copy()
        wrong[5, 3] = np.nan
        with pytest.raises(ArgumentError, match=r"environment 5: action\[3\] is nan"):
            envs.step(wrong)
        for each in (first, second):
            for mine, wanted in zip(envs.step(each)[:4], others.step(each)[:4], strict=True):
                assert np.array_equal(mine, wanted)


def test_a_state_that_diverges_is_named_and_the_others_go_on() -> None:
    with vector(Walk(contacts="feet"), 9) as envs, vector(Walk(contacts="feet"), 9) as others:
        for each in (envs, others):
            each.reset(seed=0)
        states = envs.states
        states[4, 19 + 7] = 1e9
        envs.set_states(states)
        (given,) = actions_of(1, 9)
        observations, rewards, _, truncated, info = envs.step(given)
        wanted, good, *_ = others.step(given)
        rest = np.arange(9) != 4
        assert truncated.tolist() == [k == 4 for k in range(9)]
        assert rewards[4] == 0.0
        assert "beyond" in info["diverged"][4]
        assert np.array_equal(observations[rest], wanted[rest])
        assert np.array_equal(rewards[rest], good[rest])


class Remembering(Walk):
    """A walk with a method that a kernel does not call."""

    def info(self, episode: Any) -> dict[str, Any]:
        return {"time": episode.world.time}


def test_what_kernels_do_not_have_is_refused_by_name() -> None:
    refused: list[tuple[GroundTask, dict[str, Any], str]] = [
        (Walk(), {}, "at most 16.*contacts='feet'.*vectorization_mode='sync' or 'async'"),
        (Remembering(contacts="feet"), {}, "Remembering has a method info of its own"),
        (
            Walk(contacts="feet"),
            {"randomize": {"joint_friction": {"FR_hip_joint": 0.5}}, "joint_limits": False},
            "without limits or friction",
        ),
    ]
    for task, options, message in refused:
        with pytest.raises(UnsupportedFeatureError, match=message):
            RobotVectorEnvironment(task, 2, **options)
    with TaskEnvironment(Remembering(contacts="feet"), "dynx") as env:
        assert isinstance(env.episodes, WorldEpisodes)
        env.reset(seed=0)
        assert env.step(np.zeros(12))[-1]["time"] == pytest.approx(0.02)
    with pytest.raises(ArgumentError, match="known: all, feet"):
        Walk(contacts="foot")


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_an_action_acts_after_the_drawn_delay(mode: str) -> None:
    """The observation has the action that acted: the one that many steps before, or the first of the
    episode."""
    count, limit = 9, 7
    actions, task = actions_of(20, count), Walk(contacts="feet")
    with vector(
        task, count, randomize={"delay": (0.0, 0.1)}, autoreset_mode=mode, max_episode_steps=limit
    ) as envs:
        _, infos = envs.reset(seed=0)
        delays = np.rint(infos["parameters"]["delay"] / task.control_dt).astype(int)
        assert set(delays.tolist()) >= {0, 1, 4}
        steps, begun = np.zeros(count, dtype=int), np.zeros(count, dtype=int)
        for k, each in enumerate(actions):
            observations, _, terminated, truncated, infos = envs.step(each)
            fresh = infos.get("_parameters", np.zeros(count, dtype=bool))
            steps += 1
            if mode == "NextStep":
                steps[fresh], begun[fresh] = 0, k + 1
            acted = np.maximum(k - delays, begun)
            for row in np.flatnonzero((steps > 0) & ~fresh):
                assert np.array_equal(observations[row, 33:45], actions[acted[row], row])
            if mode == "SameStep":
                assert np.array_equal(fresh, terminated | truncated)
                begun[fresh] = k + 1
            if fresh.any():
                drawn = infos["parameters"]["delay"]
                delays[fresh] = np.rint(drawn / task.control_dt).astype(int)[fresh]
    assert (begun > limit).any()


def test_delays_of_kernels_and_worlds_have_one_law() -> None:
    actions, drawn = actions_of(6, 1)[:, 0], {"delay": 0.04}
    found: list[list[Floats]] = []
    for contacts, engine in (("feet", "dynx"), ("all", "dynx"), ("feet", "mujoco")):
        with TaskEnvironment(Walk(contacts=contacts), engine, randomize=drawn) as env:
            assert isinstance(
                env.episodes, GroundEpisodes if contacts + engine == "feetdynx" else WorldEpisodes
            )
            assert env.reset(seed=0)[1]["parameters"] == drawn
            found.append([env.step(each)[0][33:45] for each in actions])
    for each in found:
        assert np.array_equal(each, actions[[0, 0, 0, 1, 2, 3]])


def test_an_invalid_action_is_refused_before_it_waits() -> None:
    with (
        vector(Walk(contacts="feet"), 9, randomize={"delay": 0.04}) as envs,
        vector(Walk(contacts="feet"), 9, randomize={"delay": 0.04}) as others,
    ):
        for each in (envs, others):
            each.reset(seed=0)
        for given in actions_of(5, 9):
            for wrong in (np.nan, 1.5):
                invalid = given.copy()
                invalid[5, 3] = wrong
                with pytest.raises(ArgumentError, match=r"environment 5: action\[3\] is"):
                    envs.step(invalid)
            for mine, wanted in zip(envs.step(given)[:4], others.step(given)[:4], strict=True):
                assert np.array_equal(mine, wanted)


def test_pictures_show_the_scene() -> None:
    with TaskEnvironment(Walk(contacts="feet"), "dynx", "rgb_array", width=64, height=48) as env:
        env.reset(seed=0)
        picture = env.render()
    with TaskEnvironment(Walk(contacts="feet"), "mujoco", "rgb_array", width=64, height=48) as env:
        env.reset(seed=0)
        other = env.render()
    assert picture is not None
    assert other is not None
    assert np.mean(picture != other) < 0.02


def test_worlds_draw_motors_and_gravity_too() -> None:
    """A motor with half of its strength reaches half of its torque, and gravity is that which was drawn."""
    randomize = {"gain_scale": 0.8, "motor_strength": 0.5, "gravity_scale": (0.9, 1.1)}
    with TaskEnvironment(Stand(contacts="feet"), "mujoco", randomize=randomize) as env:
        _, info = env.reset(seed=0)
        episodes: Any = env.episodes
        env.step(np.ones(12, dtype=np.float32))
        (motor,) = episodes._varied.loads(Stand().loads(episodes.episode, np.zeros(12)), episodes._values)[
            "motors"
        ]["dog"]
        assert (motor.kp, motor.kd, motor.max_force) == pytest.approx((60.0 * 0.4, 2.0 * 0.4, 33.5 * 0.5))
        gravity = episodes.world.scene.gravity[2]
    assert gravity == pytest.approx(-9.81 * info["parameters"]["gravity_scale"], rel=1e-3)
