"""Gymnasium ids of tasks, and the short names by which people call them."""

from __future__ import annotations

import re
from importlib import import_module

from dynx.envs.library import registry
from dynx.envs.registration import NAMESPACE
from dynx.errors import UnknownNameError, nearest, shown


def task_id(name: str) -> str:
    """Return the Gymnasium id of a task named as ``CartPole``, ``dynx/CartPole-v0`` or ``LunarLander-v3``.

    A bare name is a task of dynx, in its newest version. Of ``module:Env-v0`` the module is imported, which
    registers the task: the name must be the caller's, never that of a file. Raises UnknownNameError with the
    nearest name.
    """
    module, colon, own = name.rpartition(":")
    if colon:
        _import(module)
        if own not in registry:
            raise UnknownNameError(
                f"module {shown(module)} registers no task {shown(own)}{nearest(own, registry)}"
            )
    if name in registry or colon:
        return name
    versions = [each for each in registry if each.rpartition("-v")[0] == f"{NAMESPACE}/{name}"]
    if versions:
        return max(versions, key=lambda each: int(each.rpartition("-v")[2]))
    bare = [bare_name(each) for each in registry if is_of_dynx(each)]
    near = nearest(name, dict.fromkeys(bare))
    raise UnknownNameError(
        f"no task {shown(name)}{near if '?' in near else nearest(name, [*bare, *registry])}"
    )


def _import(module: str) -> None:
    try:
        import_module(module)
    except (ImportError, ValueError) as error:
        raise UnknownNameError(f"module {shown(module)} cannot be imported: {error}") from error


def is_of_dynx(env_id: str) -> bool:
    """Check whether an id is that of a task of dynx, which takes an engine."""
    return env_id.startswith(f"{NAMESPACE}/")


def bare_name(env_id: str) -> str:
    """Return the name of a task without namespace and version: CartPole of ``dynx/CartPole-v0``."""
    name = re.split("[/:]", env_id)[-1]
    return name.rpartition("-v")[0] or name
