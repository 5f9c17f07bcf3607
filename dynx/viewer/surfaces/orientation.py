"""Which side of a surface is its outside."""

from __future__ import annotations

import numpy as np

from dynx.viewer.surfaces.triangles import Triangles, distinct_rows


def turned_outwards(triangles: Triangles) -> Triangles | None:
    """Return triangles that form closed surfaces turned outwards, so that nobody sees one from behind; None
    where a surface is open.

    Each edge of a closed surface is passed as often in one direction as in the other, and a surface that is
    turned inwards encloses a negative volume (divergence theorem). That of a cavity, which nobody sees, is
    turned, too.
    """
    if not len(triangles.faces):
        return None
    places = [np.unique(column, return_inverse=True)[1].reshape(-1) for column in triangles.vertices.T]
    _, number = distinct_rows(np.stack(places, axis=1))
    faces = number[triangles.faces]
    count = int(faces.max()) + 1
    first, second = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    if not np.array_equal(np.sort(first * count + second), np.sort(second * count + first)):
        return None
    surface = np.arange(count)
    while True:
        # Each vertex takes the smallest number among its neighbours', and then that one's.
        smaller = surface.copy()
        np.minimum.at(smaller, first, surface[second])
        smaller = smaller[smaller]
        if np.array_equal(smaller, surface):
            break
        surface = smaller
    a, b, c = np.moveaxis(triangles.vertices[triangles.faces].astype(np.float64), 1, 0)
    surface_of_face = surface[faces[:, 0]]
    volumes = np.bincount(surface_of_face, np.einsum("ij,ij->i", a, np.cross(b, c)), minlength=count)
    inwards = volumes[surface_of_face] < 0.0
    return Triangles(
        triangles.vertices, np.where(inwards[:, None], triangles.faces[:, ::-1], triangles.faces)
    )
