"""A mesh: the file of its triangles, read when they are first needed."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dynx.errors import ArgumentError, DescriptionError, shown
from dynx.files.reading import checked_path
from dynx.model.elements import Vector
from dynx.model.geometry.hull import convex_hull
from dynx.model.geometry.mesh_reading import Triangles, read_triangles
from dynx.model.geometry.sizes import finite_vector
from dynx.spatial.scalar import Floats

Faces = NDArray[np.intp]


@dataclass(frozen=True)
class Mesh:
    """The triangles in `file`, scaled along x, y and z; a negative scale mirrors.

    STL, OBJ, COLLADA (.dae) and glTF (.gltf, .glb) are read, when `triangles` or `hull` is first used. On
    every engine a mesh collides as its convex hull.
    """

    file: str
    scale: Vector = (1.0, 1.0, 1.0)
    fault: DescriptionError | None = field(default=None, compare=False, repr=False)
    """The error of a description whose mesh was not found; raised when the mesh is read."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "file", checked_path(self.file))
        if not self.file:
            raise ArgumentError("the file of a mesh is empty; wanted a path")
        scale = finite_vector("scale of a mesh", self.scale)
        if 0.0 in scale:
            raise ArgumentError(f"scale of a mesh is {scale}; wanted no zero")
        object.__setattr__(self, "scale", scale)

    @property
    def name(self) -> str:
        """Name of the file without its folder."""
        return os.path.basename(self.file)

    @cached_property
    def triangles(self) -> tuple[Floats, Faces]:
        """Vertices (n, 3) [m], scaled, and the vertices of each triangle (m, 3), counter-clockwise from
        outside.

        Raises DescriptionError for a file that cannot be read or holds no usable triangles,
        NotInstalledError without trimesh.
        """
        vertices, faces = self._read()
        scaled = vertices * np.array(self.scale)
        if not np.isfinite(scaled).all():
            raise DescriptionError(f"the scale {self.scale} overflows a vertex", source=shown(self.file, 300))
        # A mirrored triangle is seen from behind.
        mirrored = np.prod(np.sign(self.scale)) < 0.0
        return scaled, faces[:, ::-1] if mirrored else faces

    @cached_property
    def hull(self) -> tuple[Floats, Faces]:
        """Convex hull of the triangles: vertices (n, 3) [m] and triangles (m, 3).

        A flat mesh gives its flat hull, with triangles on both sides. Raises the errors of `triangles`, and
        DescriptionError for a mesh without extent in two directions.
        """
        vertices, faces = self.triangles
        try:
            return convex_hull(vertices[np.unique(faces)])
        except ArgumentError as error:
            raise DescriptionError(str(error), source=shown(self.file, 300)) from None

    def _read(self) -> Triangles:
        if self.fault is not None:
            raise self.fault
        return read_triangles(self.file)

    def __getstate__(self) -> dict[str, object]:
        return {name: value for name, value in self.__dict__.items() if name in self.__dataclass_fields__}
