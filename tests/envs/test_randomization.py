"""Parameters per environment: draws that depend on nothing else, and steps of a robot that has them."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from hypothesis import given, settings
from hypothesis import strategies as st

from dynx.backends import installed_backends
from dynx.backends.registry import backend
from dynx.envs import Randomization
from dynx.envs.environment import TaskEnvironment
from dynx.envs.randomization import Draws, Pushes, parameters_of, read_distribution
from dynx.envs.runner import WorldEpisodes
from dynx.envs.task import State
from dynx.envs.tasks.cart_pole import CartPole
from dynx.envs.tasks.pendulum import Pendulum
from dynx.envs.tasks.push import Push
from dynx.envs.tasks.reach import Reach
from dynx.envs.tasks.stand import Stand
from dynx.envs.variation import VariedRobot
from dynx.envs.vector import RobotVectorEnvironment
from dynx.errors import ArgumentError, UnknownNameError, UnsupportedFeatureError
from dynx.rbd.parameters import Parameters
from dynx.steppers.random import Streams
from dynx.steppers.registry import world_names

CART_POLE: dict[str, Any] = {
    "mass_scale": {"pole": (0.5, 2.0), "cart": {"log_uniform": (0.5, 2.0)}},
    "joint_damping": {"slide": (0.0, 0.5)},
    "joint_friction": (0.0, 0.2),
    "delay": (0.0, 0.05),
    "observation_noise": {0: 0.01, 2: (0.0, 0.002)},
}
REACH: dict[str, Any] = {
    "mass_scale": (0.7, 1.4),
    "payload": {"frame": "tip", "mass": (0.1, 0.5), "center": (0.0, (-0.05, 0.05), 0.1)},
    "joint_damping": {"normal": (0.3, 0.05)},
    "joint_friction": {"elbow": (0.1, 0.2)},
    "delay": (0.005, 0.05),
    "action_noise": 0.2,
}


PANDA: dict[str, Any] = {
    "mass_scale": {"panda_link7": (0.5, 2.0), "panda_leftfinger": 2.0},
    "payload": {"frame": "panda_hand_tcp", "mass": (0.0, 2.0)},
    "joint_damping": (0.0, 1.0),
}


def test_vectors_of_any_size_and_single_environments_draw_the_same() -> None:
    def drawn(seed: int, n: int) -> Any:
        envs = RobotVectorEnvironment(CartPole(), n, randomize=CART_POLE)
        _, infos = envs.reset(seed=seed)
        assert infos["_parameters"].all()
        return infos["parameters"]

    whole = drawn(11, 7)
    for part, first in ((drawn(11, 3), 0), (drawn(14, 4), 3)):
        for name, values in part.items():
            assert np.array_equal(values, whole[name][first : first + len(values)])
    singles: Any = gymnasium.make_vec(
        "dynx/CartPole-v0", num_envs=7, vectorization_mode="sync", engine="reference", randomize=CART_POLE
    )
    _, infos = singles.reset(seed=11)
    for name, values in whole.items():
        assert np.array_equal(infos["parameters"][name], values)
        assert name == "observation_noise.0" or len(np.unique(values)) > 1
    singles.close()


@pytest.mark.parametrize("mode", list(AutoresetMode), ids=str)
def test_each_episode_draws_anew_as_in_a_single_environment(mode: AutoresetMode) -> None:
    n = 4
    envs = RobotVectorEnvironment(
        CartPole(), n, autoreset_mode=mode, randomize=CART_POLE, max_episode_steps=12
    )
    _, infos = envs.reset(seed=5)
    episodes = [[{name: values[k] for name, values in infos["parameters"].items()}] for k in range(n)]
    for step in range(260):
        *_, terminated, truncated, infos = envs.step(np.full(n, step // 3 % 2))
        if mode is AutoresetMode.DISABLED and (terminated | truncated).any():
            _, infos = envs.reset(options={"reset_mask": terminated | truncated})
        if infos:
            for k in np.flatnonzero(infos["_parameters"]):
                episodes[k].append({name: values[k] for name, values in infos["parameters"].items()})
    with TaskEnvironment(CartPole(), "reference", randomize=CART_POLE) as env:
        for number, rows in enumerate(episodes):
            assert len(rows) > 16
            for episode, row in enumerate(rows):
                _, info = env.reset(seed=None if episode else 5 + number)
                assert info["parameters"] == row


@pytest.mark.parametrize(
    ("task", "drawn"),
    [
        (CartPole(), CART_POLE),
        (Reach(robot="planar_3r"), REACH),
        (Reach(robot="panda", actions="velocity"), PANDA),
    ],
    ids=["CartPole", "Reach", "Panda"],
)
def test_the_kernel_takes_the_steps_of_every_engine(task: Any, drawn: Any) -> None:
    n, steps, model = 3, 7, task.model
    envs = RobotVectorEnvironment(task, n, randomize=drawn)
    envs.reset(seed=2)
    starts = envs.states
    rng = np.random.default_rng(0)
    discrete = isinstance(task, CartPole)
    actions: Any = (
        rng.integers(0, 2, (steps, n)) if discrete else rng.uniform(-1.0, 1.0, (steps, n, model.nv))
    )
    found = [envs.step(each) for each in actions]
    for engine in installed_backends():
        with TaskEnvironment(task, engine, randomize=drawn) as env:
            for k in range(n):
                env.reset(seed=2 + k)
                episodes: Any = env.episodes
                episodes.state = State(*np.split(starts[k], [model.nq, model.nq + model.nv]))
                for action, (observations, rewards, terminated, _, _) in zip(actions, found, strict=True):
                    observation, reward, ended, _, _ = env.step(action[k])
                    assert observation == pytest.approx(observations[k], abs=1e-6)
                    assert reward == pytest.approx(rewards[k], abs=1e-9)
                    assert ended == terminated[k]
                end = np.concatenate(episodes.state)
                assert end == pytest.approx(envs.states[k], abs=1e-9)
                assert engine != "compiled" or np.array_equal(end, envs.states[k])
    assert np.abs(envs.states - starts).max() > 1e-3


@given(pole=st.floats(0.2, 5.0), cart=st.floats(0.2, 5.0))
@settings(max_examples=8, deadline=None)
def test_scaled_masses_are_those_of_a_task_with_these_masses(pole: float, cart: float) -> None:
    scaled = RobotVectorEnvironment(CartPole(), 1, randomize={"mass_scale": {"pole": pole, "cart": cart}})
    scaled.reset(seed=0)
    robot: Any = TaskEnvironment(CartPole(pole_mass=0.1 * pole, cart_mass=cart), "reference")
    robot.reset(seed=0)
    robot.episodes.state = State(*np.split(scaled.states[0], [2]))
    for k in range(6):
        scaled.step(np.array([k % 2]))
        robot.step(k % 2)
    assert scaled.states[0] == pytest.approx(np.concatenate(robot.episodes.state), abs=1e-12)


@pytest.mark.parametrize("engine", ["compiled", "reference"])
def test_joint_friction_opposes_the_motion(engine: str) -> None:
    task, inertia = Pendulum(), 1.0 / 3.0
    velocities = []
    for drawn in ({"delay": 0.0}, {"joint_damping": 0.2}, {"joint_friction": 0.3}, {"joint_friction": 1e3}):
        with TaskEnvironment(task, engine, randomize=drawn) as env:
            env.reset(seed=0)
            episodes: Any = env.episodes
            episodes.state = State(np.array([0.0]), np.array([2.0]))
            env.step(np.zeros(1, dtype=np.float32))
            velocities.append(float(episodes.state.v[0]))
    free, damped, rubbed, stopped = velocities
    # Damping acts on the velocity at the end of the step.
    assert damped == pytest.approx(free / (1.0 + 0.05 * 0.2 / inertia), rel=1e-9)
    assert free - rubbed == pytest.approx(0.05 * 0.3 / inertia, rel=1e-9)
    assert stopped == 0.0


def test_a_delay_shifts_actions() -> None:
    task = Reach(robot="planar_3r")
    robot = VariedRobot(task, Randomization(delay=(0.0, 0.028)))
    assert task.step_dt == 0.004
    assert robot.delayed_actions == 2
    now, before, first = (np.full(3, x) for x in (2.0, 1.0, 0.0))
    for steps, expected in (
        (0, [2.0] * 5),
        (1, [1.0, 2.0, 2.0, 2.0, 2.0]),
        (5, [1.0] * 5),
        (7, [0.0, 0.0, 1.0, 1.0, 1.0]),
    ):
        acting = robot.acting_actions(np.array([steps * 0.004]), now, [before, first])
        assert [each[0] for each in acting] == expected


def test_a_delayed_episode_is_one_with_earlier_actions() -> None:
    def states(delay: float, actions: list[int]) -> Any:
        envs = RobotVectorEnvironment(CartPole(), 1, randomize={"delay": delay})
        envs.reset(seed=1)
        found = []
        for action in actions:
            envs.step(np.array([action]))
            found.append(envs.states)
        return found

    actions = [0, 1, 1, 0, 1, 0, 0]
    assert np.array_equal(states(0.04, actions), states(0.0, [0, 0, *actions[:-2]]))
    assert not np.array_equal(states(0.04, actions), states(0.0, actions))


def test_noise_has_its_deviation_and_leaves_the_state() -> None:
    n = 4000
    envs = RobotVectorEnvironment(
        Pendulum(), n, randomize={"observation_noise": {2: 0.1}, "action_noise": 0.3}
    )
    observations, _ = envs.reset(seed=0)
    state = envs.states
    noise = observations[:, 2] - state[:, 1]
    assert np.abs(observations[:, 0] - np.cos(state[:, 0])).max() < 1e-6
    assert noise.std() == pytest.approx(0.1, rel=6.0 / np.sqrt(2.0 * n))
    envs.set_states(np.zeros((n, 2)))
    observations, *_ = envs.step(np.zeros((n, 1), dtype=np.float32))
    # From rest at the top, the velocity after a step is the torque over the inertia.
    acted = envs.states[:, 1] / 0.05 / 3.0 / 2.0
    assert acted.std() == pytest.approx(0.3, rel=0.05)
    assert np.abs(acted).max() <= 1.0 + 1e-12
    assert np.abs(np.corrcoef(noise, observations[:, 2] - envs.states[:, 1])[0, 1]) < 6.0 / np.sqrt(n)
    with pytest.raises(ArgumentError, match="environment 0: action"):
        envs.step(np.full((n, 1), 1.5))


def test_noise_differs_from_step_to_step() -> None:
    envs = RobotVectorEnvironment(Pendulum(), 50, randomize={"observation_noise": {2: 0.1}})
    noises = [envs.reset(seed=0)[0][:, 2] - envs.states[:, 1]]
    rest = np.zeros((50, 1), dtype=np.float32)
    noises += [envs.step(rest)[0][:, 2] - envs.states[:, 1] for _ in range(3)]
    # Two of 200 independent numbers of float32 are the same with a probability of about 1e-3.
    assert np.unique(np.concatenate(noises).round(6)).size > 190


def test_worlds_have_the_drawn_parameters() -> None:
    drawn = {
        "mass_scale": {"cube": (0.5, 2.0), "panda_link7": 1.5},
        "payload": {"frame": "panda_hand_tcp", "mass": 0.4},
        "friction_scale": (0.5, 1.5),
        "joint_damping": {"panda_joint1": 2.0},
    }
    task = Push()
    with TaskEnvironment(task, "pybullet", randomize=drawn) as env:
        _, info = env.reset(seed=4)
        episodes: Any = env.episodes
        scene, nominal, values = episodes.world.scene, task.scene(), info["parameters"]
        arm, own = scene.robot("arm"), nominal.robot("arm")
        assert scene.body("cube").mass == values["mass_scale.cube"] * nominal.body("cube").mass
        assert (
            scene.material("table").friction == values["friction_scale"] * nominal.material("table").friction
        )
        gained = 0.5 * own.model.inertial("panda_link7").mass + values["payload.mass"]
        assert arm.model.total_mass == pytest.approx(own.model.total_mass + gained, rel=1e-12)
        assert arm.model.joint("panda_joint1").dynamics.damping == 2.0
        first, _ = env.reset(seed=4)
        assert np.array_equal(env.reset(seed=4)[0], first)
        env.reset()
        assert episodes.world.scene.body("cube").mass != scene.body("cube").mass


def test_a_delay_of_a_world_shifts_actions() -> None:
    def returned(delay: float, actions: list[Any]) -> list[float]:
        env = TaskEnvironment(Stand(), "pybullet", randomize={"delay": delay})
        env.reset(seed=0)
        rewards = [env.step(action)[1] for action in actions]
        env.close()
        return rewards

    actions = list(np.random.default_rng(0).uniform(-1.0, 1.0, (6, 12)).astype(np.float32))
    assert returned(0.04, actions) != returned(0.0, actions)
    assert returned(0.04, actions)[0] == returned(0.0, actions)[0]
    with TaskEnvironment(Stand(), "pybullet", randomize={"delay": 0.04}) as env:
        env.reset(seed=0)
        episodes: Any = env.episodes
        for action in actions:
            env.step(action)
        assert np.array_equal(episodes.episode.memory.numbers[:12], actions[-3].astype(np.float64))


@pytest.mark.parametrize(
    ("drawn", "error", "message"),
    [
        ({"mass": (0.5, 2.0)}, UnknownNameError, "did you mean 'mass_scale'"),
        ({"mass_scale": {"pol": 1.0}}, UnknownNameError, "did you mean 'pole'"),
        ({"joint_damping": {"slid": 1.0}}, UnknownNameError, "did you mean 'slide'"),
        ({"mass_scale": (2.0, 0.5)}, ArgumentError, "a lower bound above the upper one"),
        ({"mass_scale": (0.0, 1.0)}, ArgumentError, "reaches 0; wanted numbers above 0"),
        ({"delay": {"normal": (0.01, 0.01)}}, ArgumentError, "reaches -0.02"),
        ({"delay": {"uniforme": (0.0, 0.1), "b": 1}}, ArgumentError, "wanted one of uniform"),
        ({"delay": "long"}, ArgumentError, "wanted a number, .low, high."),
        (
            {"observation_noise": {4: 0.1}},
            ArgumentError,
            "entry 4; wanted the number of an entry from 0 to 3",
        ),
        ({"action_noise": 0.1}, UnsupportedFeatureError, "action_noise needs a Box"),
        ({"friction_scale": 0.5}, UnsupportedFeatureError, "joint_friction"),
        ({"pushes": {"speed": 1.0, "interval": 5.0}}, UnsupportedFeatureError, "tasks in worlds have pushes"),
        ({"pushes": {"speed": 1.0}}, ArgumentError, "pushes has no interval"),
        ({"pushes": {"sped": 1.0, "interval": 5.0}}, UnknownNameError, "did you mean 'speed'"),
        ({"pushes": {"speed": (-1.0, 1.0), "interval": 5.0}}, ArgumentError, "reaches -1"),
        ({"pushes": {"speed": 1.0, "interval": 0.05}}, ArgumentError, "last 0.1 s; wanted at most"),
        ({"pushes": {"speed": 1.0, "interval": True}}, ArgumentError, "the interval of pushes is"),
        ({"pushes": 1.0}, ArgumentError, "wanted Mapping"),
        ({"payload": {"frame": "pole"}}, ArgumentError, "payload has no mass"),
        ({"payload": {"frame": "pile", "mass": 1.0}}, UnknownNameError, "did you mean 'pole'"),
        ({"payload": {"fram": "pole", "mass": 1.0}}, UnknownNameError, "did you mean 'frame'"),
        ({}, ArgumentError, "names no parameter"),
        ([("delay", 1.0)], ArgumentError, "wanted a dict"),
    ],
)
def test_wrong_randomizations_are_refused(drawn: Any, error: type[Exception], message: str) -> None:
    for make in (TaskEnvironment, RobotVectorEnvironment):
        with pytest.raises(error, match=message):
            make(CartPole(), randomize=drawn)


def test_parts_of_worlds_are_refused_by_name() -> None:
    for drawn, nearest in (
        ({"mass_scale": {"cub": 1.0}}, "cube"),
        ({"mass_scale": {"arm/panda_link77": 1.0}}, "arm/panda_link7"),
        ({"joint_friction": {"panda_joint11": 1.0}}, "panda_joint1"),
    ):
        with pytest.raises(UnknownNameError, match=f"did you mean '{nearest}'"):
            TaskEnvironment(Push(), "pybullet", randomize=drawn)


@given(
    seed=st.integers(0, 2**70),
    count=st.integers(1, 9),
    first=st.integers(0, 8),
    block=st.integers(0, 2**40),
    low=st.floats(0.1, 1.0),
    high=st.floats(1.0, 3.0),
)
@settings(max_examples=40, deadline=None)
def test_a_draw_depends_on_its_environment_alone(
    seed: int, count: int, first: int, block: int, low: float, high: float
) -> None:
    given_ranges = Randomization(mass_scale={"a": (low, high)}, delay={"log_uniform": (low, high)})
    alone = Randomization(delay={"log_uniform": (low, high)})
    draws, fewer = (Draws(parameters_of(each, ("mass_scale", "delay"))) for each in (given_ranges, alone))
    streams, part = (
        Streams(*range(seed, seed + first + count)),
        Streams(*range(seed + first, seed + first + count)),
    )
    for row in range(count):
        values = draws.values(streams, first + row, block)
        assert np.array_equal(values, draws.values(part, row, block))
        assert np.array_equal(values[:, 1:], fewer.values(streams, first + row, block))
        assert (values >= low * (1.0 - 1e-15)).all()
        assert (values <= high * (1.0 + 1e-15)).all()


def test_a_normal_distribution_is_clamped() -> None:
    found = read_distribution("delay", {"normal": (1.0, 0.1)})
    numbers = found.numbers(np.random.default_rng(0).standard_normal(20_000))
    assert found.bounds == pytest.approx((0.7, 1.3))
    assert numbers.min() >= 0.7 - 1e-12
    assert numbers.max() <= 1.3 + 1e-12
    assert numbers.std() == pytest.approx(0.1, rel=0.03)


PUSHES: dict[str, Any] = {"speed": (0.5, 1.0), "interval": 0.2, "duration": 0.06}


@given(
    seed=st.integers(0, 2**70),
    first=st.integers(0, 8),
    interval=st.integers(1, 40),
    share=st.floats(0.0, 1.0),
    deviation=st.booleans(),
)
@settings(max_examples=30, deadline=None)
def test_each_interval_has_one_push_that_depends_on_its_environment_alone(
    seed: int, first: int, interval: int, share: float, deviation: bool
) -> None:
    dt, duration = 0.02, max(1, round(share * interval))
    speed: Any = {"normal": (1.0, 0.1)} if deviation else (0.5, 1.0)
    given_pushes = {"speed": speed, "interval": interval * dt, "duration": duration * dt}
    count = first + 2
    streams, alone = Streams(*range(seed, seed + count)), Streams(seed + first)
    many, one = Pushes(given_pushes, dt, count), Pushes(given_pushes, dt, 1)
    rows, zero = np.arange(count), np.zeros(1, dtype=np.intp)
    episodes, found = np.arange(count) % 3, np.empty((3 * interval, count, 2))
    for step in range(3 * interval):
        # Each environment at a step of its own, and another environment's steps in any order.
        found[step] = many.at(streams, rows, episodes, np.full(count, step))
        assert np.array_equal(
            found[step, first], one.at(alone, zero, episodes[first : first + 1], np.array([step]))[0]
        )
    for each in found.reshape(3, interval, count, 2).swapaxes(1, 2).reshape(-1, interval, 2):
        acting = np.flatnonzero(each.any(axis=1))
        assert len(acting) == duration
        assert np.array_equal(acting, acting[0] + np.arange(duration))
        assert (each[acting] == each[acting[0]]).all()
        reached = np.linalg.norm(each.sum(axis=0)) * dt
        low, high = (0.7, 1.3) if deviation else (0.5, 1.0)
        assert low - 1e-12 <= reached <= high + 1e-12


def test_pushes_have_all_directions_and_begin_at_any_time() -> None:
    n, interval = 3000, 10
    streams, pushes = Streams(*range(n)), Pushes({"speed": 1.0, "interval": 0.2, "duration": 0.02}, 0.02, n)
    rows, episodes = np.arange(n), np.zeros(n, dtype=np.int64)
    found = 0.02 * np.array(
        [pushes.at(streams, rows, episodes, np.full(n, step)) for step in range(interval)]
    )
    assert np.abs(found.sum(axis=0).mean(axis=0)).max() < 6.0 / np.sqrt(2.0 * n)
    assert np.abs(found.any(axis=2).mean(axis=1) - 0.1).max() < 6.0 * np.sqrt(0.1 * 0.9 / n)


@pytest.mark.parametrize("engine", [*world_names(), "dynx in a world"])
def test_a_push_gives_a_free_robot_its_speed_on_every_engine(engine: str) -> None:
    """In free flight its centre of mass gets the horizontal velocity, whatever its mass."""
    task, drawn = Stand(contacts="feet"), {"pushes": PUSHES, "mass_scale": {"trunk": 1.5}}
    robot = Parameters(task.model, scaled=("trunk",)).model_of(np.array([1.5]))
    with TaskEnvironment(task, engine.partition(" ")[0], randomize=drawn) as env:
        if "world" in engine:
            env.episodes.close()
            env._episodes = WorldEpisodes(task, "dynx")
            env._episodes.vary(Randomization.read(drawn))
        env.reset(seed=0, options={"disturbance": 0.0})
        episodes: Any = env.episodes
        variation: Any = env._variation
        if isinstance(episodes, WorldEpisodes):
            q = episodes.world.state.robots["dog"].q.copy()
            q[2] += 5.0
            episodes.world.set_state(robots={"dog": (q, np.zeros(18))})
        else:
            q, v, memory = episodes.state
            q[2] += 5.0
            episodes.state = State(q, v, memory)
        wanted, found = [np.zeros(2)], [np.zeros(2)]
        with backend("compiled", robot) as dynamics:
            for _ in range(20):
                wanted.append(wanted[-1] + 0.02 * variation.accelerations()[0])
                env.step(np.zeros(12, dtype=np.float32))
                if isinstance(episodes, WorldEpisodes):
                    q, v = episodes.world.state.robots["dog"]
                else:
                    q, v, _ = episodes.state
                found.append(dynamics.centroidal_momentum(q, v)[:2] / robot.total_mass)
    assert np.linalg.norm(wanted[10]) > 0.5
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-12)
