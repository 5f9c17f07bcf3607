"""Environments by their Gymnasium id, such as ``dynx/CartPole-v0``, and their constructors."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from types import FunctionType
from typing import Any

from dynx.envs.environment import TaskEnvironment
from dynx.envs.library import AutoresetMode, register, registry
from dynx.envs.randomization import Randomization
from dynx.envs.robot.array_task import ArrayTask
from dynx.envs.task import Task
from dynx.envs.vector import RobotVectorEnvironment
from dynx.errors import ArgumentError, shown

COMPILED = "compiled"
"""The engine of vector environments, whose kernels are compiled."""

NAMESPACE = "dynx"
ENTRY_POINT = "dynx.envs.registration:make_environment"
VECTOR_ENTRY_POINT = "dynx.envs.registration:make_vector_environment"

TASKS = {
    "Acrobot-v0": "dynx.envs.tasks.acrobot:Acrobot",
    "CartPole-v0": "dynx.envs.tasks.cart_pole:CartPole",
    "LunarLander-v0": "dynx.envs.tasks.lunar_lander.task:LunarLander",
    "Pendulum-v0": "dynx.envs.tasks.pendulum:Pendulum",
    "Push-v0": "dynx.envs.tasks.push:Push",
    "Stand-v0": "dynx.envs.tasks.stand:Stand",
    "Walk-v0": "dynx.envs.tasks.walk:Walk",
    "Reach-v0": "dynx.envs.tasks.reach:Reach",
}
"""Tasks of dynx by the name of their environment, as ``"package.module:Class"``."""


def task_class(task: str | type[Task]) -> type[Task]:
    """Return a class of tasks, given itself or as ``"package.module:Class"``.

    Raises ArgumentError for anything else.
    """
    found = task
    if isinstance(task, str):
        module, _, name = task.partition(":")
        found = getattr(import_module(module), name)
    if not (isinstance(found, type) and issubclass(found, Task)):
        raise ArgumentError(f"task is {shown(task)}; wanted a subclass of dynx.envs.Task")
    for base in found.__mro__[1:]:
        for name, method in vars(base).items():
            if isinstance(method, FunctionType) and not callable(getattr(found, name)):
                raise ArgumentError(
                    f"{name} of {found.__name__} is a {type(getattr(found, name)).__name__}; wanted a method"
                )
    return found


def make_environment(
    task: str | type[Task],
    engine: str | None = None,
    render_mode: str | None = None,
    *,
    randomize: Randomization | Mapping[str, Any] | None = None,
    width: int = 480,
    height: int = 360,
    **options: Any,
) -> TaskEnvironment:
    """Return the environment of a task with these `options` on an engine; `gymnasium.make` calls this."""
    made = task_class(task).with_options(options)
    return TaskEnvironment(made, engine, render_mode, randomize=randomize, width=width, height=height)


def make_vector_environment(
    task: str | type[Task],
    num_envs: int = 1,
    engine: str = COMPILED,
    render_mode: str | None = None,
    *,
    max_episode_steps: int | None = None,
    autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
    copy: bool = True,
    randomize: Randomization | Mapping[str, Any] | None = None,
    width: int = 480,
    height: int = 360,
    **options: Any,
) -> RobotVectorEnvironment:
    """Return environments of a task that step in one compiled kernel; `gymnasium.make_vec` calls this.

    Raises ArgumentError for another engine or a task that is no `ArrayTask`: those step one by one or in
    processes, by ``vectorization_mode="sync"`` or ``"async"``.
    """
    made = task_class(task).with_options(options)
    if engine != COMPILED or not isinstance(made, ArrayTask):
        subject = type(made).__name__ if engine == COMPILED else f"engine {shown(engine)}"
        raise ArgumentError(
            f"{subject} does not step in a compiled kernel; wanted vectorization_mode='sync' or 'async', or "
            f"a task of one robot on engine {COMPILED!r}"
        )
    return RobotVectorEnvironment(
        made,
        num_envs,
        max_episode_steps=max_episode_steps,
        autoreset_mode=autoreset_mode,
        copy=copy,
        randomize=randomize,
        render_mode=render_mode,
        width=width,
        height=height,
    )


def register_task(env_id: str, task: str | type[Task]) -> None:
    """Register a task, so that ``gymnasium.make(env_id, engine=...)`` makes its environment.

    An id is ``namespace/Name-v0``. An environment of that id is replaced.
    """
    kind = task_class(task)
    registry.pop(env_id, None)
    register(
        env_id,
        entry_point=ENTRY_POINT,
        vector_entry_point=VECTOR_ENTRY_POINT if issubclass(kind, ArrayTask) else None,
        max_episode_steps=kind.max_episode_steps,
        reward_threshold=kind.reward_threshold,
        kwargs={"task": task},
    )


def register_tasks() -> None:
    """Register the tasks of dynx."""
    for name, task in TASKS.items():
        register_task(f"{NAMESPACE}/{name}", task)
