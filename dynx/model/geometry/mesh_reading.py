"""Triangles of mesh files, checked before any engine sees them."""

from __future__ import annotations

import os
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from dynx.errors import DescriptionError, DynxError, shown
from dynx.files.reading import printable, read_file
from dynx.model.geometry.formats.collada import collada_triangles
from dynx.model.geometry.formats.gltf import gltf_triangles
from dynx.model.geometry.formats.obj import obj_triangles
from dynx.model.geometry.formats.stl import stl_triangles
from dynx.model.numbers import MAX_MAGNITUDE
from dynx.spatial.scalar import Floats

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
        if suffix == ".stl":
            return stl_triangles(data)
        if suffix == ".obj":
            return obj_triangles(data)
        if suffix == ".dae":
            return collada_triangles(data)
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
