"""A URDF file as PyBullet loads it by the plain call, without the flag that makes it read inertias.

Bullet then computes the inertia of each link from the bounding box of its collision shapes, for the mass of
the file: about axes parallel to those of the inertial, through the centre of mass of the file, wherever the
shapes are. A link without shapes gets an inertia of almost zero.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import ClassVar

from dynx.engines.pybullet.as_loaded import LoadedPyBullet

USE_FILE_INERTIA = "pybullet.use_file_inertia"
"""Id of the setting with which the plain call is that of `LoadedPyBullet`."""


class PlainPyBullet(LoadedPyBullet):
    """A robot as PyBullet loads it without ``URDF_USE_INERTIA_FROM_FILE``; see the module docstring."""

    name: ClassVar[str] = "pybullet:plain"
    loads_meshes: ClassVar[bool] = True
    CALLS: ClassVar[Mapping[str, str]] = {
        **LoadedPyBullet.CALLS,
        USE_FILE_INERTIA: "robot = p.loadURDF(path, ..., flags=p.URDF_USE_INERTIA_FROM_FILE)",
    }

    @classmethod
    def _uses_file_inertia(cls, calls: Collection[str]) -> bool:
        return USE_FILE_INERTIA in calls

    @classmethod
    def load_call(cls, floating: bool) -> str:
        """Return the call: one line, after ``import pybullet as p`` and ``p.connect(p.DIRECT)``."""
        return "robot = p.loadURDF(path)" if floating else "robot = p.loadURDF(path, useFixedBase=True)"
