"""What the hooks of a `RobotTask` return: equal errors on each engine, in a kernel and in vectors."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dynx.backends import installed_backends
from dynx.envs.environment import TaskEnvironment
from dynx.envs.task import State
from dynx.envs.tasks.cart_pole import FORCE, CartPole
from dynx.envs.vector import RobotVectorEnvironment
from dynx.errors import ArgumentError, DTypeError, NotFiniteError, ShapeError

ENGINES = (*installed_backends(), "vector")


def stepped(engine: str, hooks: dict[str, Any], actions: tuple[int, ...] = (1, 1, 1)) -> Any:
    """Step a cart-pole with these hooks; return the observation of the last environment."""
    task = type("Own", (CartPole,), hooks)()
    if engine == "vector":
        envs = RobotVectorEnvironment(task, len(actions))
        envs.reset(seed=0)
        return envs.step(np.array(actions))[0][-1]
    env = TaskEnvironment(task, engine)
    try:
        env.reset(seed=len(actions) - 1)
        return env.step(actions[-1])[0]
    finally:
        env.close()


def root(x: Any) -> Any:
    """Return NaN for a value above 0.5, which in a kernel is not known before the step."""
    with np.errstate(invalid="ignore"):
        return np.sqrt(0.5 - x)


INVALID: dict[str, tuple[dict[str, Any], type[Exception], str]] = {
    "torque of one joint": (
        {"torque": lambda self, robot, state, action: np.stack([action])},
        ShapeError,
        r"torque of Own has shape \(1,\); wanted \(2,\)",
    ),
    "scalar torque": (
        {"torque": lambda self, robot, state, action: action},
        ShapeError,
        r"torque of Own has shape \(\); wanted \(2,\)",
    ),
    "no torque": (
        {"torque": lambda self, robot, state, action: None},
        DTypeError,
        r"torque of Own is 'None'; wanted numbers of shape \(2,\)",
    ),
    "torque not finite": (
        {"torque": lambda self, robot, state, action: np.stack([root(action), 0.0 * action])},
        NotFiniteError,
        "torque of Own is not finite",
    ),
    "reward in an array": (
        {"reward": lambda self, robot, before, action, after: after.q},
        ShapeError,
        r"reward of Own has shape \(2,\); wanted \(\)",
    ),
    "reward not finite": (
        {"reward": lambda self, robot, before, action, after: root(action)},
        NotFiniteError,
        "reward of Own is not finite",
    ),
    "observation not finite": (
        {"observation": lambda self, robot, state: np.concatenate([state.q, root(1.0 + state.v**2)])},
        NotFiniteError,
        "observation of Own is not finite",
    ),
    "two ends": (
        {"terminated": lambda self, robot, state: state.q > 1.0},
        ShapeError,
        r"terminated of Own has shape \(2,\); wanted \(\)",
    ),
    "short start": (
        {"start": lambda self, random: State(random[:1], random[:2])},
        ShapeError,
        r"q of start of Own has shape \(1,\); wanted \(2,\); random_size is 4",
    ),
    "start without a state": (
        {"start": lambda self, random: (random[:2], random[2:])},
        DTypeError,
        r"start of Own returned .* wanted dynx.envs.State",
    ),
    "forgotten random_size": (
        {"random_size": 0, "start": lambda self, random: State(np.stack([random[0], 0.0]), np.zeros(2))},
        ArgumentError,
        "start of Own failed: IndexError: .*; random_size is 0",
    ),
    "no control step": ({"control_dt": None}, ArgumentError, "control_dt of Own is 'None'"),
}


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("case", INVALID)
def test_an_invalid_return_names_the_task_and_the_hook(engine: str, case: str) -> None:
    hooks, kind, message = INVALID[case]
    with pytest.raises(kind, match=message):
        stepped(engine, hooks)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_list_of_numbers_is_a_torque(engine: str) -> None:
    hooks = {"torque": lambda self, robot, state, action: [FORCE * (2.0 * action - 1.0), 0.0]}
    assert np.array_equal(stepped(engine, hooks), stepped(engine, {}))


@pytest.mark.parametrize("hook", ["torque not finite", "reward not finite"])
def test_the_environment_is_named_and_all_stay_as_they_were(hook: str) -> None:
    envs = RobotVectorEnvironment(type("Own", (CartPole,), INVALID[hook][0])(), 3)
    envs.reset(seed=0)
    before = envs.states
    with pytest.raises(NotFiniteError, match=r"in environment 1$"):
        envs.step(np.array([0, 1, 0]))
    assert np.array_equal(envs.states, before)
    assert not envs.step(np.zeros(3, dtype=int))[3].any()
