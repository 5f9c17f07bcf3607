"""Shapes as elements of MJCF, MuJoCo's format of models."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from dynx.model.geometry.links import Collision
from dynx.model.geometry.mesh import Mesh
from dynx.model.geometry.shapes import Box, Capsule, Cylinder, HeightField, Plane, Sphere
from dynx.model.geometry.solids import Shape
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_from_rotation

MIN_HEIGHT_RANGE = 1e-6
"""Range of heights [m] that a level height field is given, because MuJoCo requires one above zero."""


def text(values: Iterable[Any]) -> str:
    """Return numbers as text, each the shortest that reads back exactly."""
    return " ".join(repr(float(value)) for value in values)


def quat_text(R: Floats) -> str:
    """Return the quaternion (w, x, y, z) of a rotation matrix (3, 3) as text."""
    x, y, z, w = quat_from_rotation(np.asarray(R, dtype=np.float64))
    return text([w, x, y, z])


def placement(T: Floats) -> dict[str, str]:
    """Return the attributes of a pose (4, 4)."""
    return {"pos": text(T[:3, 3]), "quat": quat_text(T[:3, :3])}


class ShapeWriter:
    """Adds shapes to bodies; equal meshes and height fields become one asset."""

    def __init__(self, asset: Element) -> None:
        self._asset = asset
        self._names: dict[Shape, str] = {}

    def add(
        self,
        body: Element,
        name: str,
        placed: Iterable[Collision],
        contact: Mapping[str, str],
        rgba: Iterable[float],
    ) -> None:
        """Add shapes with the same attributes of `contact`, named by the part and their number.

        Raises DescriptionError for a mesh that cannot be read.
        """
        given = {**contact, "rgba": text(rgba)}
        for number, each in enumerate(placed):
            T = each.origin.matrix.copy()
            shape = each.shape
            if isinstance(shape, HeightField):
                T[:3, 3] += T[:3, 2] * np.min(shape.heights)
            attributes = {"name": f"{name}/{number}", **self._form(shape), **placement(T), **given}
            SubElement(body, "geom", attributes)

    def _form(self, shape: Shape) -> dict[str, str]:
        if isinstance(shape, Box):
            return {"type": "box", "size": text(0.5 * np.array(shape.size))}
        if isinstance(shape, Sphere):
            return {"type": "sphere", "size": text([shape.radius])}
        if isinstance(shape, Cylinder | Capsule):
            kind = "cylinder" if isinstance(shape, Cylinder) else "capsule"
            return {"type": kind, "size": text([shape.radius, 0.5 * shape.length])}
        if isinstance(shape, Plane):
            return {"type": "plane", "size": "0 0 1"}
        if isinstance(shape, HeightField):
            return {"type": "hfield", "hfield": self._field(shape)}
        return {"type": "mesh", "mesh": self._hull(shape)}

    def _field(self, shape: HeightField) -> str:
        if shape not in self._names:
            heights = np.array(shape.heights)
            span = max(float(np.ptp(heights)), MIN_HEIGHT_RANGE)
            # MuJoCo reads the rows of a document from the highest y to the lowest.
            rows = heights[::-1] - heights.min()
            SubElement(
                self._asset,
                "hfield",
                name=self._new_name("heights", shape),
                nrow=str(heights.shape[0]),
                ncol=str(heights.shape[1]),
                size=text([0.5 * shape.size[0], 0.5 * shape.size[1], span, shape.DEPTH]),
                elevation=text(rows.ravel()),
            )
        return self._names[shape]

    def _hull(self, shape: Mesh) -> str:
        if shape not in self._names:
            vertices, _ = shape.hull
            name = self._new_name("mesh", shape)
            # The moments of a shell need no volume, so that a tiny mesh is accepted too.
            SubElement(self._asset, "mesh", name=name, vertex=text(vertices.ravel()), inertia="shell")
        return self._names[shape]

    def _new_name(self, kind: str, shape: Shape) -> str:
        return self._names.setdefault(shape, f"{kind}{len(self._names)}")
