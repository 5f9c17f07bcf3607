"""Grid of a height field, in its own frame: vertices, cells and heights."""

from __future__ import annotations

import numpy as np

from dynx.model.geometry import HeightField
from dynx.spatial.plain import Vector3
from dynx.spatial.scalar import Floats

GridPoint = tuple[int, int]
"""Row and column of a vertex."""


class Terrain:
    """The grid of a height field, in its own frame."""

    def __init__(self, shape: HeightField) -> None:
        self.heights: Floats = np.array(shape.heights)
        rows, columns = self.heights.shape
        self.rows, self.columns = int(rows), int(columns)
        self.width, self.depth = shape.size
        self.bottom = float(self.heights.min()) - shape.DEPTH
        """Height of the lower side of the ground."""
        self.dx, self.dy = self.width / (self.columns - 1), self.depth / (self.rows - 1)

    def vertex(self, row: int, column: int) -> Vector3:
        """Return a vertex of the grid."""
        x, y = column * self.dx - 0.5 * self.width, row * self.dy - 0.5 * self.depth
        return x, y, float(self.heights[row, column])

    def number(self, row: int, column: int) -> int:
        """Return the number of a vertex."""
        return row * self.columns + column

    def height(self, x: float, y: float) -> float:
        """Return the height of the surface at a place; beyond the border that of the border."""
        u = min(max((x + 0.5 * self.width) / self.dx, 0.0), self.columns - 1.0)
        v = min(max((y + 0.5 * self.depth) / self.dy, 0.0), self.rows - 1.0)
        column, row = min(int(u), self.columns - 2), min(int(v), self.rows - 2)
        u, v = u - column, v - row
        corners: list[list[float]] = self.heights[row : row + 2, column : column + 2].tolist()
        (low, right), (above, across) = corners
        first, second = (right - low, across - right) if u >= v else (across - above, above - low)
        return low + u * first + v * second

    def triangles(self, rows: range, columns: range) -> tuple[Floats, Floats]:
        """Return the first vertices (n, 3) and the upward unit normals (n, 3) of the triangles of some cells,
        two of each cell, row by row: below the diagonal, and above it."""
        heights = self.heights[rows[0] : rows[-1] + 2, columns[0] : columns[-1] + 2]
        low, right, above, across = heights[:-1, :-1], heights[:-1, 1:], heights[1:, :-1], heights[1:, 1:]
        slopes = np.ones((*low.shape, 2, 3))
        slopes[..., 0, 0], slopes[..., 0, 1] = (low - right) / self.dx, (right - across) / self.dy
        slopes[..., 1, 0], slopes[..., 1, 1] = (above - across) / self.dx, (low - above) / self.dy
        tops = np.empty_like(slopes)
        tops[..., 0] = (np.arange(columns[0], columns[-1] + 1) * self.dx - 0.5 * self.width)[None, :, None]
        tops[..., 1] = (np.arange(rows[0], rows[-1] + 1) * self.dy - 0.5 * self.depth)[:, None, None]
        tops[..., 2] = low[:, :, None]
        normals = slopes / np.linalg.norm(slopes, axis=-1, keepdims=True)
        return tops.reshape(-1, 3), normals.reshape(-1, 3)

    def around(self, row: int, column: int) -> list[Vector3]:
        """Return the vertices that edges connect with a vertex."""
        return [
            self.vertex(row + i, column + j)
            for i, j in ((0, 1), (1, 1), (1, 0), (0, -1), (-1, -1), (-1, 0))
            if 0 <= row + i < self.rows and 0 <= column + j < self.columns
        ]

    def cells(self, lower: Floats, upper: Floats) -> tuple[range, range]:
        """Return the rows and columns of the cells that a box (3,) to (3,) is above or below."""
        first = np.floor((lower[:2] + 0.5 * np.array([self.width, self.depth])) / (self.dx, self.dy))
        last = np.floor((upper[:2] + 0.5 * np.array([self.width, self.depth])) / (self.dx, self.dy))
        most = np.array([self.columns - 2, self.rows - 2])
        (c0, r0), (c1, r1) = np.clip(first, 0, most).astype(int), np.clip(last, 0, most).astype(int)
        outside = (last < 0).any() or (first > most + 1).any()
        return (range(0), range(0)) if outside else (range(r0, r1 + 1), range(c0, c1 + 1))
