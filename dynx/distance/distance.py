"""Distance of two convex shapes, with a lower and an upper bound that a user can check."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from dynx.distance.cores import ConvexShape, Core, core_of
from dynx.distance.gjk import CorePair
from dynx.errors import ArgumentError
from dynx.model import Pose
from dynx.model.elements import checked_pose, rigid_matrix
from dynx.model.geometry import Plane
from dynx.model.numbers import MAX_MAGNITUDE, checked_vector
from dynx.spatial.plain import Vector3
from dynx.spatial.scalar import Floats

if TYPE_CHECKING:
    from dynx.distance.penetration import Penetration


@dataclass(frozen=True, eq=False)
class Distance:
    """Signed distance of two shapes between two bounds: negative where they overlap.

    The distance of overlapping shapes is minus the depth: the length of the shortest translation that makes
    their interiors disjoint. `lower` is always the separation of the shapes along `normal` (`separation`),
    computed from the support functions alone. For separated shapes `upper` is the distance of the two points.
    For overlapping shapes `upper` is minus the radius of a ball inside their difference, or equals `lower` if
    the depth has a closed form.
    """

    lower: float
    upper: float
    point_a: Floats
    """Point (3,) of a [m]."""
    point_b: Floats
    """Point (3,) of b [m]; `point_a - point_b` is the distance times the normal."""
    normal: Floats
    """Unit vector (3,) from b to a. For overlapping shapes, a leaves b by the shortest way along it."""

    @property
    def distance(self) -> float:
        """Signed distance [m]: `upper` for separated shapes, `lower` for overlapping shapes."""
        return self.upper if self.upper > 0.0 else self.lower

    @property
    def max_error(self) -> float:
        """Difference of the bounds [m], at least 0: the largest possible error of the distance."""
        return max(0.0, self.upper - self.lower)

    def swapped(self) -> Distance:
        """Return the distance of b and a."""
        return Distance(self.lower, self.upper, self.point_b, self.point_a, -self.normal)


def distance(
    shape_a: ConvexShape | Plane, T_a: Pose | ArrayLike, shape_b: ConvexShape | Plane, T_b: Pose | ArrayLike
) -> Distance:
    """Return the signed distance of two convex shapes at poses (a `Pose` or a matrix (4, 4)).

    For a mesh dynx uses the convex hull, for a plane the half-space. Raises ArgumentError for two planes and
    for objects that are not convex shapes, the errors of `Mesh.hull`, and the errors of invalid poses.
    """
    poses = checked_distance_pose("T_a", T_a), checked_distance_pose("T_b", T_b)
    found = distance_of_cores(_core_of(shape_a, "shape_a"), poses[0], _core_of(shape_b, "shape_b"), poses[1])
    assert found is not None
    return found


def support(shape: ConvexShape | Plane, T: Pose | ArrayLike, direction: ArrayLike) -> tuple[float, Floats]:
    """Return h(n) = max {n . x : x in shape} for the unit vector n of a direction, and its point.

    For a plane h is infinite along all directions but its normal.
    """
    return _support(
        _core_of(shape, "shape"), checked_distance_pose("T", T), checked_vector("direction", direction)
    )


def _support(core: Core | None, pose: Floats, direction: Floats) -> tuple[float, Floats]:
    """Return the support of a core, or of a half-space for None."""
    length = float(np.linalg.norm(direction))
    if length == 0.0:
        raise ArgumentError("direction is zero; wanted a vector of any length above zero")
    n = direction / length
    if core is None:
        up, p = _normal(pose), pose[:3, 3]
        along = np.abs(n - up).max() <= NORMAL_ROUNDING
        return (float(n @ p), p.copy()) if along else (np.inf, np.full(3, np.nan))
    core.place(pose[:3, :3], _tuple(pose[:3, 3]))
    point = np.array(core.support(_tuple(n))) + core.radius * n
    return float(n @ point), point


def separation(
    shape_a: ConvexShape | Plane,
    T_a: Pose | ArrayLike,
    shape_b: ConvexShape | Plane,
    T_b: Pose | ArrayLike,
    normal: ArrayLike,
) -> float:
    """Return min {n . x : x in a} - max {n . x : x in b} for the unit vector n of `normal`.

    It is a lower bound of the signed distance for every normal, and equal to it for the best.
    """
    a, b = _core_of(shape_a, "shape_a"), _core_of(shape_b, "shape_b")
    T_a, T_b = checked_distance_pose("T_a", T_a), checked_distance_pose("T_b", T_b)
    n = checked_vector("normal", normal)
    # Far from the origin of the world the digits of a difference of heights would be lost.
    near_a, near_b = T_a.copy(), T_b.copy()
    near_a[:3, 3], near_b[:3, 3] = 0.0, T_b[:3, 3] - T_a[:3, 3]
    return -_support(a, near_a, -n)[0] - _support(b, near_b, n)[0]


MIN_RESOLVED_DISTANCE = 1e-12
"""Distance of cores, relative to their size, below which the direction between their points is rounding."""

CLOSED_FORM_GAP = 1e-12
"""Gap between the bounds of a closed form, relative to the size of the cores, that needs no polytope."""

NORMAL_ROUNDING = 1e-15
"""Difference of a direction from the normal of a half-space that is rounding."""


def distance_of_cores(
    a: Core | None, T_a: Floats, b: Core | None, T_b: Floats, limit: float = math.inf
) -> Distance | None:
    """Return the distance of two cores at checked poses (4, 4), where None is a half-space.

    Returns None where the distance is certainly larger than `limit`.
    """
    p_a, p_b = T_a[:3, 3], T_b[:3, 3]
    if a is None or b is None:
        if a is not None:
            return _distance_from_plane(a, T_a, T_b)
        if b is not None:
            return _distance_from_plane(b, T_b, T_a).swapped()
        raise ArgumentError("both shapes are planes; the distance of two half-spaces is not defined")
    between = _tuple(p_b - p_a)
    a.place(T_a[:3, :3], (0.0, 0.0, 0.0))
    b.place(T_b[:3, :3], between)
    guess = (-between[0], -between[1], -between[2]) if any(between) else (0.0, 0.0, 1.0)
    pair = CorePair(a, b, guess).run(limit + a.radius + b.radius)
    if pair.lower > limit + a.radius + b.radius:
        return None
    if pair.separated:
        normal = np.array(pair.normal)
        on_a, on_b = np.array(pair.point_a), np.array(pair.point_b)
        # Along the line of the two points, so that their distance is that of the cores less the radii.
        resolved = pair.upper > MIN_RESOLVED_DISTANCE * (a.extent + b.extent)
        along = (on_a - on_b) / pair.upper if resolved else normal
        lower, upper = pair.lower, pair.upper
    else:
        found = _penetration(a, b)
        normal = along = -found.normal
        on_a, on_b, lower, upper = found.point_a, found.point_b, -found.upper, -found.lower
    radii = a.radius + b.radius
    return Distance(
        lower=lower - radii,
        upper=max(lower, upper) - radii,
        point_a=p_a + (on_a - a.radius * along),
        point_b=p_a + (on_b + b.radius * along),
        normal=normal,
    )


def _penetration(a: Core, b: Core) -> Penetration:
    """Return the depth in closed form where that is exact, otherwise with the better bounds."""
    # Imported here, because searches avoid shapes that overlap.
    from dynx.distance.closed_form_depths import penetration_of_parallel, penetration_of_point
    from dynx.distance.penetration import penetration

    point = penetration_of_point(a, b)
    if point is not None:
        return point
    parallel = penetration_of_parallel(a, b)
    if parallel is not None and parallel.upper - parallel.lower <= CLOSED_FORM_GAP * (a.extent + b.extent):
        return parallel
    found = penetration(a, b)
    closer = parallel is None or found.upper - found.lower <= parallel.upper - parallel.lower
    return found if closer or parallel is None else parallel


def _distance_from_plane(a: Core, T_a: Floats, T_plane: Floats) -> Distance:
    """Return the distance of a core from a half-space: the height of its lowest point, of either sign."""
    up = _normal(T_plane)
    a.place(T_a[:3, :3], (0.0, 0.0, 0.0))
    lowest = np.array(a.support(_tuple(-up))) - a.radius * up
    height = float(up @ (lowest + (T_a[:3, 3] - T_plane[:3, 3])))
    point = T_a[:3, 3] + lowest
    return Distance(height, height, point, point - height * up, up)


def _normal(T_plane: Floats) -> Floats:
    up = T_plane[:3, 2]
    return np.asarray(up / np.linalg.norm(up))


def _core_of(shape: ConvexShape | Plane, name: str) -> Core | None:
    return None if isinstance(shape, Plane) else core_of(shape, name)


def _tuple(vector: Floats) -> Vector3:
    x, y, z = vector.tolist()
    return x, y, z


def checked_distance_pose(name: str, T: Pose | ArrayLike) -> Floats:
    """Return a pose as a matrix, as it is: not the nearest rotation."""
    if isinstance(T, Pose):
        return checked_pose(name, T).matrix
    array = rigid_matrix(T, name)
    if np.abs(array[:3, 3]).max() >= MAX_MAGNITUDE:
        raise ArgumentError(f"the position of {name} is {array[:3, 3]}; wanted less than {MAX_MAGNITUDE:g}")
    return array
