"""The engines that load a file themselves, by name; each is imported when it is first looked up.

A *loading variant* is another documented call by which the users of an engine load a file. Its name begins
with that of its engine, ``ENGINE:VARIANT``.
"""

from __future__ import annotations

import os
from collections.abc import Collection
from pathlib import Path

from dynx.argument_types import checks_types
from dynx.errors import BackendError, RobotNotFoundError, UnknownBackendError, shown
from dynx.loaded.robot import LoadedRobot
from dynx.model import Model
from dynx.model.ball_joints import BACKENDS_WITH_BALL_JOINTS, refuse_ball_joints
from dynx.registry import ClassRegistry

REGISTRY: ClassRegistry[LoadedRobot] = ClassRegistry(
    "engine",
    None,
    {
        "pinocchio": "dynx.engines.pinocchio.as_loaded:LoadedPinocchio",
        "pybullet": "dynx.engines.pybullet.as_loaded:LoadedPyBullet",
        "mujoco": "dynx.engines.mujoco.as_loaded:LoadedMujoco",
        "drake": "dynx.engines.drake.as_loaded:LoadedDrake",
        "pybullet:plain": "dynx.engines.pybullet.as_loaded:PlainPyBullet",
        "pybullet:merge": "dynx.engines.pybullet.as_loaded:MergingPyBullet",
        "mujoco:balanceinertia": "dynx.engines.mujoco.as_loaded:BalancedMujoco",
    },
    lambda: LoadedRobot,
    error=BackendError,
    unknown=UnknownBackendError,
)

VARIANTS = tuple(name for name in REGISTRY.built_in if ":" in name)
"""Names of dynx's own loading variants."""

ENGINES = tuple(name for name in REGISTRY.built_in if name not in VARIANTS)
"""Names of the built-in engines."""

COMMON_VARIANTS = ("pybullet:plain",)
"""Variants so common that they are examined beside their engine by default."""


@checks_types
def engine_of(name: str) -> str:
    """Return the engine of a loading variant, or the name itself if it is the name of an engine."""
    return name.partition(":")[0]


@checks_types
def loader_class(engine: str) -> type[LoadedRobot]:
    """Return the class of that engine or variant; raises NotInstalledError where the engine is missing."""
    found = REGISTRY.find(engine)
    found.engine_version()
    return found


def installed_engines() -> tuple[str, ...]:
    """Return the names of the engines that can be used here, without variants; this imports them."""
    return tuple(name for name in REGISTRY.names() if engine_of(name) == name and _is_installed(name))


@checks_types
def load_as(
    engine: str, path: str | os.PathLike[str], model: Model, calls: Collection[str] = ()
) -> LoadedRobot:
    """Return the robot as `engine` loads it from the file at `path`, in URDF, MJCF or SDF; see `LoadedRobot`.

    Use it in a ``with`` statement, or close it. Raises RobotNotFoundError where there is no such file.
    """
    file = Path(path)
    if not file.is_file():
        raise RobotNotFoundError(
            f"no file {shown(path)}; wanted the path of a file in URDF, MJCF or SDF, which "
            f"{shown(engine)} loads itself"
        )
    loader = loader_class(engine)
    if model.ball_joints and not loader.takes_ball_joints:
        what = f"the comparison with {shown(engine)}, which loads the file itself,"
        instead = f"'mujoco' and 'drake' as they load the file do, and {BACKENDS_WITH_BALL_JOINTS}"
        refuse_ball_joints(model, what, instead)
    return loader(file, model, calls)


def _is_installed(engine: str) -> bool:
    try:
        loader_class(engine)
    except BackendError:
        return False
    return True
