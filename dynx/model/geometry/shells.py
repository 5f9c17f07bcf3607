"""Area and moments of inertia of hollow primitives, as MJCF's attribute ``shellinertia`` means them."""

from __future__ import annotations

import math

import numpy as np

from dynx.errors import ArgumentError
from dynx.model.geometry.shapes import Box, Capsule, Cylinder, Ellipsoid, Sphere
from dynx.model.geometry.solids import Shape, SolidProperties, diagonal_inertia

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
        return SolidProperties(float(sides.sum()), np.zeros(3), diagonal_inertia(*squares.tolist()))
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
    return SolidProperties(wall + closed, np.zeros(3), diagonal_inertia(xx, xx, zz))


def _ellipsoid_shell(a: float, b: float, c: float) -> SolidProperties:
    power, e = 1.6075, SHELL_THICKNESS
    mean = ((a * b) ** power + (b * c) ** power + (c * a) ** power) / 3.0
    area = 4.0 * math.pi * mean ** (1.0 / power)
    # Differences of the two ellipsoids, without the cancellation of subtracting them.
    inner, growth = a * b * c, e * (a * b + b * c + c * a) + e * e * (a + b + c) + e**3
    squares = [area / 5.0 * ((half + e) ** 2 + inner / growth * e * (2.0 * half + e)) for half in (a, b, c)]
    return SolidProperties(area, np.zeros(3), diagonal_inertia(*squares))
