"""A mesh: the file of its triangles, read when they are first needed."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dynx.errors import ArgumentError, DescriptionError, shown
from dynx.files.reading import checked_path
from dynx.model.elements import Vector
from dynx.model.numbers import finite_vector
from dynx.spatial.scalar import Floats

if TYPE_CHECKING:
    from dynx.model.geometry.mesh_reading import Surface, SurfacePart

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
    part: int | None = None
    """Number of the part in `parts` of the whole file of which the mesh consists; None for all triangles."""

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
        # Imported here, because SciPy takes long to load.
        from dynx.model.geometry.hulls import convex_hull

        vertices, faces = self.triangles
        try:
            return convex_hull(vertices[np.unique(faces)])
        except ArgumentError as error:
            raise DescriptionError(str(error), source=shown(self.file, 300)) from None

    @cached_property
    def parts(self) -> tuple[tuple[Mesh, SurfacePart], ...]:
        """The triangles divided by colour and image: one mesh for each colour or image of the file.

        Raises the errors of `triangles`.
        """
        # Imported here and below, because meshes of most robots are never read.
        from dynx.model.geometry.mesh_reading import mesh_file

        if self.fault is not None:
            raise self.fault
        found = mesh_file(self.file).parts
        if self.part is not None:
            return ((self, found[self.part]),)
        return tuple((replace(self, part=k), each) for k, each in enumerate(found))

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on colours and images of the file that are not drawn."""
        from dynx.model.geometry.mesh_reading import mesh_file

        if self.fault is not None:
            raise self.fault
        return mesh_file(self.file).notes

    @cached_property
    def surface(self) -> Surface:
        """The triangles with normals, and with images and colours that vary over a part. Raises the errors of
        `triangles`."""
        from dynx.model.geometry.mesh_reading import mesh_file

        if self.fault is not None:
            raise self.fault
        return mesh_file(self.file).surface(self.part, np.array(self.scale))

    def _read(self) -> tuple[Floats, Faces]:
        from dynx.model.geometry.mesh_reading import read_triangles

        if self.fault is not None:
            raise self.fault
        return read_triangles(self.file, self.part)

    def __getstate__(self) -> dict[str, object]:
        return {name: value for name, value in self.__dict__.items() if name in self.__dataclass_fields__}
