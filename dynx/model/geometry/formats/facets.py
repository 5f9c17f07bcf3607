"""Readers of meshes that list facets: STL, in text and binary, and OBJ."""

from __future__ import annotations

import re
from array import array

import numpy as np
from numpy.typing import NDArray

from dynx.errors import shown
from dynx.spatial.scalar import Floats

# Triangles of STL files, binary or text.


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


# Triangles of Wavefront OBJ files; materials and the files that they name are ignored.


LONGEST_LINE = 2**20
"""Largest length of a line of an OBJ file, such as a polygon of 100,000 corners [bytes]."""

MAX_VERTICES = 6_000_000
"""Largest number of vertices of an OBJ file."""

_LINE_END = re.compile(rb"\r\n|[\r\n]")
_VERTEX_FACE_OR_OBJECT = re.compile(rb"(?<![^\r\n])[ \t\f\v]*[vfog](?:[ \t\f\v][^\r\n]*|(?=[\r\n]|\Z))")


def obj_triangles(data: bytes) -> tuple[Floats, NDArray[np.intp]]:
    """Return the vertices (n, 3) and triangles (m, 3) of all objects; polygons are divided into fans.

    Raises ValueError, with the line, for a damaged file.
    """
    vertices, faces, _ = _obj(data)
    return vertices, faces


def obj_objects(data: bytes) -> list[NDArray[np.intp]]:
    """Return the triangles (m, 3) of each object and group that has some, in the order of the file.

    Raises ValueError, with the line, for a damaged file.
    """
    _, faces, starts = _obj(data)
    return [each for each in np.split(faces, starts) if len(each)]


def _obj(data: bytes) -> tuple[Floats, NDArray[np.intp], list[int]]:
    """Return the vertices (n, 3) and triangles (m, 3) of a file, and the number of triangles before each line
    that begins an object or a group."""
    # Lists of Python's numbers would take five times the memory.
    numbers, corners = array("d"), array("q")
    text = data.replace(b"\\\r\n", b"  ").replace(b"\\\n", b" ")
    start, starts = 0, []
    try:
        for match in _VERTEX_FACE_OR_OBJECT.finditer(text):
            start = match.start()
            if match.end() - start > LONGEST_LINE:
                raise ValueError(f"it has more than {LONGEST_LINE:,} bytes")
            words = match[0].split()
            if words[0] == b"v":
                numbers.extend(_vertex(words))
            elif words[0] != b"f":
                starts.append(len(corners) // 3)
            else:
                corners.extend(_fan(words[1:], len(numbers) // 3))
            if len(numbers) > 3 * MAX_VERTICES:
                raise ValueError(f"the file has more than {MAX_VERTICES:,} vertices")
    except ValueError as error:
        line = 1 + sum(1 for _ in _LINE_END.finditer(text, 0, start))
        raise ValueError(f"line {line}: {error}") from None
    faces = np.array(corners, np.intp).reshape(-1, 3)
    vertices = np.array(numbers, np.float64).reshape(-1, 3)
    if faces.size and faces.max() >= len(vertices):
        raise ValueError(f"a face names vertex {faces.max() + 1}, and the file has {len(vertices)}")
    return vertices, faces, starts


def _vertex(words: list[bytes]) -> tuple[float, float, float]:
    if len(words) < 4:
        raise ValueError(f"a vertex has {len(words) - 1} numbers; wanted three")
    return float(words[1]), float(words[2]), float(words[3])


def _fan(words: list[bytes], count: int) -> list[int]:
    """Return the corners of the triangles of a polygon; a negative number counts back from vertex `count`."""
    if len(words) < 3:
        raise ValueError(f"a face has {len(words)} corners; wanted three or more")
    rows = []
    for word in words:
        number = int(word.partition(b"/")[0])
        row = number - 1 if number > 0 else count + number
        if number == 0 or row < 0:
            raise ValueError(f"a face names vertex {shown(number)}; the first is 1, the last before it -1")
        rows.append(row)
    if len(rows) == 3:
        return rows
    return [row for k in range(1, len(rows) - 1) for row in (rows[0], rows[k], rows[k + 1])]
