"""Volume, centre of mass and moments of inertia of shapes of uniform density."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dynx.errors import ArgumentError
from dynx.model.elements import Inertial, Pose
from dynx.model.geometry.mesh import Mesh
from dynx.model.geometry.shapes import Box, Capsule, Cylinder, Ellipsoid, HeightField, Plane, Sphere
from dynx.spatial.scalar import Floats

Shape = Box | Sphere | Cylinder | Capsule | Ellipsoid | Mesh | Plane | HeightField


@dataclass(frozen=True, eq=False)
class SolidProperties:
    """Volume [m^3], its centre (3,) [m], and its second moments about the centre for density 1 [m^5]."""

    volume: float
    center: Floats
    inertia: Floats

    def transform(self, T: Floats) -> SolidProperties:
        """Return the properties in frame A, where T (4, 4) is the pose of this frame in A."""
        R = T[:3, :3]
        return SolidProperties(self.volume, R @ self.center + T[:3, 3], R @ self.inertia @ R.T)

    def of_density(self, density: float) -> SolidProperties:
        """Return mass [kg] and moments of inertia [kg m^2] in place of volume and second moments."""
        return SolidProperties(density * self.volume, self.center, density * self.inertia)

    def __add__(self, other: SolidProperties) -> SolidProperties:
        volume = self.volume + other.volume
        center = (self.volume * self.center + other.volume * other.center) / volume
        offsets = [(part, part.center - center) for part in (self, other)]
        inertia = sum(p.inertia + p.volume * (r @ r * np.eye(3) - np.outer(r, r)) for p, r in offsets)
        return SolidProperties(volume, center, np.asarray(inertia))


def solid_properties(shape: Shape) -> SolidProperties:
    """Return volume, centre and second moments of a shape, or of the convex hull of a mesh.

    Raises ArgumentError for a plane or height field, and the errors of `Mesh.hull`.
    """
    center = np.zeros(3)
    if isinstance(shape, Box):
        x, y, z = shape.size
        return SolidProperties(
            x * y * z, center, diagonal_inertia(x**2 / 12, y**2 / 12, z**2 / 12, x * y * z)
        )
    if isinstance(shape, Sphere):
        volume = 4.0 / 3.0 * math.pi * shape.radius**3
        square = shape.radius**2 / 5
        return SolidProperties(volume, center, volume * diagonal_inertia(square, square, square))
    if isinstance(shape, Cylinder):
        volume = math.pi * shape.radius**2 * shape.length
        square = shape.radius**2 / 4
        return SolidProperties(volume, center, diagonal_inertia(square, square, shape.length**2 / 12, volume))
    if isinstance(shape, Capsule):
        return _capsule(shape.radius, shape.length)
    if isinstance(shape, Ellipsoid):
        x, y, z = shape.radii
        volume = 4.0 / 3.0 * math.pi * x * y * z
        return SolidProperties(volume, center, volume / 5.0 * diagonal_inertia(x * x, y * y, z * z))
    if isinstance(shape, Mesh):
        return polyhedron_properties(*shape.hull)
    raise ArgumentError(f"a {type(shape).__name__} has no volume, so it cannot have a mass")


def inertial_of(properties: SolidProperties, line: int | None) -> Inertial:
    """Return the inertial of properties that have the mass in place of the volume (`of_density`)."""
    x, y, z = properties.center.tolist()
    xx, xy, xz, yy, yz, zz = properties.inertia[np.triu_indices(3)].tolist()
    return Inertial(properties.volume, Pose((x, y, z)), xx, xy, xz, yy, yz, zz, line=line)


def diagonal_inertia(xx: float, yy: float, zz: float, mass: float = 1.0) -> Floats:
    """Return the inertia of a mass with these mean squares of x, y and z."""
    return mass * np.diag([yy + zz, xx + zz, xx + yy])


def _capsule(radius: float, length: float) -> SolidProperties:
    """Add a cylinder and two half balls, whose centres are 3/8 of the radius from their flat faces."""
    tube, ball = math.pi * radius**2 * length, 4.0 / 3.0 * math.pi * radius**3
    xx = (tube / 4 + ball / 5) * radius**2
    zz = tube * length**2 / 12 + ball * (radius**2 / 5 + length**2 / 4 + 3 * length * radius / 8)
    return SolidProperties(tube + ball, np.zeros(3), diagonal_inertia(xx, xx, zz))


def polyhedron_properties(
    vertices: Floats, faces: np.ndarray[tuple[int, int], np.dtype[np.intp]]
) -> SolidProperties:
    """Return the properties of the solid with these vertices (n, 3) [m] and triangles (m, 3) of them,
    counter-clockwise from outside: the sum of the tetrahedra between an inner point and each triangle."""
    middle = vertices.mean(axis=0)
    corners = (vertices - middle)[faces]
    volumes = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    volume = float(volumes.sum())
    sums = corners.sum(axis=1)
    center = volumes @ sums / (4.0 * volume)
    squares = np.einsum("i,ija,ijb->ab", volumes, corners, corners)
    squares = (squares + np.einsum("i,ia,ib->ab", volumes, sums, sums)) / 20.0
    squares -= volume * np.outer(center, center)
    return SolidProperties(volume, center + middle, np.trace(squares) * np.eye(3) - squares)
