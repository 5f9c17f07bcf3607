"""Tasks of a user's own whose hooks depend on more than their arguments: refused on each compiled path."""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from contextlib import closing
from typing import Any, ClassVar

import numpy as np
import pytest

from dynx.backends import installed_backends
from dynx.envs.environment import TaskEnvironment
from dynx.envs.task import State
from dynx.envs.tasks.cart_pole import FORCE, CartPole
from dynx.envs.vector import RobotVectorEnvironment
from dynx.errors import ArgumentError

count = 0
TOTALS = {"episodes": 0}
GENERATOR = np.random.default_rng(0)

PATHS: dict[str, Callable[[Any], Any]] = {
    "vector": lambda task: RobotVectorEnvironment(task, 3),
    "vector with drawn parameters": lambda task: RobotVectorEnvironment(
        task, 3, randomize={"mass_scale": (0.9, 1.1)}
    ),
    "one lane": lambda task: TaskEnvironment(task, "compiled"),
}


def varied_by_class(self: Any, random: Any) -> State:
    """Count episodes in an attribute of the class."""
    type(self).episodes = getattr(type(self), "episodes", 0) + 1
    return State(random[:2] + type(self).episodes, random[2:])


def varied_by_module(self: Any, robot: Any, before: Any, action: Any, after: Any) -> Any:
    """Count steps in a variable of the module, which does not change this reward."""
    global count
    count += 1
    return 1.0 if count < 1_000_000 else 2.0


def varied_by_entry(self: Any, random: Any) -> State:
    """Count episodes in an entry of a dict, which does not change this start."""
    TOTALS["episodes"] += 1
    return State(random[:2] * (1.0 if TOTALS["episodes"] < 1_000_000 else 2.0), random[2:])


HOOKS: dict[str, tuple[str, Callable[..., Any], str]] = {
    "start, global generator": (
        "start",
        lambda self, numbers: State(np.random.random(2), numbers[2:]),  # noqa: NPY002
        r"fields of the task, 0\.\d+ in one call and 0\.\d+ in the next",
    ),
    "start, generator": ("start", lambda self, numbers: State(GENERATOR.random(2), numbers[2:]), "random"),
    "start, module random": (
        "start",
        lambda self, numbers: State(numbers[:2] + random.random(), numbers[2:]),
        "random_size says",
    ),
    "start, coin": (
        "start",
        lambda self, numbers: State(numbers[:2] if random.random() < 0.5 else numbers[2:], numbers[2:]),
        "depends on more",
    ),
    "start, time": (
        "start",
        lambda self, numbers: State(numbers[:2] * time.perf_counter(), numbers[2:]),
        "the time",
    ),
    "start, class": ("start", varied_by_class, "depends on more"),
    "start, entry": ("start", varied_by_entry, "changes TOTALS, which a kernel would do once"),
    "reward, module": ("reward", varied_by_module, "changes count"),
    "reward": (
        "reward",
        lambda self, robot, before, action, after: after.q[1] * random.random(),
        "depends on more",
    ),
    "torque": (
        "torque",
        lambda self, robot, state, action: np.stack([FORCE * action + random.random(), 0.0 * action]),
        "depends on more",
    ),
    "torque, argument of the dynamics": (
        "torque",
        lambda self, robot, state, action: robot.gravity_torque(state.q + random.random()),
        "depends on more",
    ),
    "observation": (
        "observation",
        lambda self, robot, state: np.concatenate([state.q, state.v + random.gauss(0.0, 1.0)]),
        "depends on more",
    ),
    "terminated": (
        "terminated",
        lambda self, robot, state: state.q[0] > 2.0 + random.random(),
        "depends on more",
    ),
    "settle": (
        "settle",
        lambda self, state: State(state.q, state.v * random.random(), state.memory),
        "depends on more",
    ),
    "advance": (
        "advance",
        lambda self, accelerate, q, v: (q + random.random() * v, v + 0.02 * accelerate(q, v)),
        "depends on more",
    ),
}


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("case", HOOKS)
def test_a_hook_that_depends_on_more_than_its_arguments_is_refused(case: str, path: str) -> None:
    hook, function, message = HOOKS[case]
    task = type("Own", (CartPole,), {hook: function})()
    with pytest.raises(ArgumentError, match=f"^{hook} of Own .*{message}") as caught:
        PATHS[path](task)
    assert "(test_own_tasks.py, line " in str(caught.value)


class Placed(CartPole):
    """Start at a place that an option of `reset` names, or draw one without `random`."""

    def start(self, random: Any, place: str = "") -> State:  # type: ignore[override]
        """Draw the place where the option says so."""
        drawn = np.random.random() if place == "anywhere" else 0.0  # noqa: NPY002
        return State(random[:2] + drawn, random[2:])


@pytest.mark.parametrize("path", PATHS)
def test_a_start_is_refused_for_options_with_which_it_draws(path: str) -> None:
    with closing(PATHS[path](Placed())) as env:
        env.reset(seed=0, options={"place": "here"})
        with pytest.raises(ArgumentError, match=r"^start of Placed depends on more"):
            env.reset(seed=0, options={"place": "anywhere"})


class Remembering(CartPole):
    """Keep what is computed once, and numbers of a seed; start where `random` says."""

    table: ClassVar[dict[str, float]] = {}

    def start(self, random: Any) -> State:  # type: ignore[override]
        """Return the state of `random`, moved by a seeded number that is kept."""
        if "shift" not in self.table:
            self.table["shift"] = float(np.random.default_rng(3).random())
        return State(random[:2] + self.table["shift"], random[2:])


@pytest.mark.parametrize("engine", [*installed_backends(), "vector"])
def test_seeded_numbers_and_values_that_are_kept_give_equal_starts_on_each_engine(engine: str) -> None:
    shift = np.random.default_rng(3).random()
    task = Remembering()
    with closing(PATHS["vector"](task) if engine == "vector" else TaskEnvironment(task, engine)) as env:
        found = np.reshape(env.reset(seed=0)[0], (-1, 4))[0]
    drawn = np.random.default_rng(0).random(4)
    expected = [drawn[0] + shift, drawn[2], drawn[1] + shift, drawn[3]]
    np.testing.assert_allclose(found, expected, rtol=1e-6)
