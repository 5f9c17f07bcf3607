"""Error between a frame and its target along given axes, with weights and tolerances for each of them."""

from __future__ import annotations

import math

import numpy as np

from dynx.ik.axes import AxisRequirement
from dynx.ik.residual import rotation_vector
from dynx.spatial.scalar import Floats

INSIDE = 0.99
"""Fraction of a tolerance along an axis at which its error begins to count: the search ends within it."""

SMALL_SINE = 1e-12
"""Sine of the angle between two directions below which their cross product does not give an axis."""


class AxisResidual:
    """Weighted error from a frame to one target along the axes of the target or of the world.

    With a tolerance for each axis the target is a region: an error within it does not count.
    """

    def __init__(
        self, position: Floats | None, rotation: Floats | None, point: Floats | None, axes: AxisRequirement
    ) -> None:
        self._position, self._rotation, self._point = position, rotation, point
        weights = np.array(axes.weights)
        self._rows = np.flatnonzero(weights)
        self._weights = weights[self._rows]
        self._used = weights != 0.0
        self._bounds = np.full(6, np.inf)
        """Tolerance of each component; infinite where the norm of the part is bounded."""
        self.bounds_position, self.bounds_rotation = axes.position_tolerances, axes.rotation_tolerances
        if axes.position_tolerances is not None:
            self._bounds[:3] = axes.position_tolerances
        if axes.rotation_tolerances is not None:
            self._bounds[3:] = axes.rotation_tolerances
        self._slack = np.where(np.isfinite(self._bounds), INSIDE * self._bounds, 0.0)
        self._axes = rotation if axes.of_target and rotation is not None else np.eye(3)
        k = axes.free_rotation
        self._direction: Floats | None = None
        self._in_frame = np.zeros(3)
        if k is not None and rotation is not None:
            self._direction = self._axes[:, k]
            self._in_frame = rotation.T @ self._direction

    def __call__(self, T_world_frame: Floats) -> tuple[Floats, float, float, bool, Floats]:
        """Return (weighted error (m,); position error [m]; rotation error [rad]; whether every error is
        within its own tolerance; L (m, 6) with rows L J for a Jacobian J in world axes)."""
        R, p = T_world_frame[:3, :3], T_world_frame[:3, 3]
        error, L = np.zeros(6), np.zeros((6, 6))
        to_axes = self._axes.T
        if self._position is not None:
            placed = p if self._point is None else R @ self._point + p
            error[:3], L[:3, :3] = to_axes @ (self._position - placed), to_axes
        if self._rotation is not None:
            if self._direction is None:
                error[3:], L[3:, 3:] = to_axes @ rotation_vector(self._rotation @ R.T)[:3], to_axes
            else:
                current = R @ self._in_frame
                error[3:] = to_axes @ rotation_between(current, self._direction)
                L[3:, 3:] = to_axes @ (np.eye(3) - np.outer(current, current))
        error = np.where(self._used, error, 0.0)
        distance, angle = float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]))
        within = bool((np.abs(error) <= self._bounds).all())
        excess = np.sign(error) * np.maximum(np.abs(error) - self._slack, 0.0)
        # An error within its tolerance restricts nothing.
        counts = self._weights * ((excess != 0.0) | (self._slack == 0.0))[self._rows]
        return counts * excess[self._rows], distance, angle, within, counts[:, None] * L[self._rows]


def rotation_between(a: Floats, b: Floats) -> Floats:
    """Return the smallest rotation vector (3,) [rad] that turns the unit vector a to b."""
    x, y, z = a
    u, v, w = b
    normal = np.array([y * w - z * v, z * u - x * w, x * v - y * u])
    sine, cosine = float(np.linalg.norm(normal)), float(a @ b)
    if sine > SMALL_SINE:
        return normal * (math.atan2(sine, cosine) / sine)
    if cosine > 0.0:
        return normal
    # Opposite directions: any axis perpendicular to them.
    across = np.eye(3)[int(np.argmin(np.abs(b)))]
    perpendicular = across - b * float(across @ b)
    return np.asarray(perpendicular * (math.pi / float(np.linalg.norm(perpendicular))))
