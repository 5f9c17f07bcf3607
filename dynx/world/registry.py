"""Engines that run worlds, by name: those of dynx, of the running program, and of installed packages."""

from __future__ import annotations

from dynx.errors import BackendError, NotInstalledError, UnknownBackendError
from dynx.registry import ClassRegistry
from dynx.world.engine import WorldEngine

GROUP = "dynx.worlds"
"""The entry-point group: ``name = "package.module:EngineClass"``."""

BUILT_IN = {
    "pybullet": "dynx.engines.pybullet.world.engine:BulletWorld",
    "mujoco": "dynx.engines.mujoco.world.engine:MujocoWorld",
    "drake": "dynx.engines.drake.world.engine:DrakeWorld",
}
"""Engines of dynx itself."""

_engines = ClassRegistry(
    "world engine", GROUP, BUILT_IN, lambda: WorldEngine, error=BackendError, unknown=UnknownBackendError
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
