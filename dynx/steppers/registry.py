"""Engines that run worlds, by name: those of dynx, of the running program, and of installed packages."""

from __future__ import annotations

from dynx.errors import (
    ArgumentError,
    BackendError,
    NotInstalledError,
    UnknownBackendError,
    nearest,
    shown,
)
from dynx.registry import ClassRegistry
from dynx.steppers.camera import Draw
from dynx.steppers.stepper import Stepper

GROUP = "dynx.worlds"
"""The entry-point group: ``name = "package.module:EngineClass"``."""

BUILT_IN = {
    "pybullet": "dynx.engines.pybullet.world.engine:BulletWorld",
    "mujoco": "dynx.engines.mujoco.world.engine:MujocoWorld",
    "drake": "dynx.engines.drake.world.engine:DrakeWorld",
}
"""Engines of dynx itself."""

_engines = ClassRegistry(
    "world engine", GROUP, BUILT_IN, lambda: Stepper, error=BackendError, unknown=UnknownBackendError
)
world_names = _engines.names
world_class = _engines.find
register = _engines.register
unregister = _engines.unregister


def installed_worlds() -> tuple[str, ...]:
    """Return the names of the engines that are installed. Raises NotInstalledError if none is."""
    found = []
    for name in world_names():
        try:
            world_class(name).require_engine()
        except BackendError:
            continue
        found.append(name)
    if not found:
        raise NotInstalledError("no engine for worlds is installed: pip install 'dynx[mujoco]'")
    return tuple(found)


def renderer_of(name: str) -> Draw:
    """Return the renderer of an engine. Raises UnknownBackendError for another name."""
    if not isinstance(name, str):
        raise ArgumentError(
            f"renderer is {shown(name)}; wanted the name of an engine, or None for dynx's own"
        )
    if name not in world_names():
        raise UnknownBackendError(
            f"no renderer {shown(name)}; wanted None, for that of dynx, or 'pybullet', for PyBullet's in "
            f"software{nearest(name, ['pybullet'])}"
        )
    return world_class(name).draw
