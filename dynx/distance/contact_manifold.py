"""Contact points of two shapes: where and along which normal they touch, overlap, or may touch soon."""

from __future__ import annotations

import math
from typing import NamedTuple

from dynx.distance.contact_reduction import TIE, ContactCandidate, divided, largest, reduced
from dynx.distance.cores import BoxCore, Core, CylinderCore, EllipsoidCore, HullCore, PointCore, SegmentCore
from dynx.distance.distance import distance_of_cores
from dynx.distance.field_contacts import field_candidates
from dynx.distance.overlap_polygon import NEAREST, PARALLEL_SINE, overlap
from dynx.distance.placed_solids import PlacedSolid, placed_cores
from dynx.distance.plane_contacts import fine_rim, plane_candidates
from dynx.distance.separating_axes import best_axis, box_separation, tangent_radius
from dynx.distance.support_features import ContactFrame, SupportFeature, frame_along, support_feature
from dynx.errors import ArgumentError, DTypeError, shown
from dynx.spatial.plain import Vector3, cross, dot, minus

SAME_NORMAL = 1.0 - 1e-6
"""Cosine of the angle between two normals from which a ground counts as one plane."""

VALLEY = 2**70
"""Difference of the numbers of contact points of one vertex with two slopes."""

MARGIN = 1e-8
"""Distance outside of a feature, relative to the size of the shapes, that counts as inside."""


class ContactPoint(NamedTuple):
    """A pair of points of two surfaces that face each other, in world axes."""

    point_a: Vector3
    """Point (3,) on the surface of a [m]."""
    point_b: Vector3
    """Point (3,) on the surface of b [m]."""
    normal: Vector3
    """Unit vector (3,) from b to a."""
    gap: float
    """Distance (point_a - point_b) . normal [m]; negative where the shapes overlap."""
    feature: tuple[int, int]
    """Numbers of the vertices or edges of a and of b that meet here. They stay the same from step to step as
    long as the same parts touch."""
    spare: bool = False
    """True for a point beyond the limit of `contact_points`: the chosen ones bear most loads without it."""

    def swapped(self) -> ContactPoint:
        """Return the contact point of b and a."""
        x, y, z = self.normal
        return ContactPoint(
            self.point_b, self.point_a, (-x, -y, -z), self.gap, self.feature[::-1], self.spare
        )


def contact_points(
    a: PlacedSolid, b: PlacedSolid, within: float, limit: int = 4, *, spares: bool = False
) -> tuple[ContactPoint, ...]:
    """Return the contact points of two shapes whose gap is at most `within` [m], at most `limit` of them.

    The least gap is the signed distance of the shapes, to 1e-8 of their size. Of more points, those of the
    largest area remain, and the deepest one. With `spares` the others follow, marked as such, but for height
    fields: a load near the edge of a face with many vertices needs them. Raises ArgumentError for two grounds
    (planes, height fields), for a negative `within`, and for a limit below 1; DTypeError for a shape that is
    not placed.
    """
    # The engine `dynx` calls this for each pair in each step, so the checks are few.
    for name, shape in (("a", a), ("b", b)):
        if not isinstance(shape, PlacedSolid):
            raise DTypeError(
                f"{name} is {shown(shape)}, of type {type(shape).__name__}; wanted a PlacedSolid: the shape "
                "at its pose"
            )
    if not within >= 0.0:
        raise ArgumentError(f"within is {within:g}; wanted a gap of at least 0 [m]")
    if limit < 1:
        raise ArgumentError(f"limit is {limit}; wanted at least 1 contact point")
    order_a, order_b = _order(a), _order(b)
    if order_a > order_b or (order_a == order_b and _position_order(a, b)):
        return tuple(each.swapped() for each in _in_order(b, a, within, limit, spares))
    return _in_order(a, b, within, limit, spares)


_KINDS = {PointCore: 0, SegmentCore: 1, EllipsoidCore: 2, CylinderCore: 3, BoxCore: 4, HullCore: 5}
_PLANE, _FIELD = 6, 7

_CURVED = (PointCore, EllipsoidCore)
"""Cores of shapes that touch others at one point."""

_SKEW = (0.5327, 0.6071, 0.5896)
"""Direction along which the positions of equal shapes are compared; no shapes are placed along it."""


