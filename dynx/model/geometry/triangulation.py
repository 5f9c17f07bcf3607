"""Triangles of shapes that are stated otherwise: ellipsoids and height fields."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from dynx.spatial.scalar import Floats

BALL_DEVIATION = 2e-3
"""Largest distance between the unit ball and the polyhedron that stands for it."""


def grid_triangles(heights: Floats, size: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return the surface of a height field (`HeightField.triangles`)."""
    rows, columns = heights.shape
    y = np.linspace(-size[1] / 2, size[1] / 2, rows)
    x = np.linspace(-size[0] / 2, size[0] / 2, columns)
    grid_x, grid_y = np.meshgrid(x, y)
    vertices = np.stack([grid_x, grid_y, heights], axis=-1).reshape(-1, 3)
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    right, above, across = corner + 1, corner + columns, corner + columns + 1
    faces = np.stack([corner, right, across, corner, across, above], axis=-1).reshape(-1, 3)
    return vertices, faces


def ellipsoid_triangles(radii: Floats) -> tuple[np.ndarray, np.ndarray]:
    """Return a convex polyhedron near an ellipsoid with these half axes (3,) (`Ellipsoid.triangles`)."""
    vertices, faces = _near_unit_ball()
    return vertices * radii, faces


@lru_cache(maxsize=1)
def _near_unit_ball() -> tuple[np.ndarray, np.ndarray]:
    """Return a geodesic polyhedron whose vertices are as far outside the unit ball as its faces are inside:
    an octahedron whose triangles are divided into four, four times."""
    vertices = np.concatenate([np.eye(3), -np.eye(3)])
    octants = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
    faces = np.array(octants)
    for _ in range(4):
        edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        used, places = np.unique(edges, axis=0, return_inverse=True)
        middles = vertices[used].sum(axis=1)
        ab, bc, ca = (len(vertices) + places.reshape(-1, 3)).T
        a, b, c = faces.T
        vertices = np.concatenate([vertices, middles / np.linalg.norm(middles, axis=1, keepdims=True)])
        corners = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        faces = np.concatenate([np.stack(each, axis=1) for each in corners])
    normals = np.cross(
        vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]]
    )
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    inner = np.einsum("ij,ij->i", normals, vertices[faces[:, 0]]).min()
    return vertices * (2.0 / (1.0 + inner)), faces
