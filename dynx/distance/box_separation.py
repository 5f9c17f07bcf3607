"""Separation of two boxes by the theorem of separating axes.

S. Gottschalk, M. Lin, D. Manocha, "OBBTree: a hierarchical structure for rapid interference detection",
SIGGRAPH (1996): the normals of faces of the difference of two boxes are the three axes of each and the nine
products of one axis of each. The largest separation along them is the signed distance if the boxes overlap,
and a lower bound of it otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from dynx.spatial.plain import Rows, Vector3, dot

MIN_SINE = 1e-12
"""Sine of the angle between two edges below which their product is no direction."""

PARALLEL_SINE = 1e-3
"""Sine of the angle between two edges below which rounding would spoil the short formula."""

TIE = 1e-12
"""Excess of the separation along a product of edges, relative to the size of the boxes, over that along a
face below which the face is the contact's."""


def box_separation(
    axes_a: Rows,
    halves_a: Sequence[float],
    axes_b: Rows,
    halves_b: Sequence[float],
    between: Vector3,
    limit: float,
) -> tuple[float, Vector3] | None:
    """Return the largest separation of two boxes and its unit normal, from b to a.

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
            if square < MIN_SINE * MIN_SINE:
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
