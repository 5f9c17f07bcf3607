"""Extents of the shapes of links, with which rules compare masses and inertias."""

from dynx.model.geometry.mesh_files import MeshNotFoundError, find_mesh, found_by_bullet
from dynx.rules.geometry.extent import Extent
from dynx.rules.geometry.rigid_shapes import body_extents, group_extents
from dynx.rules.geometry.unread_meshes import (
    is_found,
    is_found_above,
    named_meshes,
    parts_with_meshes,
    reason_unread,
)

__all__ = [
    "Extent",
    "MeshNotFoundError",
    "body_extents",
    "find_mesh",
    "found_by_bullet",
    "group_extents",
    "is_found",
    "is_found_above",
    "named_meshes",
    "parts_with_meshes",
    "reason_unread",
]
