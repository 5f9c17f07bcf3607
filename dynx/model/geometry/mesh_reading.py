"""Triangles of mesh files, read by trimesh and checked before any engine sees them."""

from __future__ import annotations

import io
import os
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.errors import DescriptionError, NotInstalledError, shown
from dynx.files.reading import printable, read_file
from dynx.model.configuration import MAX_MAGNITUDE
from dynx.spatial.scalar import Floats

Triangles = tuple[Floats, NDArray[np.intp]]

MAX_TRIANGLES = 2_000_000
"""Largest number of triangles of a mesh."""

FORMATS = (".stl", ".obj", ".dae", ".gltf", ".glb")
"""Suffixes of the files that are read."""


def read_triangles(path: str) -> Triangles:
    """Return the vertices (n, 3) [m] and triangles (m, 3) of a mesh file, unscaled.

    The result is shared between calls until the file changes. Raises RobotNotFoundError for a missing file,
    DescriptionError for one that is too large, damaged, empty or of another format, NotInstalledError without
    trimesh.
    """
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return _checked(path)
    return _cached(path, status.st_mtime_ns, status.st_size)


# A robot names its meshes twice, and is often loaded into several engines.
@lru_cache(maxsize=256)
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
    library = _trimesh()
    try:
        scene: Any = library.load_scene(io.BytesIO(data), file_type=suffix[1:], process=False)
        mesh: Any = scene.to_mesh()
    # The parsers of trimesh raise whatever exception damaged data lead to.
    except Exception as error:
        raise _fault(path, f"cannot be read as {suffix}: {type(error).__name__}: {error}") from error
    return np.array(mesh.vertices, np.float64), np.array(mesh.faces, np.intp)


def _trimesh() -> Any:
    try:
        import trimesh
    except ImportError as error:
        raise NotInstalledError("meshes are read by trimesh: pip install 'dynx[world]'") from error
    return trimesh


def _fault(path: str, message: str) -> DescriptionError:
    return DescriptionError(message, source=printable(path))
