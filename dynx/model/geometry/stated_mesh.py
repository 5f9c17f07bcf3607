"""A mesh whose triangles a description states itself, so that no file is needed."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from dynx.errors import ArgumentError, DescriptionError, ShapeError, shown
from dynx.model.elements import Vector
from dynx.model.geometry.mesh import Faces, Mesh
from dynx.model.geometry.mesh_reading import Surface, SurfacePart
from dynx.model.numbers import checked_entries, finite_vector, real_array
from dynx.spatial.scalar import Floats


@dataclass(frozen=True)
class StatedMesh(Mesh):
    """The triangles `corners` of the vertices `points` [m], scaled along x, y and z; without triangles the
    convex hull of the points."""

    file: str = ""
    """Empty: there is none."""
    points: tuple[Vector, ...] = ()
    corners: tuple[tuple[int, int, int], ...] = ()
    """Numbers of the vertices of each triangle, counter-clockwise from outside."""
    label: str = field(default="mesh", compare=False)
    """Name in messages, and of the file where one is written."""

    def __post_init__(self) -> None:
        points = checked_entries("points of a mesh", real_array("points of a mesh", self.points))
        if points.ndim != 2 or points.shape[1] != 3 or not len(points):
            raise ShapeError(f"points of a mesh have shape {points.shape}; wanted (n, 3)")
        corners = np.array(self.corners, dtype=np.intp).reshape(-1, 3)
        if len(corners) and not 0 <= corners.min() <= corners.max() < len(points):
            found = corners.min() if corners.min() < 0 else corners.max()
            raise ArgumentError(
                f"a triangle of {shown(self.label)} has the vertex {found}; wanted 0 to {len(points) - 1}"
            )
        scale = finite_vector("scale of a mesh", self.scale)
        if 0.0 in scale:
            raise ArgumentError(f"scale of a mesh is {scale}; wanted no zero")
        object.__setattr__(self, "scale", scale)
        object.__setattr__(self, "points", tuple(map(tuple, points.tolist())))
        object.__setattr__(self, "corners", tuple(map(tuple, corners.tolist())))

    @property
    def name(self) -> str:
        """Name of the mesh in the description."""
        return self.label

    @cached_property
    def parts(self) -> tuple[tuple[Mesh, SurfacePart], ...]:
        """The mesh itself, which has no colours of its own."""
        return ((self, SurfacePart(np.arange(len(self.triangles[1])), None)),)

    @property
    def notes(self) -> tuple[str, ...]:
        """Nothing: all of it is drawn."""
        return ()

    @cached_property
    def surface(self) -> Surface:
        """The triangles, flat between their edges."""
        return Surface(*self.triangles)

    def _read(self) -> tuple[Floats, Faces]:
        points = np.array(self.points)
        if self.fault is not None:
            raise self.fault
        if self.corners:
            return points, np.array(self.corners, dtype=np.intp)
        from dynx.model.geometry.hulls import convex_hull

        try:
            return convex_hull(points)
        except ArgumentError as error:
            raise DescriptionError(str(error), source=shown(self.label)) from None
