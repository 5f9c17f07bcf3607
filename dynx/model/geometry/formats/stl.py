"""Triangles of STL files, binary or text."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from dynx.spatial.scalar import Floats

STL_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
"""A facet of a binary STL file."""

STL_HEAD = 84
"""Length of the head of a binary STL file [bytes], whose last four hold the number of facets."""

# Each line is matched in time proportional to its length: a pattern must not run across lines.
STL_VERTEX = re.compile(rb"^[ \t]*vertex[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.MULTILINE | re.IGNORECASE)
_END = re.compile(rb"^[ \t]*endloop\b", re.MULTILINE | re.IGNORECASE)


def stl_triangles(data: bytes) -> tuple[Floats, NDArray[np.intp]]:
    """Return the corners (3 m, 3) of the facets, and the numbers of each facet's corners (m, 3).

    A binary file is known by its length, since some begin with "solid" too. Raises ValueError for a damaged
    file.
    """
    if len(data) >= STL_HEAD:
        count = int.from_bytes(data[80:84], "little")
        length = STL_HEAD + STL_FACET.itemsize * count
        is_text = data.lstrip()[:5].lower() == b"solid"
        if len(data) == length or (len(data) > length and count > 0 and not is_text):
            corners = np.frombuffer(data, STL_FACET, count, STL_HEAD)["corners"]
            return _numbered(corners.reshape(-1, 3).astype(np.float64))
        if not is_text:
            raise ValueError(
                f"it is truncated: {count} triangles take {length} bytes, and it has {len(data)}"
                if count
                else "it has no triangle"
            )
    elif data.lstrip()[:5].lower() != b"solid":
        raise ValueError(f"it is truncated: the head of a binary file takes 84 bytes, and it has {len(data)}")
    lines = data.replace(b"\r", b"\n")
    found = (float(number) for match in STL_VERTEX.finditer(lines) for number in match.groups())
    vertices = np.fromiter(found, np.float64).reshape(-1, 3)
    loops = sum(1 for _ in _END.finditer(lines))
    if len(vertices) != 3 * loops:
        raise ValueError(f"it is truncated: {len(vertices)} corners in {loops} closed loops of three")
    return _numbered(vertices)


def _numbered(corners: Floats) -> tuple[Floats, NDArray[np.intp]]:
    return corners, np.arange(len(corners), dtype=np.intp).reshape(-1, 3)
