"""MuJoCo's own nearest points and rays, of a scene in its stepper."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, ClassVar

import numpy as np

from dynx.engines.mujoco.library import mujoco
from dynx.engines.mujoco.mjcf import FIELD_GROUP
from dynx.engines.mujoco.stepper import MujocoStepper, engine_errors
from dynx.model.geometry import HeightField
from dynx.model.geometry.ray_casting import cast_on_shape
from dynx.spatial.scalar import Floats
from dynx.steppers.camera import Camera, Drawing, DrawnShape
from dynx.steppers.native_queries import NativeQueries, RayHit
from dynx.steppers.stepper import TouchingPoint

NEAR = 1e-9
"""Distance [m] below which the direction between two points is rounding."""

NUDGE = 1e-5
"""Displacement [m] by which two shapes that just touch are separated to find their normal."""

_MISS = RayHit(None, np.inf, np.full(3, np.nan))


class MujocoQueries(NativeQueries):
    """Queries by MuJoCo; rays on height fields are dynx's, because one through a point of the grid passes
    MuJoCo's."""

    name: ClassVar[str] = "mujoco"

    def __init__(self, stepper: MujocoStepper) -> None:
        super().__init__(stepper)
        self.stepper: MujocoStepper = stepper
        layout = self.layout
        self._fields = [
            (number, placed.shape, layout.bodies[collider.owner.body].T @ placed.T)
            for number, collider in enumerate(layout.colliders)
            for placed in collider.shapes
            if isinstance(placed.shape, HeightField)
        ]
        self._groups = np.ones(6, dtype=np.uint8)
        self._groups[FIELD_GROUP] = 0

    @property
    def closed(self) -> bool:
        """True after the stepper was closed."""
        return self.stepper.closed

    @engine_errors
    def closest(self, a: int, b: int, within: float) -> TouchingPoint | None:
        self.stepper.place()
        geoms = self.stepper.built.collider_geoms
        found = _closest_of(self.stepper.model, self.stepper.data, geoms[a], geoms[b], within)
        return None if found is None else TouchingPoint(a, b, *found)

    @engine_errors
    def cast_rays(self, origins: Floats, directions: Floats, length: float) -> Sequence[RayHit]:
        self.stepper.place()
        nearest = self._cast_on_fields(origins, directions)
        geom, normal = np.zeros(1, dtype=np.int32), np.zeros(3)
        hits, colliders = [], self.stepper.built.geom_collider
        for ray in range(len(origins)):
            distance = mujoco.mj_ray(
                self.stepper.model,
                self.stepper.data,
                origins[ray],
                directions[ray],
                self._groups,
                True,
                -1,
                geom,
                normal,
            )
            collider: int | None = None
            if 0.0 <= distance <= length:
                collider, at, outward = (
                    colliders[geom[0]],
                    float(distance),
                    normal.copy(),
                )
            if nearest is not None and nearest[1][ray] <= (length if collider is None else at):
                collider, at, outward = nearest[0][ray], float(nearest[1][ray]), nearest[2][ray]
            hits.append(_MISS if collider is None else RayHit(collider, at, outward))
        return hits

    @classmethod
    def draw(cls, shapes: Sequence[DrawnShape], T_world_camera: Floats, camera: Camera) -> Drawing:
        # Imported here, because few worlds are drawn by it.
        from dynx.engines.mujoco.renderer import draw

        return draw(shapes, T_world_camera, camera)

    def _cast_on_fields(self, origins: Floats, directions: Floats) -> tuple[Any, Floats, Floats] | None:
        """Return the collider, distance and normal of each ray on height fields; None if there are none."""
        best = None
        for number, shape, T in self._fields:
            distance, normal = cast_on_shape(shape, T, origins, directions)
            if best is None:
                best = np.full(len(origins), number), distance, normal
                continue
            nearer = distance < best[1]
            best[0][nearer], best[1][nearer], best[2][nearer] = number, distance[nearer], normal[nearer]
        return best


def _closest_of(
    model: Any, data: Any, a: Iterable[int], b: Iterable[int], within: float
) -> tuple[Floats, Floats, Floats, float] | None:
    """Return the nearest points of two sets of geoms on a and on b, the normal and the distance.

    Returns None if all are farther apart than `within` [m]. The positions of the geoms in `data` must be
    current.
    """
    best, pair, points, segment = within, None, np.zeros(6), np.zeros(6)
    for first in a:
        for second in b:
            distance = mujoco.mj_geomDistance(model, data, first, second, best + NEAR, segment)
            if distance <= best:
                best, pair, points = float(distance), (first, second), segment.copy()
    if pair is None:
        return None
    difference = points[:3] - points[3:]
    length = float(np.linalg.norm(difference))
    if length > NEAR:
        normal = difference / (length if best > 0.0 else -length)
    else:
        normal = _normal_by_nudging(model, data, *pair)
    return points[:3], points[3:], normal, best


def _normal_by_nudging(model: Any, data: Any, a: int, b: int) -> Floats:
    """Return the normal of two geoms that just touch, by moving one of them away from the other."""
    plane = int(mujoco.mjtGeom.mjGEOM_PLANE)
    for geom, sign in ((a, -1.0), (b, 1.0)):
        if model.geom_type[geom] == plane:
            return np.asarray(sign * data.geom_xmat[geom].reshape(3, 3)[:, 2])
    away = data.geom_xpos[a] - data.geom_xpos[b]
    length = float(np.linalg.norm(away))
    away = away / length if length > NEAR else np.array([0.0, 0.0, 1.0])
    kept, segment = data.geom_xpos[a].copy(), np.zeros(6)
    data.geom_xpos[a] += NUDGE * away
    distance = mujoco.mj_geomDistance(model, data, a, b, 1.0, segment)
    data.geom_xpos[a] = kept
    difference = segment[:3] - segment[3:]
    size = float(np.linalg.norm(difference))
    if size <= NEAR:
        return away
    return np.asarray(difference / (size if distance > 0.0 else -size))
