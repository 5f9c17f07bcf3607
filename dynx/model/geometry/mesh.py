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

# Convex hulls of points. No other module of geometry imports SciPy.


FLATNESS = 1e-4
"""Thickness of the hull of flat points, relative to its diagonal."""


def convex_hull(points: Floats) -> tuple[Floats, NDArray[np.intp]]:
    """Return the vertices (n, 3) of the hull of `points` and its triangles (m, 3), counter-clockwise from
    outside.

    Flat points, which bound no volume, get a thickness of `FLATNESS` times the diagonal of their box, half of
    it on each side, because engines refuse a flat solid. Raises ArgumentError for points on one line.
    """
    center = points.mean(axis=0)
    _, extents, axes = np.linalg.svd(points - center, full_matrices=False)
    rounding = 1e-9 * np.sqrt(len(points))
    if len(points) < 3 or extents[1] <= rounding * extents[0]:
        raise ArgumentError("all points of the mesh lie on one line, so that it has no hull")
    thickness = float(np.ptp((points - center) @ axes[2]))
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    if thickness < FLATNESS * diagonal:
        offset = 0.5 * (FLATNESS * diagonal - thickness) * axes[2]
        points = np.concatenate([points - offset, points + offset])
    return _hull_of_solid(points)


def _hull_of_solid(points: Floats) -> tuple[Floats, NDArray[np.intp]]:
    from scipy.spatial import ConvexHull, QhullError

    # Qhull's tolerances are absolute, so points are scaled to a box of size 1.
    low = points.min(axis=0)
    scale = float(np.max(np.ptp(points, axis=0)))
    try:
        hull = ConvexHull((points - low) / scale)
    except QhullError:
        raise ArgumentError("the points of the mesh are too close to a plane to have a hull") from None
    used, faces = np.unique(hull.simplices, return_inverse=True)
    faces = faces.reshape(-1, 3)
    vertices = points[used]
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.einsum("ij,ij->i", normals, hull.equations[:, :3]) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return vertices, faces.astype(np.intp)


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
    """Number of those triangles of the file that alone are meant, by their look; None for all, of any."""

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

    @cached_property
    def parts(self) -> tuple[tuple[Mesh, SurfacePart], ...]:
        """The triangles as the file divides them by their look: meshes of those of one colour or image.

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
        """What of the look that the file describes is not drawn, one sentence each."""
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
