"""What every environment does: checks of actions and of the order of calls, names, seeds, pictures."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

import dynx.envs  # noqa: F401  (registers the environments)
from benchmarks.environments.exactness import (
    PAIRS,
    VECTOR,
    Pair,
    Visited,
    largest_difference,
    parted_episodes,
    stepper,
    visited,
)
from dynx.backends import installed_backends
from dynx.envs.environment import TaskEnvironment, checked_action
from dynx.envs.task import State
from dynx.envs.tasks.cart_pole import CartPole
from dynx.errors import (
    ArgumentError,
    ClosedError,
    DTypeError,
    EpisodeError,
    NotFiniteError,
    ShapeError,
    UnknownNameError,
)

PAGE = Path(__file__).parents[2] / "docs" / "environments.md"


@pytest.fixture
def env() -> Iterator[TaskEnvironment]:
    with TaskEnvironment(CartPole(), "reference") as made:
        yield made


def test_ids_are_registered_with_time_limits() -> None:
    found = gymnasium.make("dynx/CartPole-v0", engine="reference", pole_mass=0.2)
    assert found.spec is not None
    assert found.spec.max_episode_steps == 500
    inner: Any = found.unwrapped
    assert inner.task.pole_mass == 0.2
    found.close()


def test_pictures_are_drawn_without_a_display() -> None:
    with TaskEnvironment(CartPole(), "reference", "rgb_array", width=128, height=96) as made:
        made.reset(seed=0)
        picture = made.render()
    assert picture is not None
    assert picture.shape == (96, 128, 3)
    # The cart is blue and the pole is yellow, as their file says.
    red, _, blue = np.moveaxis(picture.astype(int), -1, 0)
    assert ((blue > red + 80) & (red < 40)).sum() > 5
    assert (red > blue + 80).sum() > 5


def test_equal_seeds_give_equal_episodes(env: TaskEnvironment) -> None:
    def episode(seed: int) -> list[Any]:
        seen = [env.reset(seed=seed)[0].tolist()]
        seen.extend(env.step(k % 2)[0].tolist() for k in range(8))
        return [*seen, env.reset()[0].tolist()]

    assert episode(3) == episode(3)
    assert episode(3) != episode(4)


@pytest.mark.parametrize(
    ("action", "error"),
    [
        (2, ArgumentError),
        (-1, ArgumentError),
        (0.5, DTypeError),
        (np.nan, DTypeError),
        (None, DTypeError),
        ([0, 1], ShapeError),
        ("left", DTypeError),
    ],
)
def test_wrong_choices_are_refused_and_leave_the_state(
    env: TaskEnvironment, action: Any, error: type[Exception]
) -> None:
    env.reset(seed=0)
    episodes: Any = env.episodes
    before = episodes.state
    with pytest.raises(error, match="whole number"):
        env.step(action)
    assert episodes.state is before
    assert env.step(np.int64(1))[1] == 1.0


@pytest.mark.parametrize(
    ("action", "error", "message"),
    [
        ([0.0, np.nan], NotFiniteError, r"action\[1\] is nan; wanted numbers from -1 to 1"),
        ([0.0, 1.5], ArgumentError, r"action\[1\] is 1.5; wanted numbers from -1 to 1"),
        ([0.0], ShapeError, r"\(1,\); wanted \(2,\)"),
        (["a", "b"], DTypeError, "wanted numbers"),
    ],
)
def test_wrong_numbers_are_refused(action: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        checked_action(spaces.Box(-1.0, 1.0, (2,)), action)


def test_calls_out_of_order_are_refused(env: TaskEnvironment) -> None:
    with pytest.raises(EpisodeError, match="before the first reset"):
        env.step(0)
    env.reset(seed=0)
    while not env.step(0)[2]:
        pass
    with pytest.raises(EpisodeError, match="after the episode ended"):
        env.step(0)
    env.reset()
    env.step(0)
    with pytest.raises(ArgumentError, match="no render mode"):
        env.render()
    env.close()
    env.close()
    with pytest.raises(ClosedError):
        env.reset()


def test_unknown_names_offer_the_nearest() -> None:
    with pytest.raises(ArgumentError, match="did you mean 'pinocchio'"):
        TaskEnvironment(CartPole(), "pinochio")
    with pytest.raises(UnknownNameError, match="did you mean 'pole_mass'"):
        gymnasium.make("dynx/CartPole-v0", pole_mas=1.0)
    with pytest.raises(UnknownNameError, match="did you mean 'engine'"):
        gymnasium.make("dynx/CartPole-v0", enginee="mujoco")
    with pytest.raises(ArgumentError, match="did you mean 'human'"):
        TaskEnvironment(CartPole(), "reference", "hman")
    with TaskEnvironment(CartPole(), "reference") as made, pytest.raises(UnknownNameError, match="'low'"):
        made.reset(options={"lo": 0.0})


@pytest.mark.parametrize(
    ("task", "option", "message"),
    [
        ("CartPole", {"pole_mass": -1.0}, r"pole_mass is '-1.0'; wanted a number above 0 \[kg\]"),
        ("CartPole", {"half_length": "long"}, "half_length is 'long'; wanted a number above 0"),
        ("Pendulum", {"length": 0.0}, r"length is '0.0'; wanted a number above 0 \[m\]"),
        ("Pendulum", {"g": float("nan")}, "g is 'nan'; wanted a number of at least 0"),
        ("Acrobot", {"inertia": None}, "inertia is 'None'; wanted a number above 0"),
    ],
)
def test_options_that_no_robot_has_are_refused_by_name(
    task: str, option: dict[str, Any], message: str
) -> None:
    with pytest.raises(ArgumentError, match=message):
        gymnasium.make(f"dynx/{task}-v0", **option)


def test_options_of_the_start(env: TaskEnvironment) -> None:
    observation, _ = env.reset(seed=0, options={"low": 0.01, "high": 0.01})
    assert observation.tolist() == pytest.approx([0.01] * 4)


def test_code_of_the_page_runs() -> None:
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)
    names: dict[str, Any] = {"__name__": __name__}
    for block in blocks:
        exec(compile(block, str(PAGE), "exec"), names)
    made = names["env"]
    observation, _ = made.reset(seed=1)
    assert observation in made.observation_space
    again, reward, terminated, truncated, _ = made.step(made.action_space.sample())
    assert again in made.observation_space
    assert reward < 0.0
    assert (terminated, truncated) == (False, False)
    assert gymnasium.spec("mine/Point-v0").max_episode_steps == 200
    envs: Any = gymnasium.make_vec("mine/Point-v0", num_envs=4, reach=0.4)
    envs.reset(seed=1)
    actions = np.full((4, 2), 0.3)
    made.unwrapped.episodes.state = State(*np.split(envs.states[1], [2, 4]))
    _, rewards, *_ = envs.step(actions)
    assert rewards[1] == pytest.approx(made.step(actions[1])[1], rel=1e-9)


MAX_DIFFERENCE = 1e-13
"""Largest difference of a state after one step: the bar of docs/explanation/environments.md."""

ENGINES = ("compiled", "mujoco", "pinocchio", VECTOR)


@pytest.fixture(scope="module", params=PAIRS, ids=lambda pair: pair.name)
def pair_and_steps(request: pytest.FixtureRequest) -> tuple[Pair, Visited]:
    return request.param, visited(request.param, 200, 2)


@pytest.mark.parametrize("engine", ENGINES)
def test_steps_and_episodes_are_those_of_gymnasium(engine: str, pair_and_steps: tuple[Pair, Visited]) -> None:
    if engine not in (*installed_backends(), VECTOR):
        pytest.skip(f"needs {engine}")
    pair, steps = pair_and_steps
    few = Visited(*(column[:200] for column in steps))
    assert max(largest_difference(few, stepper(pair.task, engine))) < MAX_DIFFERENCE
    assert parted_episodes(pair.task, steps, engine, 2) == 0


def test_episodes_in_batches_end_where_those_of_gymnasium_do() -> None:
    pair = PAIRS[0]
    steps = visited(pair, 1, 10)
    assert parted_episodes(pair.task, steps, "reference", 10, batch=True) == 0
    assert parted_episodes(CartPole(pole_mass=0.3), steps, "reference", 10, batch=True) > 0


@pytest.mark.parametrize("name", ["CartPole", "Pendulum"])
def test_seeds_start_the_episodes_of_gymnasium(name: str) -> None:
    ours: Any = gymnasium.make(f"dynx/{name}-v0", engine="reference")
    theirs: Any = gymnasium.make(f"{name}-v1")
    for seed in (0, 7):
        assert np.array_equal(ours.reset(seed=seed)[0], theirs.reset(seed=seed)[0])
    assert np.array_equal(ours.reset()[0], theirs.reset()[0])
