"""Separation of two shapes along normals of faces and axes, and when it is their signed distance.

A separation is a lower bound of the signed distance. It is the distance itself where two points of the shapes
show it: always for separated shapes. For overlapping ones, moved along the normal by the depth, let a ball
inside a touch the plane between the shapes at the point of a, and another inside b at that of b. The
difference A - B contains their difference, a ball that touches the plane of the facet above the origin. Where
the sum of the radii is at least the depth, it contains the ball of the depth about the origin, so that no
shorter translation separates the shapes.
"""

from __future__ import annotations

import math

import numpy as np

from dynx.distance.cores import BoxCore, Core, CylinderCore, EllipsoidCore, HullCore
from dynx.distance.hull_surface import hull_surface
from dynx.spatial.plain import Vector3
from dynx.spatial.scalar import Floats

TIE = 1e-12
"""Difference of separations, relative to the size of the shapes, that is none: the first axis counts."""

MIN_SINE = 1e-6
"""Sine of the angle between an axis and an edge below which their product is no direction."""

ALIGNED = 1e-9
"""Sine of the angle between a normal and an axis of a cylinder that is rounding."""

_BOX: Floats = np.concatenate([np.eye(3), -np.eye(3)])
_ENDS: Floats = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
_NONE: Floats = np.empty((0, 3))


def face_normals(core: Core) -> Floats:
    """Return the outward normals (k, 3) of the flat faces of a core in its own axes."""
    if isinstance(core, BoxCore):
        return _BOX
    if isinstance(core, CylinderCore):
        return _ENDS
    if isinstance(core, HullCore):
        return hull_surface(core).faces
    return _NONE


def best_axis(a: Core, b: Core) -> tuple[float, Vector3] | None:
    """Return the largest separation of two placed cores along the normals of their faces and the products of
    the axis of a cylinder with axes of the other, and its direction from b to a; None without such axes."""
    normals = np.concatenate([-face_normals(a) @ a.R.T, face_normals(b) @ b.R.T, _products(a, b)])
    if not len(normals):
        return None
    separations = np.einsum("ij,ij->i", a.supports(-normals) - b.supports(normals), normals)
    tie = TIE * (a.extent + b.extent)
    best = int(np.flatnonzero(separations >= separations.max() - tie)[0])
    x, y, z = normals[best].tolist()
    return float(separations[best]), (x, y, z)


def _products(a: Core, b: Core) -> Floats:
    """Return the unit vectors (k, 3), of both signs, across the axis of a cylinder and axes of the other."""
    if not (isinstance(a, CylinderCore) and isinstance(b, CylinderCore | BoxCore)):
        return _NONE
    others = b.R.T if isinstance(b, BoxCore) else b.R[:, 2:].T
    products = np.cross(a.R[:, 2], others)
    lengths = np.linalg.norm(products, axis=1)
    kept = products[lengths > MIN_SINE] / lengths[lengths > MIN_SINE, None]
    return np.concatenate([kept, -kept])


def tangent_radius(core: Core, point: Vector3, outward: Vector3) -> float:
    """Return the radius of a ball inside a placed core that touches the plane across `outward` at a point of
    its surface; 0 if the core has none or dynx knows none."""
    local = core.R.T @ (np.array(point) - core.p)
    m = core.R.T @ np.array(outward)
    if isinstance(core, BoxCore):
        return _among_planes(_BOX, np.array([*core.halves, *core.halves]), local, m)
    if isinstance(core, HullCore):
        surface = hull_surface(core)
        if surface.normals is None or surface.offsets is None:
            return 0.0
        return _among_planes(surface.normals, surface.offsets, local, m)
    if isinstance(core, CylinderCore):
        between_ends = _among_planes(_ENDS, np.full(2, core.half), local, m)
        if math.hypot(m[0], m[1]) <= ALIGNED:
            return min(between_ends, max(core.rim_radius - math.hypot(local[0], local[1]), 0.0))
        return min(between_ends, core.rim_radius) if abs(m[2]) <= ALIGNED else 0.0
    if isinstance(core, EllipsoidCore):
        # The least radius of curvature.
        return float(core.radii.min() ** 2 / core.radii.max())
    return 0.0


def _among_planes(normals: Floats, offsets: Floats, point: Floats, m: Floats) -> float:
    """Return the radius of the largest ball that touches a plane at a point and none of other half-spaces."""
    rising = 1.0 - normals @ m
    others = rising > ALIGNED
    radii = (offsets[others] - normals[others] @ point) / rising[others]
    return max(float(radii.min()), 0.0)
