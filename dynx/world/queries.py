"""Contacts, distances, boxes and rays of a world by name, from an engine that knows numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dynx.distance import Distance
from dynx.distance.solids import Solid, distance_of_solids
from dynx.errors import ArgumentError, ShapeError, UnknownNameError, shown
from dynx.model.geometry import HeightField, Plane, Shape
from dynx.model.geometry.ray_casting import cast_on_shape
from dynx.model.numbers import MAX_MAGNITUDE, checked_array, checked_vector, is_real
from dynx.spatial.scalar import Floats
from dynx.steppers.layout import Layout
from dynx.steppers.native_queries import NativeQueries, RayHit, native_queries_of
from dynx.steppers.state import WorldState
from dynx.steppers.stepper import Stepper, TouchingPoint
from dynx.world.boxes import OwnerPoses, collider_box, shape_box
from dynx.world.contacts import ClosestPoints, Contact, RayHits
from dynx.world.scene.scene import Scene


class Distances:
    """Distances of the colliders of one layout."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._solids: dict[int, list[Solid]] = {}

    def closest(
        self, state: WorldState, first: list[int], second: list[int], within: float
    ) -> Iterator[tuple[int, int, Distance]]:
        """Yield the distance of each pair of colliders that are at most `within` [m] apart.

        Of colliders with several shapes it is the pair of shapes with the least signed distance.
        """
        poses = OwnerPoses(self._layout, state)
        placed = {number: self._placed(number, poses) for number in {*first, *second}}
        for i in first:
            for j in second:
                if i == j:
                    continue
                best: Distance | None = None
                for solid_a, T_a, ball_a in placed[i]:
                    for solid_b, T_b, ball_b in placed[j]:
                        limit = within if best is None else best.distance
                        if math.dist(ball_a[:3], ball_b[:3]) - ball_a[3] - ball_b[3] > limit:
                            continue
                        found = distance_of_solids(solid_a, T_a, solid_b, T_b, limit)
                        if found is not None and found.distance <= limit:
                            best = found
                if best is not None:
                    yield i, j, best

    def _placed(self, number: int, poses: OwnerPoses) -> list[tuple[Solid, Floats, list[float]]]:
        """Return the solids of a collider, each with its pose and the ball around it."""
        collider = self._layout.colliders[number]
        if number not in self._solids:
            self._solids[number] = [Solid(placed.shape, placed.T) for placed in collider.shapes]
        pose = poses[collider.owner]
        return [solid.place(pose) for solid in self._solids[number]]


_ROUNDING = 1.0 + 1e-9
"""Factor by which a ball around a shape is enlarged, so that rounding loses no hit on its surface."""


def first_hits(
    layout: Layout, poses: OwnerPoses, origins: Floats, directions: Floats, length: float
) -> list[RayHit]:
    """Return what rays from `origins` (n, 3) along unit `directions` (n, 3) hit first within `length` [m].

    Only rays that pass the ball around a shape are intersected with it.
    """
    n = len(origins)
    first, nearest, normals = np.full(n, -1), np.full(n, np.inf), np.full((n, 3), np.nan)
    for number, collider in enumerate(layout.colliders):
        T_world_owner = poses[collider.owner]
        for placed in collider.shapes:
            T = T_world_owner @ placed.T
            rays = np.flatnonzero(_near(placed.shape, T, origins, directions))
            if not rays.size:
                continue
            distance, normal = cast_on_shape(placed.shape, T, origins[rays], directions[rays])
            nearer = (distance < nearest[rays]) & (distance <= length)
            rays = rays[nearer]
            first[rays] = number
            nearest[rays], normals[rays] = distance[nearer], normal[nearer]
    return [
        RayHit(None if number < 0 else number, distance, normal)
        for number, distance, normal in zip(first.tolist(), nearest.tolist(), normals, strict=True)
    ]


def _near(shape: Shape, T: Floats, origins: Floats, directions: Floats) -> NDArray[np.bool_]:
    """Return which rays (n,) pass the ball around a shape at the pose T (4, 4), and begin before its end."""
    middle, radius = _ball(shape)
    if not math.isfinite(radius):
        return np.ones(len(origins), dtype=bool)
    away = origins - (T[:3, :3] @ middle + T[:3, 3])
    along = np.einsum("ij,ij->i", away, directions)
    beside = away - along[:, None] * directions
    near: NDArray[np.bool_] = (np.einsum("ij,ij->i", beside, beside) <= radius * radius) & (along <= radius)
    return near


@lru_cache(maxsize=1024)
def _ball(shape: Shape) -> tuple[Floats, float]:
    """Return the middle (3,) and the radius of a ball around a shape; infinite for a ground."""
    if isinstance(shape, Plane | HeightField):
        return np.zeros(3), math.inf
    low, high = shape_box(shape, np.eye(4))
    return 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low)) * _ROUNDING


_NO_FORCE = np.zeros(3)


