"""Gaps and points of balls, segments, corners and rims at planes, ground and each other, for any scalar.

No function branches on a value, so that a kernel traces them; `dynx.distance.contact_points` computes the
same on floats, with faces and edges. A capsule is two balls at a plane, a box its corners, a hull its
vertices, and a cylinder points of its rims. Vectors are arrays (3,), radii and lengths floats or scalars.
"""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import numpy as np

from dynx.errors import ArgumentError, shown
from dynx.model.geometry import Box, Capsule, Cylinder, Mesh, Shape, Sphere
from dynx.spatial.scalar import Array, Floats, less, maximum, minimum, select, sqrt

MIN_SQUARE = 1e-30
"""Square of a length [m^2] or a sine that is added where a direction may vanish: its place is then any."""

PARALLEL_SQUARE = 1e-16
"""Square of the sine of the angle between two segments below which they are parallel."""

MAX_POINTS = 32
"""Largest number of vertices of a hull that stand for it."""


class SurfaceGap(NamedTuple):
    """A pair of points of two surfaces; gap = (point_a - point_b) . normal."""

    gap: Any
    """Distance along the normal [m]; negative where the surfaces overlap."""
    point_a: Array
    point_b: Array
    normal: Array
    """Unit vector (3,) from b to a."""


class BallPoints(NamedTuple):
    """Balls of one radius that touch a plane where a shape does."""

    centers: Floats
    """Centres (k, 3) in the frame of the shape [m]."""
    radius: float


def ball_points(shape: Shape) -> BallPoints:
    """Return the balls of a shape that decide its gap from a plane: all of it, but of a cylinder four points
    of each rim (`lowest_of_rim` is the fifth).

    Raises ArgumentError for a mesh whose hull has more than `MAX_POINTS` vertices, and for shapes without
    such points (ellipsoids, planes, height fields).
    """
    if isinstance(shape, Sphere):
        return BallPoints(np.zeros((1, 3)), shape.radius)
    if isinstance(shape, Capsule):
        half = 0.5 * shape.length
        return BallPoints(np.array([[0.0, 0.0, -half], [0.0, 0.0, half]]), shape.radius)
    if isinstance(shape, Box):
        signs = np.array([sign[::-1] for sign in itertools.product((-0.5, 0.5), repeat=3)])
        return BallPoints(signs * shape.size, 0.0)
    if isinstance(shape, Cylinder):
        r, half = shape.radius, 0.5 * shape.length
        rim = [(r, 0.0), (0.0, r), (-r, 0.0), (0.0, -r)]
        return BallPoints(np.array([(x, y, z) for z in (-half, half) for x, y in rim]), 0.0)
    if isinstance(shape, Mesh):
        vertices: Floats = shape.hull[0]
        if len(vertices) > MAX_POINTS:
            raise ArgumentError(
                f"the hull of mesh {shown(shape.name)} has {len(vertices)} vertices; at most {MAX_POINTS} "
                "stand for a shape in a kernel"
            )
        return BallPoints(vertices, 0.0)
    kind = type(shape).__name__
    raise ArgumentError(f"a shape is {kind}; wanted a Sphere, Capsule, Box, Cylinder or Mesh")


def ball_on_plane(center: Array, radius: Any, normal: Array, offset: Any) -> SurfaceGap:
    """Return the gap of a ball, a, from the half-space of the points x with normal . x <= offset, b."""
    gap = normal.dot(center) - offset - radius
    point = center - radius * normal
    return SurfaceGap(gap, point, point - gap * normal, normal)


def lowest_of_rim(center: Array, axis: Array, radius: Any, normal: Array) -> Array:
    """Return the point (3,) of the rim of a disc that is farthest along -normal.

    `center` is that of the disc and `axis` a unit vector across it. Where the axis is along the normal the
    whole rim is alike, and the point is between the centre and the rim.
    """
    across = normal - normal.dot(axis) * axis
    return np.asarray(center - across * (radius / _length(across)))


def ball_on_triangles(
    center: Array, radius: Any, heights: Array, cell: tuple[float, float], corner: Array
) -> SurfaceGap:
    """Return the gap of a ball, a, from the triangle of a cell of a height field below its centre, b.

    `heights` (4,) are those of the cell's corners at (x, y), (x + dx, y), (x, y + dy) and (x + dx, y + dy);
    `cell` is (dx, dy), and `corner` (2,) the place (x, y). The diagonal goes from the first to the last
    (`HeightField`). The plane of the triangle counts without end: the point of a ball on a slope is beside
    its centre by the radius times the sine of the slope, and may belong to the next triangle.
    """
    dx, dy = cell
    low, right, above, across = heights
    u, v = (center[0] - corner[0]) / dx, (center[1] - corner[1]) / dy
    # Along x below the diagonal u = v, along y above it.
    lower = less(v, u)
    along_x = select(lower, right - low, across - above)
    along_y = select(lower, across - right, above - low)
    height = low + u * along_x + v * along_y
    slope = np.array([-along_x / dx, -along_y / dy, 0.0 * u + 1.0])
    normal = slope / sqrt(slope.dot(slope))
    gap = (center[2] - height) * normal[2] - radius
    point = center - radius * normal
    return SurfaceGap(gap, point, point - gap * normal, normal)


def ball_on_ball(center_a: Array, radius_a: Any, center_b: Array, radius_b: Any) -> SurfaceGap:
    """Return the gap of two balls."""
    between = center_a - center_b
    length = _length(between)
    normal = between / length
    return SurfaceGap(
        length - radius_a - radius_b, center_a - radius_a * normal, center_b + radius_b * normal, normal
    )


def ball_on_capsule(
    center: Array, radius: Any, center_b: Array, axis_b: Array, half_b: Any, radius_b: Any
) -> SurfaceGap:
    """Return the gap of a ball, a, and a capsule, b, with the unit vector of its axis and half its length."""
    along = _clamped(axis_b.dot(center - center_b), half_b)
    return ball_on_ball(center, radius, center_b + along * axis_b, radius_b)


def capsule_on_capsule(
    center_a: Array,
    axis_a: Array,
    half_a: Any,
    radius_a: Any,
    center_b: Array,
    axis_b: Array,
    half_b: Any,
    radius_b: Any,
) -> SurfaceGap:
    """Return the gap of two capsules at the nearest points of their axes.

    C. Ericson, "Real-time collision detection" (2005), section 5.1.9: of the infinite lines, then clamped to
    one segment, to the other, and to the first again. Of parallel axes one pair of many.
    """
    between = center_a - center_b
    cosine = axis_a.dot(axis_b)
    along_a, along_b = -axis_a.dot(between), axis_b.dot(between)
    # The square of the sine as one minus the square of the cosine would lose half of the digits.
    across = np.array([axis_a[i] * axis_b[j] - axis_a[j] * axis_b[i] for i, j in ((1, 2), (2, 0), (0, 1))])
    square = across.dot(across)
    crossing = (along_a + cosine * along_b) / maximum(square, PARALLEL_SQUARE)
    s = _clamped(select(less(square, PARALLEL_SQUARE), along_a, crossing), half_a)
    t = _clamped(along_b + cosine * s, half_b)
    s = _clamped(along_a + cosine * t, half_a)
    return ball_on_ball(center_a + s * axis_a, radius_a, center_b + t * axis_b, radius_b)


def _length(vector: Array) -> Any:
    return sqrt(np.asarray([vector.dot(vector) + MIN_SQUARE]))[0]


def _clamped(x: Any, limit: Any) -> Any:
    return minimum(maximum(x, -limit), limit)
