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
        inertia = sum(
            part.inertia + part.volume * _point_inertia(part.center - center) for part in (self, other)
        )
        return SolidProperties(volume, center, np.asarray(inertia))


def solid_properties(shape: Shape) -> SolidProperties:
    """Return volume, centre and second moments of a shape; those of a mesh are the ones of its convex hull.

    Raises ArgumentError for a plane or height field, and the errors of `Mesh.hull`.
    """
    center = np.zeros(3)
    if isinstance(shape, Box):
        x, y, z = shape.size
        return SolidProperties(x * y * z, center, x * y * z * _diagonal(x**2 / 12, y**2 / 12, z**2 / 12))
    if isinstance(shape, Sphere):
        volume = 4.0 / 3.0 * math.pi * shape.radius**3
        square = shape.radius**2 / 5
        return SolidProperties(volume, center, volume * _diagonal(square, square, square))
    if isinstance(shape, Cylinder):
        volume = math.pi * shape.radius**2 * shape.length
        square = shape.radius**2 / 4
        return SolidProperties(volume, center, volume * _diagonal(square, square, shape.length**2 / 12))
    if isinstance(shape, Capsule):
        return _capsule(shape.radius, shape.length)
    if isinstance(shape, Ellipsoid):
        x, y, z = shape.radii
        volume = 4.0 / 3.0 * math.pi * x * y * z
        return SolidProperties(volume, center, volume / 5.0 * _diagonal(x * x, y * y, z * z))
    if isinstance(shape, Mesh):
        return polyhedron_properties(*shape.hull)
    raise ArgumentError(f"a {type(shape).__name__} has no volume, so it cannot have a mass")


SHELL_THICKNESS = 1e-6
"""Growth of the half axes of an ellipsoid [m] that MuJoCo takes for the thickness of its shell."""


def shell_properties(shape: Shape) -> SolidProperties:
    """Return area [m^2], centre and second moments [m^4] of the surface of a primitive.

    Those of an ellipsoid are MuJoCo's approximations: Thomsen's for its area, and for its moments a shell
    between it and one with larger half axes. Raises ArgumentError for another shape.
    """
    if isinstance(shape, Box):
        x, y, z = shape.size
        sides = 2.0 * np.array([y * z, z * x, x * y])
        # Across a pair of sides all points are at half the edge, along them they are spread evenly.
        squares = np.array([x * x, y * y, z * z]) * (sides / 4.0 + (sides.sum() - sides) / 12.0)
        return SolidProperties(float(sides.sum()), np.zeros(3), _diagonal(*squares.tolist()))
    if isinstance(shape, Sphere):
        return _round_shell(shape.radius, 0.0, ends="balls")
    if isinstance(shape, Cylinder | Capsule):
        ends = "discs" if isinstance(shape, Cylinder) else "balls"
        return _round_shell(shape.radius, shape.length, ends=ends)
    if isinstance(shape, Ellipsoid):
        return _ellipsoid_shell(*shape.radii)
    raise ArgumentError(f"the surface of a {type(shape).__name__} has no closed form here")


def _round_shell(radius: float, length: float, *, ends: str) -> SolidProperties:
    """Return the properties of the wall of a tube with two discs, or two half spheres, as its ends."""
    wall, half, square = 2.0 * math.pi * radius * length, length / 2.0, radius * radius
    if ends == "discs":
        closed = 2.0 * math.pi * square
        xx, zz = closed * square / 4.0, closed * half * half
    else:
        closed = 4.0 * math.pi * square
        # The centre of a half sphere is half its radius above its rim.
        xx, zz = closed * square / 3.0, closed * (square / 3.0 + half * half + half * radius)
    xx, zz = xx + wall * square / 2.0, zz + wall * length * length / 12.0
    return SolidProperties(wall + closed, np.zeros(3), _diagonal(xx, xx, zz))


def _ellipsoid_shell(a: float, b: float, c: float) -> SolidProperties:
    power, e = 1.6075, SHELL_THICKNESS
    mean = ((a * b) ** power + (b * c) ** power + (c * a) ** power) / 3.0
    area = 4.0 * math.pi * mean ** (1.0 / power)
    # Differences of the two ellipsoids, without the cancellation of subtracting them.
    inner, growth = a * b * c, e * (a * b + b * c + c * a) + e * e * (a + b + c) + e**3
    squares = [area / 5.0 * ((half + e) ** 2 + inner / growth * e * (2.0 * half + e)) for half in (a, b, c)]
    return SolidProperties(area, np.zeros(3), _diagonal(*squares))


def cone_properties(radius: float, length: float) -> SolidProperties:
    """Return the properties of a cone about z whose origin is halfway [m] between base and tip, which is
    up."""
    volume = math.pi * radius**2 * length / 3.0
    square = 3.0 / 20.0 * radius**2
    moments = volume * _diagonal(square, square, 3.0 / 80.0 * length**2)
    return SolidProperties(volume, np.array([0.0, 0.0, -length / 4.0]), moments)


def inertial_of(properties: SolidProperties, line: int | None) -> Inertial:
    """Return the inertial of properties that have the mass in place of the volume (`of_density`)."""
    x, y, z = properties.center.tolist()
    xx, xy, xz, yy, yz, zz = properties.inertia[np.triu_indices(3)].tolist()
    return Inertial(properties.volume, Pose((x, y, z)), xx, xy, xz, yy, yz, zz, line=line)


def _diagonal(xx: float, yy: float, zz: float) -> Floats:
    """Return the inertia of unit mass with these mean squares of x, y and z."""
    return np.diag([yy + zz, xx + zz, xx + yy])


def _point_inertia(p: Floats) -> Floats:
    return np.asarray(p @ p * np.eye(3) - np.outer(p, p))


def _capsule(radius: float, length: float) -> SolidProperties:
    """Add a cylinder and two half balls, whose centres are 3/8 of the radius from their flat faces."""
    tube, ball = math.pi * radius**2 * length, 4.0 / 3.0 * math.pi * radius**3
    xx = (tube / 4 + ball / 5) * radius**2
    zz = tube * length**2 / 12 + ball * (radius**2 / 5 + length**2 / 4 + 3 * length * radius / 8)
    return SolidProperties(tube + ball, np.zeros(3), _diagonal(xx, xx, zz))


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