class Queries:
    """The queries of one world. `engine` is passed to each, because a world may replace it."""

    def __init__(self, scene: Scene, layout: Layout) -> None:
        self._scene = scene
        self._layout = layout
        self._names = tuple(collider.name for collider in layout.colliders)
        self._distances = Distances(layout)
        self._number = {name: k for k, name in enumerate(self._names)}
        self._natives: NativeQueries | None = None

    def contacts(self, engine: Stepper, part: str | None = None) -> tuple[Contact, ...]:
        """Return the contacts of the last step, of a part or all, ordered by the parts of the scene."""
        points = sorted(map(_ordered, engine.contacts()), key=lambda point: (point.a, point.b))
        if part is not None:
            own = set(self.colliders(part))
            points = [point for point in points if point.a in own or point.b in own]
        names = self._names
        return tuple(
            Contact(
                names[p.a],
                names[p.b],
                p.point_a,
                p.point_b,
                p.normal,
                p.distance,
                p.normal_force,
                _NO_FORCE.copy() if p.friction_force is None else p.friction_force,
            )
            for p in points
        )

    def touching_pairs(self, engine: Stepper) -> frozenset[tuple[str, str]]:
        """Return the names of the parts that touch, ordered by the parts of the scene."""
        names = self._names
        return frozenset(
            (names[a], names[b]) if a <= b else (names[b], names[a]) for a, b in engine.touching_pairs()
        )

    def closest_points(
        self, engine: Stepper, state: WorldState, a: str, b: str, within: float, native: bool
    ) -> tuple[ClosestPoints, ...]:
        """Return the nearest points of each pair of parts, nearest pair first, by dynx or by the engine."""
        if not is_real(within) or not 0.0 <= within < MAX_MAGNITUDE:
            raise ArgumentError(f"within is {shown(within)}; wanted a number of at least 0 [m]")
        first, second = self.colliders(a), self.colliders(b)
        if len({*first, *second}) == 1:
            raise ArgumentError(f"{shown(a)} and {shown(b)} are one shape, which has no distance from itself")
        points: list[ClosestPoints] = []
        if native:
            for i, j in product(first, second):
                found = self._native(engine).closest(i, j, float(within)) if i != j else None
                if found is not None:
                    points.append(self._nearest(i, j, found))
        else:
            distances = self._distances.closest(state, first, second, float(within))
            points += [self._nearest(i, j, found) for i, j, found in distances]
        return tuple(sorted(points, key=lambda each: each.distance))

    def _native(self, engine: Stepper) -> NativeQueries:
        """Return the engine's own queries of its present state."""
        if self._natives is None or self._natives.stepper is not engine:
            self._natives = native_queries_of(type(engine))(engine)
        return self._natives

    def _nearest(self, i: int, j: int, found: TouchingPoint | Distance) -> ClosestPoints:
        names = self._names[i], self._names[j]
        return ClosestPoints(
            *names, found.point_a, found.point_b, found.normal, found.distance + 0.0
        )  # not -0

    def aabb(self, state: WorldState, name: str) -> tuple[Floats, Floats]:
        """Return the corners of the smallest box that holds the boxes of all links of a part."""
        boxes = [self._box(state, k) for k in self.colliders(name)]
        return np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)

    def overlapping(self, state: WorldState, lower: ArrayLike, upper: ArrayLike) -> tuple[str, ...]:
        """Return the names of the links and bodies whose box overlaps that from `lower` to `upper`."""
        low, high = checked_vector("lower", lower), checked_vector("upper", upper)
        if (low > high).any():
            raise ArgumentError(f"lower is {low.tolist()}, above upper, {high.tolist()}")
        found = []
        for k, name in enumerate(self._names):
            least, most = self._box(state, k)
            if (least <= high).all() and (low <= most).all():
                found.append(name)
        return tuple(found)

    def _box(self, state: WorldState, number: int) -> tuple[Floats, Floats]:
        return collider_box(self._layout, self._layout.colliders[number], state)

    def cast_rays(
        self,
        engine: Stepper,
        state: WorldState,
        origins: ArrayLike,
        directions: ArrayLike,
        length: float,
    ) -> RayHits:
        """Return the first hit of each ray."""
        starts, along = checked_array("origins", origins, 3), checked_array("directions", directions, 3)
        if starts.ndim > 2 or along.ndim > 2:
            raise ShapeError(
                f"origins and directions have shapes {starts.shape}, {along.shape}; wanted (n, 3)"
            )
        try:
            starts, along = np.broadcast_arrays(np.atleast_2d(starts), np.atleast_2d(along))
        except ValueError:
            raise ShapeError(
                f"origins and directions have shapes {starts.shape}, {along.shape}; wanted the same number"
            ) from None
        if not is_real(length) or not 0.0 < length <= MAX_MAGNITUDE:
            raise ArgumentError(f"length is {shown(length)}; wanted a positive number [m]")
        norms = np.linalg.norm(along, axis=-1, keepdims=True)
        if (norms == 0.0).any():
            raise ArgumentError(f"directions[{int(np.argmin(norms))}] is zero; wanted a direction")
        starts, unit = np.array(starts), along / norms
        hits = self._native(engine).cast_rays(starts, unit, float(length))
        if hits is None:
            hits = first_hits(self._layout, OwnerPoses(self._layout, state), starts, unit, float(length))
        distances = np.array([np.inf if hit.collider is None else hit.distance for hit in hits])
        missed = np.array([hit.collider is None for hit in hits], dtype=bool)[:, None]
        reach = np.where(np.isfinite(distances), distances, 0.0)[:, None]
        return RayHits(
            tuple(None if hit.collider is None else self._names[hit.collider] for hit in hits),
            distances,
            np.where(missed, np.nan, starts + reach * unit),
            np.where(missed, np.nan, np.array([hit.normal for hit in hits]).reshape(-1, 3)),
        )

    def colliders(self, name: str) -> list[int]:
        """Return the numbers of the colliders of a body, a link, or all links of a robot."""
        self._scene.require(name)
        found = [self._number[name]] if name in self._number else []
        found = found or [k for each, k in self._number.items() if each.startswith(f"{name}/")]
        if not found:
            raise UnknownNameError(f"{shown(name)} has no collision shape in this world")
        return found


def _ordered(point: TouchingPoint) -> TouchingPoint:
    """Return a contact whose first collider is the earlier one of the scene."""
    if point.a < point.b:
        return point
    friction = None if point.friction_force is None else -point.friction_force
    return TouchingPoint(
        point.b,
        point.a,
        point.point_b,
        point.point_a,
        -point.normal,
        point.distance,
        point.normal_force,
        friction,
    )