def _order(solid: PlacedSolid) -> tuple[float, ...]:
    """Return numbers that decide which of two shapes comes first: exchanged shapes exchange the result."""
    core = solid.solid.core
    if core is None:
        return (_PLANE,) if solid.solid.field is None else (_FIELD,)
    return _KINDS[type(core)], core.extent, core.radius


def _position_order(a: PlacedSolid, b: PlacedSolid) -> bool:
    return dot(a.p, _SKEW) < dot(b.p, _SKEW)


def _in_order(
    a: PlacedSolid, b: PlacedSolid, within: float, limit: int, spares: bool
) -> tuple[ContactPoint, ...]:
    """Return the contact points of two shapes of which the second is of a later kind."""
    core_a, core_b = a.solid.core, b.solid.core
    if core_a is None:
        raise ArgumentError("both shapes are grounds; grounds have no contact points with each other")
    if core_b is None:
        if b.solid.field is not None:
            return _of_field(a, b, within, limit)
        normal, found, size = plane_candidates(a, b, within)
        points = _chosen(found, limit, size, normal, spares)
        if spares and len(found) > 1:
            points += _contacts(fine_rim(a, b, within), normal, spare=True)
        return points
    if isinstance(core_a, PointCore) and isinstance(core_b, PointCore):
        return _of_points((a.p, core_a.radius, 0), (b.p, core_b.radius, 0), within, b.axes[2])
    if isinstance(core_a, PointCore | SegmentCore) and isinstance(core_b, SegmentCore):
        return _of_capsules(a, b, within, limit)
    if isinstance(core_a, BoxCore) and isinstance(core_b, BoxCore):
        return _of_boxes(a, core_a, b, core_b, within, limit, spares)
    return _of_convex(a, b, within, limit, spares)


def _contacts(
    candidates: list[ContactCandidate], normal: Vector3, *, spare: bool = False
) -> tuple[ContactPoint, ...]:
    return tuple(ContactPoint(c.point_a, c.point_b, normal, c.gap, c.feature, spare) for c in candidates)


def _chosen(
    candidates: list[ContactCandidate], limit: int, size: float, normal: Vector3, spares: bool
) -> tuple[ContactPoint, ...]:
    """Return the contact points of the candidates that `divided` chooses, and those left over as spares."""
    chosen, others = divided(candidates, limit, size)
    found = _contacts(chosen, normal)
    return found + _contacts(others, normal, spare=True) if spares else found


def _of_points(
    a: tuple[Vector3, float, int], b: tuple[Vector3, float, int], within: float, fallback: Vector3
) -> tuple[ContactPoint, ...]:
    """Return the contact point of two balls: centre, radius, and number of the feature of each; along
    `fallback` for one centre."""
    (ax, ay, az), radius_a, part_a = a
    (bx, by, bz), radius_b, part_b = b
    x, y, z = ax - bx, ay - by, az - bz
    length = math.sqrt(x * x + y * y + z * z)
    gap = length - radius_a - radius_b
    if gap > within:
        return ()
    x, y, z = (x / length, y / length, z / length) if length > 0.0 else fallback
    on_a = ax - radius_a * x, ay - radius_a * y, az - radius_a * z
    on_b = bx + radius_b * x, by + radius_b * y, bz + radius_b * z
    return (ContactPoint(on_a, on_b, (x, y, z), gap, (part_a, part_b)),)


