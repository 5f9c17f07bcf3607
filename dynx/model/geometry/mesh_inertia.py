"""Volume, centre and moments of inertia of meshes, as MJCF's attribute ``inertia`` means them."""

from __future__ import annotations

import os
from functools import lru_cache

import numpy as np

from dynx.errors import ArgumentError
from dynx.model.elements import Vector
from dynx.model.geometry.mesh import Mesh
from dynx.model.geometry.solids import SolidProperties, polyhedron_properties
from dynx.spatial.scalar import Floats


def mesh_properties(mesh: Mesh, kind: str) -> SolidProperties:
    """Return the properties of a mesh of density 1.

    ``convex`` is its convex hull, ``exact`` the volume within the surface, ``shell`` the surface (its area
    stands for the volume, [m^2]), ``legacy`` MuJoCo's sum of tetrahedra, which counts hollows as well. Raises
    ArgumentError for an exact mesh whose surface is not closed, and the errors of `Mesh.hull`.
    """
    if type(mesh) is Mesh and mesh.fault is None:
        try:
            status = os.stat(mesh.file)
        except (OSError, ValueError):
            return _properties(mesh, kind)
        return _of_file(mesh.file, mesh.scale, mesh.part, kind, status.st_mtime_ns, status.st_size)
    return _properties(mesh, kind)


# The doctor reads a robot hundreds of times, each time with one cause fewer and the same meshes.
@lru_cache(maxsize=1024)
def _of_file(
    file: str, scale: Vector, part: int | None, kind: str, changed: int, size: int
) -> SolidProperties:
    found = _properties(Mesh(file, scale, part=part), kind)
    for shared in (found.center, found.inertia):
        shared.setflags(write=False)
    return found


def _properties(mesh: Mesh, kind: str) -> SolidProperties:
    if kind == "convex":
        return polyhedron_properties(*mesh.hull)
    vertices, faces = mesh.triangles
    if kind == "exact":
        edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        if (np.unique(edges, axis=0, return_counts=True)[1] != 2).any():
            raise ArgumentError('the surface is not closed, so inertia="exact" has no meaning')
        return polyhedron_properties(vertices, faces)
    corners = vertices[faces]
    edges_from_first = corners[:, 1:] - corners[:, :1]
    areas = np.linalg.norm(np.cross(edges_from_first[:, 0], edges_from_first[:, 1]), axis=1) / 2.0
    middle = areas @ corners.mean(axis=1) / areas.sum()
    if kind == "shell":
        return _about(middle, corners, areas, divisor=12.0)
    inner = corners - middle
    volumes = _tetrahedra(inner)
    center = middle + volumes @ inner.sum(axis=1) / (4.0 * volumes.sum())
    # MuJoCo divides the mesh anew from there, and takes that point for the centre of what it finds.
    return _about(center, corners, _tetrahedra(corners - center), divisor=20.0)


def _tetrahedra(corners: Floats) -> Floats:
    """Return the volumes of the tetrahedra between the origin and triangles (n, 3, 3), none negative."""
    six = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    return np.asarray(np.abs(six) / 6.0)


def _about(center: Floats, corners: Floats, sizes: Floats, *, divisor: float) -> SolidProperties:
    """Add the second moments about a centre of triangles (n, 3, 3) of these areas, for which the divisor is
    12, or of tetrahedra of these volumes between that centre and the triangles, for which it is 20."""
    inner = corners - center
    sums = inner.sum(axis=1)
    squares = np.einsum("i,ija,ijb->ab", sizes, inner, inner) + np.einsum("i,ia,ib->ab", sizes, sums, sums)
    squares /= divisor
    return SolidProperties(float(sizes.sum()), center, np.trace(squares) * np.eye(3) - squares)
