"""First hits of rays on the colliders of a world, in closed form, the same for every engine."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dynx.model.geometry import HeightField, Plane, Shape
from dynx.model.geometry.ray_casting import cast_on_shape
from dynx.spatial.scalar import Floats
from dynx.steppers.layout import Layout
from dynx.steppers.native_queries import RayHit
from dynx.world.geometry.boxes import shape_box
from dynx.world.geometry.owner_poses import OwnerPoses

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
