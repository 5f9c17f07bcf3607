"""Triangles of Wavefront OBJ files; materials and the files that they name are ignored."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dynx.errors import shown
from dynx.spatial.scalar import Floats


def obj_triangles(data: bytes) -> tuple[Floats, NDArray[np.intp]]:
    """Return the vertices (n, 3) and triangles (m, 3) of all objects; polygons are divided into fans.

    Raises ValueError, with the line, for a damaged file.
    """
    numbers: list[float] = []
    corners: list[int] = []
    text = data.replace(b"\\\r\n", b"  ").replace(b"\\\n", b" ")
    for line, words in enumerate(map(bytes.split, text.splitlines()), start=1):
        if not words:
            continue
        try:
            if words[0] == b"v":
                numbers += _vertex(words)
            elif words[0] == b"f":
                corners += _fan(words[1:], len(numbers) // 3)
        except ValueError as error:
            raise ValueError(f"line {line}: {error}") from None
    faces = np.array(corners, np.intp).reshape(-1, 3)
    vertices = np.array(numbers, np.float64).reshape(-1, 3)
    if faces.size and faces.max() >= len(vertices):
        raise ValueError(f"a face names vertex {faces.max() + 1}, and the file has {len(vertices)}")
    return vertices, faces


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
