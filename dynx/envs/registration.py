"""Environments by their Gymnasium id, such as ``dynx/CartPole-v0``, and their constructors."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from dynx.envs.environment import TaskEnvironment
from dynx.envs.library import register, registry
from dynx.envs.task import Task
from dynx.errors import ArgumentError, shown

NAMESPACE = "dynx"

TASKS = {
    "CartPole-v0": "dynx.envs.tasks.cart_pole:CartPole",
    "LunarLander-v0": "dynx.envs.tasks.lunar_lander.task:LunarLander",
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
    return found


def make_environment(
    task: str | type[Task],
    engine: str | None = None,
    render_mode: str | None = None,
    *,
    width: int = 480,
    height: int = 360,
    **options: Any,
) -> TaskEnvironment:
    """Return the environment of a task with these `options` on an engine; `gymnasium.make` calls this."""
    made = task_class(task).with_options(options)
    return TaskEnvironment(made, engine, render_mode, width=width, height=height)


def register_task(env_id: str, task: str | type[Task]) -> None:
    """Register a task, so that ``gymnasium.make(env_id, engine=...)`` makes its environment.

    An id is ``namespace/Name-v0``. An environment of that id is replaced.
    """
    kind = task_class(task)
    registry.pop(env_id, None)
    register(
        env_id,
        entry_point="dynx.envs.registration:make_environment",
        max_episode_steps=kind.max_episode_steps,
        reward_threshold=kind.reward_threshold,
        kwargs={"task": task},
    )


def register_tasks() -> None:
    """Register the tasks of dynx."""
    for name, task in TASKS.items():
        register_task(f"{NAMESPACE}/{name}", task)
