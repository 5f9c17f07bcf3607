"""Engines that run worlds, by name: those of dynx, of the running program, and of installed packages."""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import TYPE_CHECKING

from dynx.errors import (
    ArgumentError,
    BackendError,
    NotInstalledError,
    UnknownBackendError,
    nearest,
    shown,
)
from dynx.registry import ClassRegistry
from dynx.steppers.layout import EMPTY
from dynx.steppers.stepper import Feature, Stepper

if TYPE_CHECKING:
    from dynx.steppers.camera import Draw

GROUP = "dynx.steppers"
"""The entry-point group: ``name = "package.module:EngineClass"``."""

FORMER_GROUP = "dynx.worlds"

BUILT_IN = {
    "pybullet": "dynx.engines.pybullet.stepper:BulletStepper",
    "mujoco": "dynx.engines.mujoco.stepper:MujocoStepper",
    "drake": "dynx.engines.drake.stepper:DrakeStepper",
    "dynx": "dynx.engines.own.stepper:OwnStepper",
}
"""Engines of dynx itself."""

_engines = ClassRegistry(
    "world engine", GROUP, BUILT_IN, lambda: Stepper, error=BackendError, unknown=UnknownBackendError
)
world_names = _engines.names
register = _engines.register
unregister = _engines.unregister


def world_class(name: str) -> type[Stepper]:
    """Import and return the class of that name.

    Raises BackendError for one that a package offers in the entry-point group of dynx's first versions, whose
    interface was another one; UnknownBackendError for a name that nobody provides.
    """
    # Reading the entry points of all packages takes as long as thousands of steps.
    if isinstance(name, str) and name not in BUILT_IN and name not in world_names():
        for point in entry_points(group=FORMER_GROUP, name=name):
            raise BackendError(
                f"{point.value} is offered in the group {FORMER_GROUP!r}, which dynx no longer reads: derive "
                f"it from dynx.steppers.stepper.Stepper and offer it in the group {GROUP!r}"
            )
    return _engines.find(name)


def installed_worlds() -> tuple[str, ...]:
    """Return the names of the installed engines that have contacts; NotInstalledError if none is."""
    found = []
    for name in world_names():
        try:
            kind = world_class(name)
            kind.require_engine()
        except BackendError:
            continue
        if Feature.CONTACTS in kind.provides(EMPTY):
            found.append(name)
    if not found:
        raise NotInstalledError("no engine for worlds with contacts is installed: pip install 'dynx[mujoco]'")
    return tuple(found)


def renderer_of(name: str) -> Draw:
    """Return the renderer of an engine. Raises UnknownBackendError for another name."""
    if not isinstance(name, str):
        raise ArgumentError(
            f"renderer is {shown(name)}; wanted the name of an engine, or None for dynx's own"
        )
    if name not in world_names():
        raise UnknownBackendError(
            f"no renderer {shown(name)}; wanted None, for that of dynx, 'mujoco' for MuJoCo's by OpenGL, "
            f"or 'pybullet', for PyBullet's in software{nearest(name, ['mujoco', 'pybullet'])}"
        )
    from dynx.steppers.native_queries import native_queries_of  # a world that moves draws no picture

    return native_queries_of(world_class(name)).draw