def _of_capsules(a: PlacedSolid, b: PlacedSolid, within: float, limit: int) -> tuple[ContactPoint, ...]:
    """Return the contact points of two capsules, or of a ball and a capsule: at the nearest points of the
    axes, or at both ends of the stretch along which nearly parallel axes are beside each other."""
    core_a, core_b = a.solid.core, b.solid.core
    assert isinstance(core_a, PointCore | SegmentCore)
    assert isinstance(core_b, SegmentCore)
    half_a = core_a.half if isinstance(core_a, SegmentCore) else 0.0
    half_b = core_b.half
    axis_a, axis_b = a.axes[2], b.axes[2]
    between = minus(a.p, b.p)
    cosine = dot(axis_a, axis_b)
    along_a, along_b = -dot(between, axis_a), dot(between, axis_b)
    across = cross(axis_a, axis_b)
    square = dot(across, across)
    # Places on both axes that are nearest to each other.
    s = along_a if square < 1e-16 else (along_a + cosine * along_b) / square
    s = min(max(s, -half_a), half_a)
    t = min(max(along_b + cosine * s, -half_b), half_b)
    s = min(max(along_a + cosine * t, -half_a), half_a)
    length = math.sqrt(square)
    fallback = (across[0] / length, across[1] / length, across[2] / length) if length > 1e-8 else b.axes[0]
    found = _of_points(
        (_beyond(a.p, s, axis_a), core_a.radius, NEAREST),
        (_beyond(b.p, t, axis_b), core_b.radius, NEAREST),
        within,
        fallback,
    )
    if not found or half_a == 0.0 or square > PARALLEL_SINE * PARALLEL_SINE:
        return found
    normal, gap = found[0].normal, found[0].gap
    frame, size = frame_along(normal), half_a + half_b + core_a.radius + core_b.radius
    candidates = candidates_of_features(*_features(a, b, between, frame), frame, b.p, within, size)
    least = min((each.gap for each in candidates), default=math.inf)
    if least > gap + TIE * size:
        on_a = minus(found[0].point_a, b.p)
        place = dot(frame.u, on_a), dot(frame.v, on_a)
        candidates.insert(0, ContactCandidate(*place, gap, *found[0][:2], found[0].feature))
    return _contacts(reduced(candidates, limit, size), normal)


def _beyond(p: Vector3, s: float, axis: Vector3) -> Vector3:
    return p[0] + s * axis[0], p[1] + s * axis[1], p[2] + s * axis[2]


def _of_field(a: PlacedSolid, b: PlacedSolid, within: float, limit: int) -> tuple[ContactPoint, ...]:
    """Return the contact points of a bounded shape with a height field, each with the normal of its place."""
    core = a.solid.core
    assert core is not None
    size = core.extent + core.radius
    groups: list[tuple[Vector3, list[ContactCandidate]]] = []
    for normal, candidate in field_candidates(a, b, within):
        for other, group in groups:
            if dot(normal, other) > SAME_NORMAL:
                group.append(candidate)
                break
        else:
            groups.append((normal, [candidate]))
    found = [(normal, each) for normal, group in groups for each in reduced(group, limit, size)]
    if len(found) > limit:
        kept = {id(each) for each in largest([each for _, each in found], limit, size)}
        found = [pair for pair in found if id(pair[1]) in kept]
    # A vertex in a valley touches both slopes: its second contact point is numbered apart.
    points: list[ContactPoint] = []
    known: set[tuple[int, int]] = set()
    for normal, each in found:
        part_a, part_b = each.feature
        while (part_a, part_b) in known:
            part_b -= VALLEY
        known.add((part_a, part_b))
        points.append(ContactPoint(each.point_a, each.point_b, normal, each.gap, (part_a, part_b)))
    return tuple(points)


def _of_boxes(
    a: PlacedSolid,
    core_a: BoxCore,
    b: PlacedSolid,
    core_b: BoxCore,
    within: float,
    limit: int,
    spares: bool,
) -> tuple[ContactPoint, ...]:
    between = a.p[0] - b.p[0], a.p[1] - b.p[1], a.p[2] - b.p[2]
    found = box_separation(a.axes, core_a.halves, b.axes, core_b.halves, between, within)
    if found is None:
        return ()
    separation, normal = found
    size = core_a.extent + core_b.extent
    frame = frame_along(normal)
    candidates = candidates_of_features(*_features(a, b, between, frame), frame, b.p, within, size)
    # Separated boxes are farther apart than along each axis, unless two of their points show that distance.
    least = min((each.gap for each in candidates), default=math.inf)
    if separation > 0.0 and least > separation + TIE * size:
        return _of_convex(a, b, within, limit, spares)
    return _chosen(candidates, limit, size, normal, spares)


def _features(
    a: PlacedSolid, b: PlacedSolid, between: Vector3, frame: ContactFrame
) -> tuple[SupportFeature, SupportFeature]:
    """Return the features of two shapes that face each other along a normal, about the origin of b."""
    return support_feature(a, between, frame, -1.0), support_feature(b, (0.0, 0.0, 0.0), frame, 1.0)


