"""Separation of two shapes along normals of faces and axes, and when it is their signed distance.

A separation is a lower bound of the signed distance. It is the distance itself where two points of the shapes
show it: always for separated shapes. For overlapping ones, moved along the normal by the depth, let a ball
inside a touch the plane between the shapes at the point of a, and another inside b at that of b. The
difference A - B contains their difference, a ball that touches the plane of the facet above the origin. Where
the sum of the radii is at least the depth, it contains the ball of the depth about the origin, so that no
shorter translation separates the shapes.

S. Gottschalk, M. Lin, D. Manocha, "OBBTree: a hierarchical structure for rapid interference detection",
SIGGRAPH (1996), have the axes of two boxes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from dynx.distance.cores import BoxCore, Core, CylinderCore, EllipsoidCore, HullCore
from dynx.distance.hull_surface import hull_surface
from dynx.spatial.plain import Rows, Vector3, dot
from dynx.spatial.scalar import Floats

TIE = 1e-12
"""Difference of separations, relative to the size of the shapes, that is none: the first axis counts, and of
boxes a face rather than a product of edges."""

MIN_SINE = 1e-6
"""Sine of the angle between an axis and an edge below which their product is no direction."""

MIN_EDGE_SINE = 1e-12
"""As `MIN_SINE`, between the edges of two boxes."""

PARALLEL_SINE = 1e-3
"""Sine of the angle between two edges below which rounding would spoil the short formula."""

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


def box_separation(
    axes_a: Rows,
    halves_a: Sequence[float],
    axes_b: Rows,
    halves_b: Sequence[float],
    between: Vector3,
    limit: float,
) -> tuple[float, Vector3] | None:
    """Return the largest separation of two boxes and its unit normal, from b to a, along the three axes of
    each and the nine products of one axis of each: the normals of faces of their difference.

    `between` is the centre of a less that of b. Returns None where the separation exceeds `limit`.
    """
    a0, a1, a2 = axes_a
    b0, b1, b2 = axes_b
    ha, hb = halves_a, halves_b
    R = [[dot(a, b) for b in axes_b] for a in axes_a]
    Q = [[abs(x) for x in row] for row in R]
    best, normal, along = -math.inf, a0, 0.0
    t_a = dot(between, a0), dot(between, a1), dot(between, a2)
    t_b = dot(between, b0), dot(between, b1), dot(between, b2)
    for k in range(3):
        q = Q[k]
        separation = abs(t_a[k]) - (ha[k] + hb[0] * q[0] + hb[1] * q[1] + hb[2] * q[2])
        if separation > best:
            if separation > limit:
                return None
            best, normal, along = separation, axes_a[k], t_a[k]
    size = ha[0] + ha[1] + ha[2] + hb[0] + hb[1] + hb[2]
    tie = TIE * size
    for k in range(3):
        separation = abs(t_b[k]) - (hb[k] + ha[0] * Q[0][k] + ha[1] * Q[1][k] + ha[2] * Q[2][k])
        if separation > best + tie:
            if separation > limit:
                return None
            best, normal, along = separation, axes_b[k], t_b[k]
    edges = None
    for i in range(3):
        i1, i2 = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            # Components of b_j across a_i, whose length is the sine of their angle.
            y, z = R[i1][j], R[i2][j]
            square = y * y + z * z
            if square < MIN_EDGE_SINE * MIN_EDGE_SINE:
                continue
            t = t_a[i2] * y - t_a[i1] * z
            if square > PARALLEL_SINE * PARALLEL_SINE:
                j1, j2 = (j + 1) % 3, (j + 2) % 3
                reach = ha[i1] * Q[i2][j] + ha[i2] * Q[i1][j] + hb[j1] * Q[i][j2] + hb[j2] * Q[i][j1]
                separation = (abs(t) - reach) / math.sqrt(square)
            else:
                n = _direction(axes_a[i], axes_b[j])
                reach = sum(h * abs(dot(e, n)) for h, e in zip((*ha, *hb), (*axes_a, *axes_b), strict=True))
                separation = abs(dot(between, n)) - reach
            if separation > best + tie:
                if separation > limit:
                    return None
                best, edges, along = separation, (i, j), t
    if edges is not None:
        normal = _direction(axes_a[edges[0]], axes_b[edges[1]])
        along = dot(between, normal)
    return best, normal if along >= 0.0 else (-normal[0], -normal[1], -normal[2])


def _direction(a: Vector3, b: Vector3) -> Vector3:
    """Return the unit vector along a x b."""
    (ax, ay, az), (bx, by, bz) = a, b
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length
