"""Bounding boxes of meshes in STL, OBJ and COLLADA files, of which only the vertices are read."""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path

import numpy as np

from dynx.errors import DynxError
from dynx.files.reading import read_file
from dynx.model.geometry.formats.collada import collada_points
from dynx.model.geometry.formats.stl import STL_FACET, STL_HEAD, STL_VERTEX
from dynx.spatial.scalar import Floats

Box = tuple[tuple[float, float, float], tuple[float, float, float]]

# Each line is matched in time proportional to its length: a pattern must not run across lines, nor start
# again within a run of blanks.
_OBJ_VERTEX = re.compile(rb"^[ \t]*v[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.MULTILINE)


def mesh_box(path: Path, *, by_bullet: bool = False) -> Box | None:
    """Return the lowest and highest corner of a mesh in its own frame, unscaled; None if it is unreadable.

    Programs differ on the up axis of COLLADA; the box contains the mesh as each of them places it. With
    `by_bullet` it is the box of PyBullet, which ignores that axis and points without a face, and cannot read
    STL in text form. Time and memory are proportional to the size of the file; a file above MAX_BYTES of
    `dynx.files` is unreadable.
    """
    try:
        status = path.stat()
    except (OSError, ValueError):
        return None
    return _box(path, by_bullet, status.st_mtime_ns, status.st_size)


def is_mesh_format(path: Path) -> bool:
    """Check whether the suffix of a file is that of a format that `mesh_box` reads."""
    return path.suffix.lower() in _READERS


# Cached, because detection runs again after every remedy, and remedies change no mesh.
@lru_cache(maxsize=4096)
def _box(path: Path, by_bullet: bool, changed: int, size: int) -> Box | None:
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        return None
    try:
        with np.errstate(all="ignore"):
            points = reader(read_file(str(path)), by_bullet)
    except (DynxError, ValueError):
        return None
    if points is None or len(points) == 0 or not np.isfinite(points).all():
        return None
    low, high = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    return (low[0], low[1], low[2]), (high[0], high[1], high[2])


def _stl_points(data: bytes, by_bullet: bool) -> Floats | None:
    """Return the corners of the facets. A binary file is known by its length, since some begin with "solid"
    too."""
    if len(data) >= STL_HEAD:
        count = int.from_bytes(data[80:84], "little")
        if len(data) == STL_HEAD + STL_FACET.itemsize * count:
            corners = np.frombuffer(data, STL_FACET, count, STL_HEAD)["corners"]
            return corners.reshape(-1, 3).astype(np.float64)
    is_text = data.lstrip()[:5].lower() == b"solid" and not by_bullet
    return _vertices(STL_VERTEX, data) if is_text else None


def _obj_points(data: bytes, by_bullet: bool) -> Floats | None:
    return _vertices(_OBJ_VERTEX, data)


def _collada_points(data: bytes, by_bullet: bool) -> Floats | None:
    return collada_points(data, by_bullet=by_bullet)


_READERS = {".stl": _stl_points, ".obj": _obj_points, ".dae": _collada_points}


def _vertices(pattern: re.Pattern[bytes], data: bytes) -> Floats:
    """Read the three numbers of every line that matches; a carriage return ends a line as well."""
    lines = data.replace(b"\r", b"\n")
    found = (float(number) for match in pattern.finditer(lines) for number in match.groups())
    return np.fromiter(found, np.float64).reshape(-1, 3)
