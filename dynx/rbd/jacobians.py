"""Geometric Jacobians of frames and their time derivatives, from the poses of the bodies.

Rows: linear, then angular. Columns of a revolute joint with axis z through o: (z x (p - o), z); of
a prismatic joint: (z, 0) (Siciliano et al., Robotics, eq. 3.30). The six columns of a floating base
are three prismatic and three revolute ones along the axes of the base frame.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from dynx.errors import UnknownNameError, nearest, shown
from dynx.model.mechanism import ROOT, Mechanism
from dynx.rbd.kinematics import Poses, ancestry, body_twists, frame_pose, joint_axis
from dynx.spatial.scalar import Array
from dynx.spatial.so3 import cross, rotate, skew

Reference = Literal["local_world_aligned", "local", "world"]
LOCAL_WORLD_ALIGNED: Reference = "local_world_aligned"
LOCAL: Reference = "local"
REFERENCES: dict[str, Reference] = {
    "local_world_aligned": "local_world_aligned",
    "local": "local",
    "world": "world",
}


def checked_reference(reference: object) -> Reference:
    """Return one of the three references. Raises UnknownNameError, which lists them, for anything else."""
    try:
        return REFERENCES[reference]  # type: ignore[index]
    except (KeyError, TypeError):
        raise UnknownNameError(f"reference is {shown(reference)}{nearest(reference, REFERENCES)}") from None


def frame_jacobian(mechanism: Mechanism, poses: Poses, frame: int, reference: Reference) -> Array:
    """Return J (..., 6, nv) of frame number `frame`, linear rows first, expressed as `reference` says."""
    R, p = frame_pose(mechanism, poses, frame)
    linear, angular = _world_columns(mechanism, poses, mechanism.frames[frame].body, p)
    return _express(linear, angular, R, p, reference)


def frame_jacobian_derivative(
    mechanism: Mechanism, poses: Poses, v: Array, frame: int, reference: Reference
) -> Array:
    """Return dJ/dt (..., 6, nv) of frame number `frame` at the tree velocity `v` (..., nv)."""
    R, p = frame_pose(mechanism, poses, frame)
    body = mechanism.frames[frame].body
    twists = body_twists(mechanism, poses, v)
    omega = twists[body][1]
    velocity = twists[body][0] + cross(omega, p - poses[body][1])

    linear, angular = _world_columns(mechanism, poses, body, p)
    d_linear, d_angular = [0 * column for column in linear], [0 * column for column in angular]
    for column, z, o, owner in moving_columns(mechanism, poses, body):
        o_velocity, o_omega = twists[ROOT if owner == ROOT else mechanism.axis_carriers[owner]]
        dz = cross(o_omega, z)
        if is_rotation(mechanism, column, owner):
            d_linear[column] = cross(dz, p - o) + cross(z, velocity - o_velocity)
            d_angular[column] = dz + 0 * d_linear[column]
        else:
            d_linear[column] = dz + 0 * d_linear[column]

    if reference == "world":
        J, dJ = _stack_columns(linear, angular, p), _stack_columns(d_linear, d_angular, p)
        moved = skew(velocity) @ J[..., 3:, :] + skew(p) @ dJ[..., 3:, :]
        return np.concatenate([dJ[..., :3, :] + moved, dJ[..., 3:, :]], axis=-2)
    if reference == "local":
        # d(R' x)/dt = R' (dx/dt - omega x x)
        d_linear = [d - cross(omega, x) for d, x in zip(d_linear, linear, strict=True)]
        d_angular = [d - cross(omega, x) for d, x in zip(d_angular, angular, strict=True)]
    return _express(d_linear, d_angular, R, p, reference)


def frame_velocity(mechanism: Mechanism, poses: Poses, v: Array, frame: int, reference: Reference) -> Array:
    """Return J v (..., 6) of frame number `frame`."""
    return _applied(frame_jacobian(mechanism, poses, frame, reference), v)


def frame_acceleration(
    mechanism: Mechanism, poses: Poses, v: Array, a: Array, frame: int, reference: Reference
) -> Array:
    """Return J a + dJ/dt v (..., 6) of frame number `frame`."""
    dJ = frame_jacobian_derivative(mechanism, poses, v, frame, reference)
    return _applied(frame_jacobian(mechanism, poses, frame, reference), a) + _applied(dJ, v)


def shift_jacobian(
    J: Array, dJ: Array | None, v: Array | None, R: Array, point: Array, reference: Reference
) -> Array:
    """Return J, or dJ/dt if `dJ` is given, at a point fixed in the frame instead of at its origin.

    `point` (3,) [m] is in the axes of the frame, whose rotation to the world is R; v (..., nv) is needed
    for dJ/dt in the reference ``local_world_aligned``.
    """
    if reference == "world":
        return J if dJ is None else dJ
    lever = point if reference == "local" else rotate(R, point)
    arm = skew(lever)
    if dJ is None or v is None:
        return np.concatenate([J[..., :3, :] - arm @ J[..., 3:, :], J[..., 3:, :]], axis=-2)
    moved = dJ[..., :3, :] - arm @ dJ[..., 3:, :]
    if reference == LOCAL_WORLD_ALIGNED:
        omega = (J[..., 3:, :] @ v[..., None])[..., 0]
        moved = moved - skew(cross(omega, lever)) @ J[..., 3:, :]
    return np.concatenate([moved, dJ[..., 3:, :]], axis=-2)


def moving_columns(mechanism: Mechanism, poses: Poses, body: int) -> list[tuple[int, Array, Array, int]]:
    """List (column, axis z, origin o, body that the joint moves) of every coordinate that moves `body`."""
    base = 6 if mechanism.floating else 0
    columns = [(base + k, joint_axis(mechanism, poses, k), poses[k][1], k) for k in ancestry(mechanism, body)]
    if mechanism.floating:
        R, o = poses[ROOT]
        columns += [(k, R[..., :, k % 3], o, ROOT) for k in range(6)]
    return columns


def is_rotation(mechanism: Mechanism, column: int, owner: int) -> bool:
    """Return whether the coordinate is a rotation, not a translation."""
    return column >= 3 if owner == ROOT else mechanism.bodies[owner].revolute


def _world_columns(
    mechanism: Mechanism, poses: Poses, body: int, p: Array
) -> tuple[list[Array], list[Array]]:
    """Return the columns (linear, angular), in world axes, of the point p fixed to `body`."""
    zero = 0 * p
    linear, angular = [zero] * mechanism.nv, [zero] * mechanism.nv
    for column, z, o, owner in moving_columns(mechanism, poses, body):
        if is_rotation(mechanism, column, owner):
            linear[column], angular[column] = cross(z, p - o), z + zero
        else:
            linear[column] = z + zero
    return linear, angular


def _express(linear: list[Array], angular: list[Array], R: Array, p: Array, reference: Reference) -> Array:
    """Stack columns in world axes at p into a matrix (..., 6, nv) in the given reference."""
    J = _stack_columns(linear, angular, p)
    if reference == "local":
        R_T = np.swapaxes(R, -1, -2)
        return np.concatenate([R_T @ J[..., :3, :], R_T @ J[..., 3:, :]], axis=-2)
    if reference == "world":
        return np.concatenate([J[..., :3, :] + skew(p) @ J[..., 3:, :], J[..., 3:, :]], axis=-2)
    return J


def _stack_columns(linear: list[Array], angular: list[Array], p: Array) -> Array:
    if not linear:
        return np.zeros((*p.shape[:-1], 6, 0))
    columns = [np.concatenate(pair, axis=-1) for pair in zip(linear, angular, strict=True)]
    shape = np.broadcast_shapes(*(column.shape for column in columns))
    return np.stack([np.broadcast_to(column, shape) for column in columns], axis=-1)


def _applied(A: Array, x: Array) -> Array:
    return np.asarray((A @ x[..., None])[..., 0])
