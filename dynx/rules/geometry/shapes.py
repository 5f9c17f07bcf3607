"""``<visual>`` and ``<collision>`` of a link as an `Extent` in the link frame."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product

import numpy as np

from dynx.errors import DescriptionError
from dynx.model.geometry.mesh_files import MeshNotFoundError, find_mesh
from dynx.model.xml.source import SourceElement
from dynx.rules.geometry.extent import Extent
from dynx.rules.geometry.meshes import mesh_box
from dynx.rules.text.attributes import number_of, origin_of, vector_of
from dynx.spatial.scalar import Floats

_SIDES = 32
"""Number of sides of the prism about a cylinder; it is too large by 0.5 % of the radius."""


def link_extent(link: SourceElement, source: str) -> Extent | None:
    """Return the extent of all shapes of a link, in the link frame; None where a size is unknown.

    `source` is the path of the description, relative to which meshes are searched.
    """
    parts = []
    for shape in (child for child in link.children if child.tag in ("visual", "collision")):
        extent = _shape_extent(shape, source)
        if extent is None:
            return None
        parts.append(extent)
    return Extent.union(parts)


def geometry_elements(link: SourceElement) -> Iterator[SourceElement]:
    """Yield the shape elements (``<box>``, ``<mesh>``, ...) of a link, in document order."""
    for shape in link.children:
        if shape.tag in ("visual", "collision"):
            for geometry in shape.all("geometry"):
                yield from geometry.children


def _shape_extent(shape: SourceElement, source: str) -> Extent | None:
    geometry = shape.first("geometry")
    if geometry is None or not geometry.children:
        return Extent.of_points([])
    try:
        extent = _in_own_frame(geometry.children[0], source)
        return None if extent is None else extent.transform(origin_of(shape).matrix)
    except DescriptionError:
        return None


def _in_own_frame(element: SourceElement, source: str) -> Extent | None:
    if element.tag == "mesh":
        return _mesh(element, source)
    if element.tag == "box":
        size = vector_of(element, "size")
        return None if size is None else _box(np.array(size) / -2.0, np.array(size) / 2.0)
    radius = number_of(element, "radius")
    if element.tag == "sphere" and radius is not None:
        return Extent.of_points([(0.0, 0.0, 0.0)], abs(radius))
    length = number_of(element, "length")
    if radius is None or length is None:
        return None
    if element.tag == "capsule":
        return Extent.of_points([(0.0, 0.0, -length / 2.0), (0.0, 0.0, length / 2.0)], abs(radius))
    return _cylinder(abs(radius), length) if element.tag == "cylinder" else None


def _cylinder(radius: float, length: float) -> Extent:
    outside = radius / math.cos(math.pi / _SIDES)
    angles = [2.0 * math.pi * k / _SIDES for k in range(_SIDES)]
    rim = [(outside * math.cos(angle), outside * math.sin(angle)) for angle in angles]
    return Extent.of_points((x, y, z) for x, y in rim for z in (-length / 2.0, length / 2.0))


def _mesh(element: SourceElement, source: str) -> Extent | None:
    try:
        path = find_mesh(element.attributes.get("filename", ""), source)
    except MeshNotFoundError:
        return None
    box = None if path is None else mesh_box(path)
    if box is None:
        return None
    scale = np.array(vector_of(element, "scale") or (1.0, 1.0, 1.0))
    return _box(np.array(box[0]) * scale, np.array(box[1]) * scale)


def _box(low: Floats, high: Floats) -> Extent:
    return Extent.of_points(product(*zip(low.tolist(), high.tolist(), strict=True)))
