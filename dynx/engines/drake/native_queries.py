"""Drake's own nearest points, of a scene in its stepper."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from dynx.distance import distance
from dynx.engines.drake.stepper import DrakeStepper, engine_errors
from dynx.model.geometry import HeightField, Plane
from dynx.rbd.kinematics import body_poses
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.steppers.layout import WORLD, Collider
from dynx.steppers.native_queries import NativeQueries
from dynx.steppers.stepper import TouchingPoint


class DrakeQueries(NativeQueries):
    """Queries by Drake; those of a ground are dynx's, because Drake has them for balls only."""

    name: ClassVar[str] = "drake"

    def __init__(self, stepper: DrakeStepper) -> None:
        super().__init__(stepper)
        self.stepper: DrakeStepper = stepper

    @property
    def closed(self) -> bool:
        """True after the stepper was closed."""
        return self.stepper.closed

    @engine_errors
    def closest(self, a: int, b: int, within: float) -> TouchingPoint | None:
        first, second = (self.layout.colliders[number] for number in (a, b))
        found: list[TouchingPoint] = []
        if _is_plane(first) or _is_plane(second):
            found = self._closest_to_planes(a, b)
        else:
            query = self.stepper.query()
            for one in self.stepper.built.geometries[a]:
                for other in self.stepper.built.geometries[b]:
                    found.append(TouchingPoint(a, b, *_closest_of_pair(query, one, other)))
        nearest = min(found, key=lambda point: point.distance, default=None)
        return nearest if nearest is not None and nearest.distance <= within else None

    def _closest_to_planes(self, a: int, b: int) -> list[TouchingPoint]:
        """Return the nearest points of a ground and other shapes by dynx: Drake has them for balls only."""
        found = []
        first, second = self.layout.colliders[a], self.layout.colliders[b]
        T_first, T_second = self._pose(first), self._pose(second)
        for one in first.shapes:
            for other in second.shapes:
                planes = isinstance(one.shape, Plane) + isinstance(other.shape, Plane)
                if planes != 1 or isinstance(one.shape, HeightField) or isinstance(other.shape, HeightField):
                    continue
                near = distance(one.shape, T_first @ one.T, other.shape, T_second @ other.T)
                found.append(TouchingPoint(a, b, near.point_a, near.point_b, near.normal, near.distance))
        return found

    def _pose(self, collider: Collider) -> Floats:
        """Return the pose (4, 4) of the owner of a collider."""
        robot, body = collider.owner
        if robot is None:
            return np.eye(4) if body == WORLD else self.stepper.body_state(body).T_world_body
        mechanism = self.layout.robots[robot].model.mechanism
        q = self.stepper.robot_state(robot).q
        poses = body_poses(mechanism, mechanism.tree_q(q))
        return np.asarray(homogeneous(*poses[body]))


def _is_plane(collider: Collider) -> bool:
    return any(isinstance(placed.shape, Plane) for placed in collider.shapes)


def _closest_of_pair(query: Any, a: Any, b: Any) -> tuple[Floats, Floats, Floats, float]:
    """Return the nearest points of two geometries of Drake, the normal from b to a, and the distance."""
    found = query.ComputeSignedDistancePairClosestPoints(a, b)
    point_a = query.GetPoseInWorld(found.id_A).multiply(found.p_ACa)
    point_b = query.GetPoseInWorld(found.id_B).multiply(found.p_BCb)
    normal = np.array(found.nhat_BA_W)
    if found.id_A != a:
        point_a, point_b, normal = point_b, point_a, -normal
    return np.array(point_a), np.array(point_b), normal, float(found.distance)
