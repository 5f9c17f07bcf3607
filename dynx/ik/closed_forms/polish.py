"""Newton's method on the chain itself, in array code for any scalar: closed forms hold for an idealised one.

The axes of real files meet, or are parallel, only to some digits. A solution for exact axes is near one of
the chain, which a few steps reach. The steps are those of Gauss and Newton with a damping so small that it
matters only at singular configurations. They multiply cosines and sines by rotations, so that no angle needs
to be computed in between.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dynx.ik.closed_forms.chain import Chain
from dynx.ik.closed_forms.subproblems import Coordinate, Slide, dot
from dynx.rbd.linear import ldl_factors, solve_ldl
from dynx.spatial.scalar import Array, Floats, append_axis, clamp, sqrt
from dynx.spatial.so3 import cross, rotate

DAMPING = 1e-13
"""Term added to the diagonal of J' J, with lengths relative to that of the chain."""

MAX_HALF_STEP = 0.1
"""Bound on the tangent of half the change of an angle in one step."""

_SNAP = 4e-16
"""Entries of constant rotations within this distance of 0, 1 or -1 are replaced by it."""


@dataclass(frozen=True, eq=False)
class AxisFrames:
    """Frames of the chain with z along each axis: the pose of each in the one before, and of the tool."""

    R: tuple[Floats, ...]
    p: tuple[Floats, ...]

    @classmethod
    def of(cls, chain: Chain) -> AxisFrames:
        """Return the frames of a chain."""
        Rs, ps = [], []
        R_before, p_before = np.eye(3), np.zeros(3)
        for axis, point in zip(chain.axes, chain.points, strict=True):
            R = _frame_along(axis, R_before)
            Rs.append(_snapped(R_before.T @ R))
            ps.append(_snapped(R_before.T @ (point - p_before)))
            R_before, p_before = R, point
        Rs.append(_snapped(R_before.T @ chain.T_zero[:3, :3]))
        ps.append(_snapped(R_before.T @ (chain.T_zero[:3, 3] - p_before)))
        return cls(tuple(Rs), tuple(ps))


def polished(
    frames: AxisFrames, R: Array, p: Array, angles: list[Coordinate], steps: int
) -> list[Coordinate]:
    """Return the angles after some steps towards the pose (R, p)."""
    for _ in range(steps):
        _, error, J = _error_and_jacobian(frames, R, p, angles)
        columns = np.stack(J, axis=-1)
        A = np.asarray(np.swapaxes(columns, -1, -2) @ columns + DAMPING * np.eye(len(angles), dtype=int))
        b = np.asarray((np.swapaxes(columns, -1, -2) @ error[..., None])[..., 0])
        step = (
            solve_ldl(*ldl_factors(A), b) if A.dtype == object else np.linalg.solve(A, b[..., None])[..., 0]
        )
        angles = [_moved(q, step[..., k]) for k, q in enumerate(angles)]
    return angles


def errors_of(frames: AxisFrames, R: Array, p: Array, angles: list[Coordinate]) -> tuple[Array, Array]:
    """Return the distance from the position p (...,), relative to the length of the chain, and twice the sine
    of half the angle from the rotation R (...,), which is the angle [rad] to third order."""
    chord, error, _ = _error_and_jacobian(frames, R, p, angles)
    position = error[..., :3]
    return sqrt(dot(position, position)), sqrt(chord)


def _error_and_jacobian(
    frames: AxisFrames, R: Array, p: Array, angles: list[Coordinate]
) -> tuple[Array, Array, list[Array]]:
    """Return the square of the rotation error's chord, the twist to the pose, and the columns of J."""
    axes, origins = [], []
    R_here, p_here = frames.R[0], frames.p[0]
    for q, R_next, p_next in zip(angles, frames.R[1:], frames.p[1:], strict=True):
        x, y, z = R_here[..., :, 0], R_here[..., :, 1], R_here[..., :, 2]
        axes.append(z)
        origins.append(p_here)
        if isinstance(q, Slide):
            p_here = p_here + z * append_axis(q.value) + rotate(R_here, p_next)
            R_here = R_here @ R_next
            continue
        c, s = append_axis(q.cos), append_axis(q.sin)
        turned = np.stack(np.broadcast_arrays(c * x + s * y, c * y - s * x, z + 0.0 * c), axis=-1)
        p_here = p_here + rotate(turned, p_next)
        R_here = turned @ R_next
    difference = R - R_here
    chord = 0.5 * np.sum(np.sum(difference * difference, axis=-1), axis=-1)
    rotation = 0.5 * sum(cross(R_here[..., :, k], R[..., :, k]) for k in range(3))
    error = np.concatenate(np.broadcast_arrays(p - p_here, rotation), axis=-1)
    J = []
    for q, axis, origin in zip(angles, axes, origins, strict=True):
        none = 0.0 * p_here
        linear, angular = (axis, none) if isinstance(q, Slide) else (cross(axis, p_here - origin), axis)
        J.append(np.concatenate(np.broadcast_arrays(linear + none, angular + none), axis=-1))
    return np.asarray(chord), error, J


def _moved(q: Coordinate, step: Array) -> Coordinate:
    """Return the coordinate increased by a small step, an angle by Cayley's formula for its half."""
    if isinstance(q, Slide):
        return replace(q, value=q.value + step)
    half = clamp(0.5 * step, MAX_HALF_STEP)
    w = 1.0 + half * half
    c, s = (1.0 - half * half) / w, 2.0 * half / w
    return replace(q, cos=q.cos * c - q.sin * s, sin=q.sin * c + q.cos * s)


def _frame_along(axis: Floats, R_before: Floats) -> Floats:
    """Return a rotation with z along the axis, and x along an axis of the frame before as nearly as possible.

    For parallel and normal axes its entries in the frame before are 0, 1 and -1, and cost nothing.
    """
    k = int(np.argmin(np.abs(R_before.T @ axis)))
    x = R_before[:, k] - axis * float(axis @ R_before[:, k])
    x = x / np.linalg.norm(x)
    return np.stack([x, cross(axis, x), axis], axis=-1)


def _snapped(a: Floats) -> Floats:
    nearest = np.round(a)
    snapped: Floats = np.where(np.abs(a - nearest) < _SNAP, nearest, a)
    return snapped
