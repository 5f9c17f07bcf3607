"""Shapes as triangles for the page."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.model.geometry import Box, Capsule, Cylinder, HeightField, Mesh, Plane, Shape, Sphere
from dynx.spatial.scalar import Floats

_SEGMENTS = 32
"""Number of sides of round shapes."""

_GROUND_SIDE = 40.0
"""Length [m] of the sides of the square that stands for a plane without end."""


class Triangles(NamedTuple):
    """Vertices (n, 3) [m] and the vertices of each triangle (m, 3), counter-clockwise from outside."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]

    @classmethod
    def of(cls, vertices: NDArray[np.generic], faces: NDArray[np.generic]) -> Triangles:
        """Return vertices and faces of any type of number as triangles."""
        return cls(np.asarray(vertices, dtype=np.float32), np.asarray(faces, dtype=np.uint32))


def triangles_of(shape: Shape) -> Triangles:
    """Return a shape as triangles.

    Raises DescriptionError for a mesh that cannot be read.
    """
    if isinstance(shape, Mesh):
        return Triangles.of(*shape.triangles)
    if isinstance(shape, HeightField):
        return Triangles.of(*shape.triangles())
    return _primitive(shape)


def hull_of(shape: Shape) -> Triangles:
    """Return a shape as engines collide it: a mesh as its convex hull.

    Raises DescriptionError for a mesh that cannot be read.
    """
    return Triangles.of(*shape.hull) if isinstance(shape, Mesh) else triangles_of(shape)


def resized(triangles: Triangles, factor: float) -> Triangles:
    """Return triangles of another size, about the middle of the box around them."""
    if factor == 1.0:
        return triangles
    vertices = triangles.vertices
    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    return Triangles.of(middle + factor * (vertices - middle), triangles.faces)


def distinct_rows(rows: NDArray[np.integer[Any]]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return where each distinct row of non-negative integers (n, 3) occurs first, and the number of each row
    among these.

    The three numbers are joined to one where it can hold them: numbers are sorted ten times faster than rows.
    """
    sizes = [int(column.max(initial=0)) + 1 for column in rows.T]
    if math.prod(sizes) < 2**63:
        joined = (rows[:, 0].astype(np.int64) * sizes[1] + rows[:, 1]) * sizes[2] + rows[:, 2]
        _, first, number = np.unique(joined, return_index=True, return_inverse=True)
    else:
        _, first, number = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return first, number.reshape(-1)


@lru_cache(maxsize=256)
def _primitive(shape: Shape) -> Triangles:
    if isinstance(shape, Box):
        return _box(np.array(shape.size))
    if isinstance(shape, Sphere):
        return _revolved(*_arc(shape.radius, 0.0))
    if isinstance(shape, Capsule):
        return _revolved(*_arc(shape.radius, 0.5 * shape.length))
    if isinstance(shape, Cylinder):
        r, h = shape.radius, 0.5 * shape.length
        # Rows of vertices at the edges stand twice, so that the edges stay sharp when normals are averaged.
        return _revolved(np.array([0.0, r, r, r, r, 0.0]), np.array([-h, -h, -h, h, h, h]))
    if isinstance(shape, Plane):
        half = 0.5 * _GROUND_SIDE
        corners = [[-half, -half, 0.0], [half, -half, 0.0], [half, half, 0.0], [-half, half, 0.0]]
        return Triangles.of(np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]))
    raise TypeError(f"no triangles of a {type(shape).__name__}")


def _box(size: Floats) -> Triangles:
    signs = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    # Each face has vertices of its own, so that its edges stay sharp when normals are averaged.
    vertices = (signs * size)[quads].reshape(-1, 3)
    first = np.arange(0, 24, 4)[:, None]
    return Triangles.of(vertices, np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])]))


def _arc(radius: float, half_length: float) -> tuple[Floats, Floats]:
    """Return radius and height along the profile of a ball that is cut in two, from its lowest point up."""
    angle = np.linspace(-0.5 * math.pi, 0.5 * math.pi, _SEGMENTS // 2 + 1)
    apart = np.where(angle < 0.0, -half_length, half_length)
    middle = len(angle) // 2
    r, z = radius * np.cos(angle), radius * np.sin(angle) + apart
    r[0] = r[-1] = 0.0
    if half_length:
        r = np.insert(r, middle, radius)
        z = np.insert(z, middle, -half_length)
    return r, z


def _revolved(radius: Floats, height: Floats) -> Triangles:
    """Return the surface that a profile from the axis back to the axis sweeps around z."""
    angle = np.linspace(0.0, 2.0 * math.pi, _SEGMENTS, endpoint=False)
    x, y = np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle))
    vertices = np.stack([x, y, np.repeat(height[:, None], _SEGMENTS, axis=1)], axis=-1).reshape(-1, 3)
    row = np.arange(len(radius) - 1)[:, None] * _SEGMENTS
    here, along = row + np.arange(_SEGMENTS), row + (np.arange(_SEGMENTS) + 1) % _SEGMENTS
    faces = np.concatenate(
        [
            np.stack([here, along, along + _SEGMENTS], axis=-1).reshape(-1, 3),
            np.stack([here, along + _SEGMENTS, here + _SEGMENTS], axis=-1).reshape(-1, 3),
        ]
    )
    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return Triangles.of(vertices, faces[area > 1e-9 * area.max()])