def candidates_of_features(
    feature_a: SupportFeature,
    feature_b: SupportFeature,
    frame: ContactFrame,
    origin: Vector3,
    within: float,
    size: float,
) -> list[ContactCandidate]:
    """Return the places of two features at which the gap is at most `within`."""
    ox, oy, oz = origin
    found: list[ContactCandidate] = []
    for u, v, height_a, height_b, part_a, part_b, du, dv in overlap(
        feature_a, feature_b, MARGIN * size, within
    ):
        gap = height_a - height_b
        if gap <= within:
            ax, ay, az = frame.point(u, v, height_a)
            bx, by, bz = frame.point(u + du, v + dv, height_b)
            on_a, on_b = (ox + ax, oy + ay, oz + az), (ox + bx, oy + by, oz + bz)
            found.append(ContactCandidate(u, v, gap, on_a, on_b, (part_a, part_b)))
    return found


def _faces(each: ContactCandidate, normal: Vector3, margin: float) -> bool:
    """Check whether the points of a candidate are beside each other by no more than a margin."""
    x, y, z = minus(each.point_a, each.point_b)
    gap = each.gap
    return math.hypot(x - gap * normal[0], y - gap * normal[1], z - gap * normal[2]) <= margin


def _along_axis(
    a: PlacedSolid,
    core_a: Core,
    b: PlacedSolid,
    core_b: Core,
    between: Vector3,
    within: float,
    size: float,
) -> tuple[Vector3, list[ContactCandidate]] | None:
    """Return the normal and the candidates where the best of some axes is proven to be the normal, with no
    candidates if the shapes are farther apart than `within`; otherwise None."""
    # The centre of a ball needs no proof: its nearest point is quickly found.
    axis = None if isinstance(core_a, PointCore) else best_axis(core_a, core_b)
    if axis is None:
        return None
    separation, normal = axis
    gap = separation - core_a.radius - core_b.radius
    if gap > within:
        return normal, []
    frame = frame_along(normal)
    candidates = candidates_of_features(*_features(a, b, between, frame), frame, b.p, within, size)
    deepest = [
        each for each in candidates if each.gap <= gap + TIE * size and _faces(each, normal, MARGIN * size)
    ]
    if not deepest:
        return None
    if separation <= 0.0:
        # The middle of all deepest points is deep, too, and farther from the outlines.
        count, (x, y, z) = len(deepest), normal
        u, v = sum(each.u for each in deepest) / count, sum(each.v for each in deepest) / count
        below = min(dot(normal, minus(each.point_a, b.p)) for each in deepest)
        above = max(dot(normal, minus(each.point_b, b.p)) for each in deepest)
        core_a.place(a.R, between)
        core_b.place(b.R, (0.0, 0.0, 0.0))
        radius = tangent_radius(core_a, frame.point(u, v, below), (-x, -y, -z))
        if radius + tangent_radius(core_b, frame.point(u, v, above), normal) < -separation:
            return None
    return normal, candidates


def _of_convex(
    a: PlacedSolid, b: PlacedSolid, within: float, limit: int, spares: bool
) -> tuple[ContactPoint, ...]:
    """Return the contact points of two bounded shapes by their distance and the features along its normal."""
    core_a, core_b, between = placed_cores(a, b)
    size = core_a.extent + core_a.radius + core_b.extent + core_b.radius
    found = _along_axis(a, core_a, b, core_b, between, within, size)
    if found is not None:
        normal, candidates = found
        return _chosen(candidates, limit, size, normal, spares)
    T_a, T_b = a.T, b.T
    T_a[:3, 3], T_b[:3, 3] = between, 0.0
    nearest = distance_of_cores(core_a, T_a, core_b, T_b, within)
    if nearest is None or nearest.distance > within:
        return ()
    x, y, z = nearest.normal.tolist()
    normal = x, y, z
    frame = frame_along(normal)
    candidates = []
    if not isinstance(core_a, _CURVED) and not isinstance(core_b, _CURVED):
        candidates = candidates_of_features(*_features(a, b, between, frame), frame, b.p, within, size)
    least = min((each.gap for each in candidates), default=math.inf)
    if least > nearest.distance + TIE * size:
        ox, oy, oz = b.p
        (ax, ay, az), (bx, by, bz) = nearest.point_a.tolist(), nearest.point_b.tolist()
        on_a, on_b = (ox + ax, oy + ay, oz + az), (ox + bx, oy + by, oz + bz)
        gap = (ax - bx) * x + (ay - by) * y + (az - bz) * z
        place = dot(frame.u, (ax, ay, az)), dot(frame.v, (ax, ay, az))
        candidates.insert(0, ContactCandidate(*place, gap, on_a, on_b, (NEAREST, NEAREST)))
    return _chosen(candidates, limit, size, normal, spares)
