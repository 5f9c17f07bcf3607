"""Gymnasium ids of tasks, and the short names by which people call them."""

from __future__ import annotations

from dynx.envs.library import registry
from dynx.envs.registration import NAMESPACE
from dynx.errors import UnknownNameError, nearest, shown


def task_id(name: str) -> str:
    """Return the Gymnasium id of a task named as ``CartPole``, ``dynx/CartPole-v0`` or ``LunarLander-v3``.

    A bare name is a task of dynx, in its newest version. Raises UnknownNameError with the nearest name.
    """
    if name in registry:
        return name
    versions = [each for each in registry if each.rpartition("-v")[0] == f"{NAMESPACE}/{name}"]
    if versions:
        return max(versions, key=lambda each: int(each.rpartition("-v")[2]))
    bare = [bare_name(each) for each in registry if is_of_dynx(each)]
    near = nearest(name, dict.fromkeys(bare))
    raise UnknownNameError(
        f"no task {shown(name)}{near if '?' in near else nearest(name, [*bare, *registry])}"
    )


def is_of_dynx(env_id: str) -> bool:
    """Check whether an id is that of a task of dynx, which takes an engine."""
    return env_id.startswith(f"{NAMESPACE}/")


def bare_name(env_id: str) -> str:
    """Return the name of a task without namespace and version: CartPole of ``dynx/CartPole-v0``."""
    name = env_id.rpartition("/")[2]
    return name.rpartition("-v")[0] or name
