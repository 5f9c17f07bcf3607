"""Shapes of a scene as those of Drake. A height field becomes a prism below each of its triangles, because
Drake takes a mesh in contact as its convex hull."""

from __future__ import annotations

import numpy as np

from dynx.engines.drake.library import geometry
from dynx.errors import EngineLimitError
from dynx.model.geometry import Box, Capsule, Cylinder, HeightField, Mesh, Plane, Shape, Sphere
from dynx.spatial.scalar import Floats

MAX_TRIANGLES = 20_000
"""Largest number of triangles of a height field, each of which is a shape of its own."""


def drake_shapes(shape: Shape) -> list[object]:
    """Return Drake's shape, or several with one frame. Raises EngineLimitError for too fine a height
    field."""
    if isinstance(shape, Box):
        return [geometry.Box(*shape.size)]
    if isinstance(shape, Sphere):
        return [geometry.Sphere(shape.radius)]
    if isinstance(shape, Cylinder):
        return [geometry.Cylinder(shape.radius, shape.length)]
    if isinstance(shape, Capsule):
        return [geometry.Capsule(shape.radius, shape.length)]
    if isinstance(shape, Plane):
        return [geometry.HalfSpace()]
    if isinstance(shape, Mesh):
        return [_convex(shape.hull[0], shape.name)]
    assert isinstance(shape, HeightField)
    return _prisms(shape)


def _prisms(shape: HeightField) -> list[object]:
    vertices, faces = shape.triangles()
    if len(faces) > MAX_TRIANGLES:
        raise EngineLimitError(
            f"a height field has {len(faces)} triangles; 'drake' takes at most {MAX_TRIANGLES}"
        )
    tops = vertices[faces]
    bottoms = tops.copy()
    bottoms[:, :, 2] = vertices[:, 2].min() - shape.DEPTH
    prisms = np.concatenate([tops, bottoms], axis=1)
    return [_convex(points, "height field") for points in prisms]


def _convex(points: Floats, label: str) -> object:
    shape: object = geometry.Convex(np.ascontiguousarray(points.T), label.replace("\n", " "))
    return shape
