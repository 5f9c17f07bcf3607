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
from dynx.spatial.so3 import rotate

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


def plane_point_count(shape: Shape, *, deepest: bool = False) -> int:
    """Return the number of `plane_points` of a shape.

    Raises ArgumentError for a mesh whose hull has more than `MAX_POINTS` vertices, and for shapes that are
    no Sphere, Capsule, Box, Cylinder or Mesh.
    """
    points = ball_points(shape).centers
    if deepest or isinstance(shape, Sphere):
        return 1
    if isinstance(shape, Capsule):
        return 2
    return 6 if isinstance(shape, Cylinder) else min(len(points), 4)


def plane_points(
    shape: Shape, R: Array, center: Array, axes: Array, offset: Any, *, deepest: bool = False
) -> list[tuple[Any, Array]]:
    """Return the gaps [m] and points (3,) of a shape that may touch a half-space, or the `deepest` alone.

    R (3, 3) and `center` (3,) are its pose; `axes` (3, 3) are the normal of the half-space and two tangents,
    `offset` its distance from the origin. Of a sphere it is one point, of a capsule one below each end of its
    axis, of a box the corners of the face that looks down most, of a cylinder four points of the lower rim
    and the lowest of both rims, and of a hull with more than four vertices the lowest vertex of each quadrant
    around its middle: those of `dynx.distance.contact_points`, before these are reduced to four.
    """
    normal = axes[0]
    height = normal.dot(center) - offset
    if isinstance(shape, Sphere):
        return [(height - shape.radius, center - shape.radius * normal)]
    columns = [R[:, k] for k in range(3)]
    cosines = [column.dot(normal) for column in columns]
    if isinstance(shape, Capsule):
        return _capsule_points(shape, columns[2], cosines[2], center, height, normal, deepest)
    if isinstance(shape, Box):
        return _box_points(shape, columns, cosines, center, height, deepest)
    if isinstance(shape, Cylinder):
        z, half = columns[2], 0.5 * shape.length
        down = half * select(less(0.0, cosines[2]), -1.0, 1.0)
        low, up = center + down * z, center - down * z
        points = [lowest_of_rim(low, z, shape.radius, normal)]
        if not deepest:
            points.append(lowest_of_rim(up, z, shape.radius, normal))
            for column in columns[:2]:
                points += [low + shape.radius * column, low - shape.radius * column]
        return [(normal.dot(point) - offset, point) for point in points]
    return _hull_points(ball_points(shape).centers, R, center, height, axes, deepest)


def _capsule_points(
    shape: Capsule, axis: Array, sine: Any, center: Array, height: Any, normal: Array, deepest: bool
) -> list[tuple[Any, Array]]:
    """Return the points of the surface straight below both ends of the axis."""
    r, half = shape.radius, 0.5 * shape.length
    low = height - half * abs(sine)
    if deepest:
        toward = half * select(less(0.0, sine), -1.0, 1.0)
        return [(low - r, center + toward * axis - r * normal)]
    steep, cosine = abs(sine), _root(maximum(1.0 - sine * sine, MIN_SQUARE))
    along = 2.0 * half * cosine
    # The surface below the upper end is that of the half ball of the lower end, or of the cylinder.
    round_end = _root(maximum(r * r - along * along, 0.0))
    reach = select(less(along, r * steep), round_end, (r - along * steep) / cosine)
    found = []
    for s in (-half, half):
        gap = low - select(less(0.0, s * sine), reach, r)
        found.append((gap, center + s * axis + (gap - (height + s * sine)) * normal))
    return found


def _box_points(
    shape: Box, columns: list[Array], cosines: list[Any], center: Array, height: Any, deepest: bool
) -> list[tuple[Any, Array]]:
    """Return the corners of the face whose normal is nearest to straight down."""
    halves = [0.5 * size for size in shape.size]
    if deepest:
        signs = [half * select(less(0.0, c), -1.0, 1.0) for half, c in zip(halves, cosines, strict=True)]
        above, point = height, center
        for s, column, c in zip(signs, columns, cosines, strict=True):
            above, point = above + s * c, point + s * column
        return [(above, point)]
    steep = [abs(c) for c in cosines]
    first = less(steep[1], steep[0]) * less(steep[2], steep[0])
    second = less(steep[2], steep[1])

    def chosen(a: Any, b: Any, c: Any) -> Any:
        return select(first, a, select(second, b, c))

    def edges(k: int) -> tuple[list[Any], Any]:
        """Return half an edge along axis k as a vector, and its component along the normal."""
        return [halves[k] * x for x in columns[k]], halves[k] * cosines[k]

    (x, along_x), (y, along_y), (z, along_z) = edges(0), edges(1), edges(2)
    down = [chosen(*each) for each in zip(x, y, z, strict=True)]
    across = [chosen(*each) for each in zip(y, z, x, strict=True)]
    other = [chosen(*each) for each in zip(z, x, y, strict=True)]
    heights = [chosen(a, b, c) for a, b, c in ((along_x, along_y, along_z), (along_y, along_z, along_x))]
    heights.append(chosen(along_z, along_x, along_y))
    sign = select(less(0.0, heights[0]), -1.0, 1.0)
    found = []
    for s, t in ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)):
        gap = height + sign * heights[0] + s * heights[1] + t * heights[2]
        steps = [sign * a + s * b + t * c for a, b, c in zip(down, across, other, strict=True)]
        found.append((gap, np.array([a + b for a, b in zip(center, steps, strict=True)])))
    return found


def _hull_points(
    vertices: Floats, R: Array, center: Array, height: Any, axes: Array, deepest: bool
) -> list[tuple[Any, Array]]:
    """Return the lowest vertex of each quadrant around the middle, or of all."""
    local = axes @ R
    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    far = 4.0 * float(np.linalg.norm(vertices - middle, axis=1).max(initial=0.0))
    lowered = [local[0].dot(vertex) for vertex in vertices]
    if not deepest and len(vertices) <= 4:
        pairs = zip(lowered, vertices, strict=True)
        return [(height + above, center + rotate(R, vertex)) for above, vertex in pairs]
    quadrants = [None] if deepest else [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)]
    sides = [(local[1].dot(vertex - middle), local[2].dot(vertex - middle)) for vertex in vertices]
    found = []
    for quadrant in quadrants:
        best: Any = None
        for above, vertex, (u, v) in zip(lowered, vertices, sides, strict=True):
            score = above
            if quadrant is not None:
                inside = less(0.0, quadrant[0] * u) * less(0.0, quadrant[1] * v)
                score = above + (1.0 - inside) * far
            if best is None:
                best = [score, above, *vertex]
                continue
            lower = less(score, best[0])
            pairs = zip([score, above, *vertex], best, strict=True)
            best = [select(lower, new, old) for new, old in pairs]
        found.append((height + best[1], center + rotate(R, np.array(best[2:]))))
    return found


def _root(x: Any) -> Any:
    return sqrt(np.asarray([x]))[0]


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
    return _root(vector.dot(vector) + MIN_SQUARE)


def _clamped(x: Any, limit: Any) -> Any:
    return minimum(maximum(x, -limit), limit)
