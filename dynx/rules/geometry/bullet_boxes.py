"""Collision meshes of a link as PyBullet measures them: by their bounding boxes."""

from __future__ import annotations

from collections.abc import Iterator

from dynx.model.geometry.mesh_files import MeshNotFoundError, find_by_bullet, find_mesh
from dynx.model.xml.source import SourceElement
from dynx.rules.geometry.meshes import Box, mesh_box

MESH_TAGS = frozenset({"mesh", "sdf_mesh", "convex"})
"""Elements of shapes that are read from a file."""


def collision_meshes(link: SourceElement) -> Iterator[tuple[SourceElement, SourceElement]]:
    """Yield each collision shape of a link that is a mesh of a file, and the element of its mesh."""
    for collision in link.all("collision"):
        mesh = next((element for element in collision.walk() if element.tag in MESH_TAGS), None)
        if mesh is not None and not lacks_file(mesh):
            yield collision, mesh


def lacks_file(mesh: SourceElement) -> bool:
    """Check whether a mesh names no file."""
    return not mesh.attributes.get("filename", "").strip()


def bullet_box(filename: str, source: str) -> tuple[Box, str] | None:
    """Return the box of a mesh that the description `source` names, and the suffix of its file; None for one
    that dynx does not find, or that dynx or PyBullet does not read."""
    try:
        path = find_mesh(filename, source)
    except MeshNotFoundError:
        path = None
    path = path or find_by_bullet(filename, source)
    box = None if path is None else mesh_box(path, by_bullet=True)
    return None if path is None or box is None else (box, path.suffix.lower())
