"""The engines that load a file themselves, by name; each is imported when it is first looked up.

Other packages add engines by entry points in the group ``dynx.loaded``.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from dynx.errors import BackendError, UnknownBackendError
from dynx.loaded.robot import LoadedRobot
from dynx.model import Model
from dynx.registry import ClassRegistry

REGISTRY: ClassRegistry[LoadedRobot] = ClassRegistry(
    "engine",
    "dynx.loaded",
    {
        "pinocchio": "dynx.engines.pinocchio.as_loaded:LoadedPinocchio",
        "pybullet": "dynx.engines.pybullet.as_loaded:LoadedPyBullet",
        "mujoco": "dynx.engines.mujoco.as_loaded:LoadedMujoco",
        "drake": "dynx.engines.drake.as_loaded:LoadedDrake",
    },
    lambda: LoadedRobot,
    error=BackendError,
    unknown=UnknownBackendError,
)

ENGINES = tuple(REGISTRY.built_in)
"""Names of dynx's own engines."""


def loader_class(engine: str) -> type[LoadedRobot]:
    """The class of that name; raises NotInstalledError where its engine is missing."""
    found = REGISTRY.find(engine)
    found.engine_version()
    return found


def installed_engines() -> tuple[str, ...]:
    """Names of the engines that can be used here; this imports them."""
    return tuple(engine for engine in REGISTRY.names() if _is_installed(engine))


def load_as(engine: str, path: Path, model: Model, calls: Collection[str] = ()) -> LoadedRobot:
    """The robot as `engine` loads it from the file; see `LoadedRobot`."""
    return loader_class(engine)(path, model, calls)


def _is_installed(engine: str) -> bool:
    try:
        loader_class(engine)
    except BackendError:
        return False
    return True
