"""Meshes that dynx does not read, so that no rule compares a mass or an inertia with their size."""

from __future__ import annotations

from collections.abc import Iterator

from dynx.model.geometry.mesh_files import (
    MeshNotFoundError,
    find_by_bullet,
    find_mesh,
    found_by_bullet,
    reason_unknown,
)
from dynx.model.xml.source import SourceElement, XmlSource
from dynx.rules.geometry.meshes import is_mesh_format, mesh_box
from dynx.rules.geometry.shapes import geometry_elements


def named_meshes(source: XmlSource) -> Iterator[tuple[SourceElement, SourceElement]]:
    """Yield the first ``<mesh>`` of each file that a description names, after its ``<link>``."""
    seen = {""}
    for link in source.root.all("link"):
        for element in geometry_elements(link):
            filename = element.attributes.get("filename", "")
            if element.tag == "mesh" and filename not in seen:
                seen.add(filename)
                yield link, element


def parts_with_meshes(source: XmlSource) -> dict[str, set[str]]:
    """Return the parts of links, ``visual`` or ``collision``, in which each mesh file is named."""
    parts: dict[str, set[str]] = {}
    for part in (part for link in source.root.all("link") for part in link.children):
        for mesh in (each for each in part.walk() if each.tag == "mesh"):
            parts.setdefault(mesh.attributes.get("filename", ""), set()).add(part.tag)
    return parts


def is_found(filename: str, source: str) -> bool:
    """Check whether a mesh of the description `source` (a path) is found, readable or not."""
    try:
        return find_mesh(filename, source) is not None
    except MeshNotFoundError:
        return False


def is_found_above(filename: str, source: str) -> bool:
    """Check whether an engine finds a mesh that searches the folders above the description `source`."""
    return find_by_bullet(filename, source) is not None


def reason_unread(filename: str, source: str) -> str | None:
    """Return the reason why a mesh of the description `source` (a path) is not read; None if it is."""
    try:
        path = find_mesh(filename, source)
    except MeshNotFoundError as error:
        return f"{error}{found_by_bullet(filename, source)}"
    if path is None:
        return f"{reason_unknown(filename, source)}{found_by_bullet(filename, source)}"
    if mesh_box(path) is not None:
        return None
    if not is_mesh_format(path):
        return f"dynx reads STL, OBJ and COLLADA, and no {path.suffix or 'file without a suffix'}"
    return f"no points can be read in the {path.suffix} file"
