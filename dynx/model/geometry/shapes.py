"""Primitive shapes, each centred in its own frame with z as its axis, and the grounds of scenes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from dynx.errors import ArgumentError, ShapeError
from dynx.model.elements import Vector
from dynx.model.numbers import checked_entries, positive_number, positive_numbers, real_array


@dataclass(frozen=True)
class Box:
    """A box with the edge lengths `size` [m] along x, y and z."""

    size: Vector

    def __post_init__(self) -> None:
        object.__setattr__(self, "size", positive_numbers("size of a box", self.size, 3))


@dataclass(frozen=True)
class Sphere:
    """A ball of `radius` [m]."""

    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", positive_number("radius of a sphere", self.radius))


@dataclass(frozen=True)
class Cylinder:
    """A cylinder of `radius` and `length` [m] about z."""

    radius: float
    length: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", positive_number("radius of a cylinder", self.radius))
        object.__setattr__(self, "length", positive_number("length of a cylinder", self.length))


@dataclass(frozen=True)
class Capsule:
    """A cylinder of `radius` and `length` [m] about z, with a half ball of that radius on each end.

    The whole capsule is ``length + 2 * radius`` long.
    """

    radius: float
    length: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", positive_number("radius of a capsule", self.radius))
        object.__setattr__(self, "length", positive_number("length of a capsule", self.length))


@dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid with the half axes `radii` [m] along x, y and z."""

    radii: Vector

    def __post_init__(self) -> None:
        object.__setattr__(self, "radii", positive_numbers("radii of an ellipsoid", self.radii, 3))

    def triangles(self) -> tuple[np.ndarray, np.ndarray]:
        """Return a polyhedron near the surface: vertices (n, 3) [m] and outward triangles (m, 3)."""
        from dynx.model.geometry.triangulation import ellipsoid_triangles

        return ellipsoid_triangles(np.array(self.radii))


@dataclass(frozen=True)
class Plane:
    """The half-space z <= 0: a ground without end, for bodies that are fixed in the world."""


MAX_HEIGHTS = 4_000_000
"""Largest number of points of a height field."""


@dataclass(frozen=True)
class HeightField:
    """A ground with height `heights[row][column]` [m] on a regular grid, for bodies fixed in the world.

    The grid spans `size` [m] along x and y and is centred in the shape's frame. Columns run from -size[0] / 2
    to size[0] / 2 along x, and rows from -size[1] / 2 to size[1] / 2 along y. Heights are measured along z
    from the origin of the frame. Each cell is two triangles, divided by the diagonal from its corner of
    lowest x and y to that of highest x and y.
    """

    heights: tuple[tuple[float, ...], ...]
    size: tuple[float, float]

    DEPTH: ClassVar[float] = 1.0
    """Depth [m] of the solid below the lowest point of every height field."""

    def __post_init__(self) -> None:
        array = checked_entries("heights", real_array("heights", self.heights))
        if array.ndim != 2 or min(array.shape) < 2:
            raise ShapeError(f"heights has shape {array.shape}; wanted (rows, columns), at least 2 of each")
        if array.size > MAX_HEIGHTS:
            raise ArgumentError(f"heights has {array.size} points; at most {MAX_HEIGHTS} are accepted")
        object.__setattr__(self, "heights", tuple(map(tuple, array.tolist())))
        object.__setattr__(self, "size", positive_numbers("size of a height field", self.size, 2))

    def triangles(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the surface: vertices (n, 3) [m] and the vertices of each triangle (m, 3), seen from above
        counter-clockwise."""
        from dynx.model.geometry.triangulation import grid_triangles

        return grid_triangles(np.array(self.heights), self.size)
