"""A mesh: the file of its triangles, read when they are first needed."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from functools import cached_property, lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from dynx.errors import ArgumentError, DescriptionError, DynxError, shown
from dynx.files.reading import checked_path, printable, read_file
from dynx.model.elements import Vector
from dynx.model.numbers import MAX_MAGNITUDE, finite_vector
from dynx.spatial.scalar import Floats

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


# Triangles of mesh files, checked before any engine sees them.


Triangles = tuple[Floats, NDArray[np.intp]]

MAX_TRIANGLES = 2_000_000
"""Largest number of triangles of a mesh."""

FORMATS = (".stl", ".obj", ".dae", ".gltf", ".glb")
"""Suffixes of the files that are read."""


def read_triangles(path: str) -> Triangles:
    """Return the vertices (n, 3) [m] and triangles (m, 3) of a mesh file, unscaled.

    The result is shared between calls until the file changes. Raises RobotNotFoundError for a missing file,
    DescriptionError for one that is too large, damaged, empty or of another format, NotInstalledError for
    glTF without trimesh.
    """
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return _checked(path)
    return _cached(path, status.st_mtime_ns, status.st_size)


# A robot names its meshes twice, and is often loaded into several engines.
@lru_cache(maxsize=64)
def _cached(path: str, changed: int, size: int) -> Triangles:
    return _checked(path)


def _checked(path: str) -> Triangles:
    suffix = os.path.splitext(path)[1].lower()
    if suffix not in FORMATS:
        raise _fault(path, f"has the suffix {shown(suffix)}; meshes are read from {', '.join(FORMATS)}")
    data = read_file(path)
    vertices, faces = _parsed(path, data, suffix)
    if len(faces) == 0:
        raise _fault(path, "holds no triangle")
    if len(faces) > MAX_TRIANGLES:
        raise _fault(path, f"holds {len(faces)} triangles; at most {MAX_TRIANGLES} are read")
    if not np.abs(vertices).max() < MAX_MAGNITUDE:
        raise _fault(path, f"holds a vertex that is not finite or not below {MAX_MAGNITUDE:g}")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise _fault(path, f"holds a triangle of a vertex that is not among its {len(vertices)}")
    vertices.flags.writeable = faces.flags.writeable = False
    return vertices, faces


def _parsed(path: str, data: bytes, suffix: str) -> Triangles:
    try:
        # Imported here, because nobody asks for the triangles of most robots, or they have no such meshes.
        if suffix in (".stl", ".obj"):
            from dynx.model.geometry.formats.facets import obj_triangles, stl_triangles

            return stl_triangles(data) if suffix == ".stl" else obj_triangles(data)
        if suffix == ".dae":
            from dynx.model.geometry.formats.collada import collada_triangles

            return collada_triangles(data)
        from dynx.model.geometry.formats.gltf import gltf_triangles

        return gltf_triangles(data, partial(_read_beside, path))
    except DynxError:
        raise
    # trimesh raises whatever exception damaged data lead to, as do lookups in the tree of such a file.
    except Exception as error:
        reason = str(error) if type(error) is ValueError else f"{type(error).__name__}: {error}"
        raise _fault(path, f"cannot be read as {suffix}: {reason}") from error


def _read_beside(path: str, name: str) -> bytes:
    """Return the bytes of a file in the folder of a mesh; ValueError for one outside."""
    folder = os.path.realpath(os.path.dirname(path))
    found = os.path.realpath(os.path.join(folder, name))
    if not found.startswith(os.path.join(folder, "")):
        raise ValueError(f"{shown(name, 200)} is outside the folder of the mesh")
    return read_file(found)


def _fault(path: str, message: str) -> DescriptionError:
    return DescriptionError(message, source=printable(path))


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
