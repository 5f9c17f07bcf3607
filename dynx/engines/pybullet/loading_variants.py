"""URDF files as PyBullet loads them by other flags than those of `LoadedPyBullet`.

By the plain call, without the flag that makes it read inertias, Bullet computes the inertia of each link from
the bounding box of its collision shapes, for the mass of the file: about axes parallel to those of the
inertial, through the centre of mass of the file, wherever the shapes are. A link without shapes gets an
inertia of almost zero.

With the flag that merges links on fixed joints, Bullet sums their inertias about wrong axes.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import ClassVar

from dynx.engines.pybullet.as_loaded import USE_INERTIA, LoadedPyBullet

USE_FILE_INERTIA = "pybullet.use_file_inertia"
"""Id of the setting with which the plain call is that of `LoadedPyBullet`."""

KEEP_FIXED_LINKS = "pybullet.keep_fixed_links"
"""Id of the setting with which the call that merges links is that of `LoadedPyBullet`."""

_MERGE = "URDF_MERGE_FIXED_LINKS"


class PlainPyBullet(LoadedPyBullet):
    """A robot as PyBullet loads it without any flag; see the module docstring."""

    name: ClassVar[str] = "pybullet:plain"
    loads_meshes: ClassVar[bool] = True
    CALLS: ClassVar[Mapping[str, str]] = {
        **LoadedPyBullet.CALLS,
        USE_FILE_INERTIA: f"robot = p.loadURDF(path, ..., flags=p.{USE_INERTIA})",
    }

    @classmethod
    def _flags(cls, calls: Collection[str]) -> tuple[str, ...]:
        return (USE_INERTIA,) if USE_FILE_INERTIA in calls else ()

    @classmethod
    def load_call(cls, floating: bool) -> str:
        """Return the call: one line, after ``import pybullet as p`` and ``p.connect(p.DIRECT)``."""
        return "robot = p.loadURDF(path)" if floating else "robot = p.loadURDF(path, useFixedBase=True)"


class MergingPyBullet(LoadedPyBullet):
    """A robot as PyBullet loads it with links on fixed joints merged into their parents."""

    name: ClassVar[str] = "pybullet:merge"
    CALLS: ClassVar[Mapping[str, str]] = {
        **LoadedPyBullet.CALLS,
        KEEP_FIXED_LINKS: f"robot = p.loadURDF(path, ..., flags=p.{USE_INERTIA})  # not p.{_MERGE}",
    }

    @classmethod
    def _flags(cls, calls: Collection[str]) -> tuple[str, ...]:
        return (USE_INERTIA,) if KEEP_FIXED_LINKS in calls else (USE_INERTIA, _MERGE)

    @classmethod
    def load_call(cls, floating: bool) -> str:
        """Return the call: one line, after ``import pybullet as p`` and ``p.connect(p.DIRECT)``."""
        return super().load_call(floating)[:-1] + f" | p.{_MERGE})"
