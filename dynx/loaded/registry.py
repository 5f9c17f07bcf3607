"""The engines that can load a file themselves, by name; each is imported when it is asked for."""

from __future__ import annotations

from collections.abc import Collection
from importlib import import_module
from pathlib import Path

from dynx.errors import BackendError, UnknownBackendError, nearest, shown
from dynx.loaded.robot import LoadedRobot
from dynx.model import Model

_CLASSES = {
    "pinocchio": "dynx.engines.pinocchio.as_loaded:LoadedPinocchio",
    "pybullet": "dynx.engines.pybullet.as_loaded:LoadedPyBullet",
    "mujoco": "dynx.engines.mujoco.as_loaded:LoadedMujoco",
    "drake": "dynx.engines.drake.as_loaded:LoadedDrake",
}

ENGINES = tuple(_CLASSES)
"""Names of all engines that dynx can watch loading a file."""


def loader_class(engine: str) -> type[LoadedRobot]:
    """The class behind a name; NotInstalledError where the engine is missing."""
    if engine not in _CLASSES:
        raise UnknownBackendError(f"no engine {shown(engine)} that loads files{nearest(engine, ENGINES)}")
    module, _, attribute = _CLASSES[engine].partition(":")
    found: type[LoadedRobot] = getattr(import_module(module), attribute)
    found.engine_version()
    return found


def installed_engines() -> tuple[str, ...]:
    """The engines that can be used here; this imports them."""
    return tuple(engine for engine in ENGINES if _works(engine))


def load_as(engine: str, path: Path, model: Model, calls: Collection[str] = ()) -> LoadedRobot:
    """The robot as `engine` loads it from the file; see `LoadedRobot`."""
    return loader_class(engine)(path, model, calls)


def _works(engine: str) -> bool:
    try:
        loader_class(engine)
    except BackendError:
        return False
    return True
