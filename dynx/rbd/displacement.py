"""Steps of semi-implicit Euler of a floating base whose displacement is not that of the end velocity.

Impacts and corrections of positions make such steps; all velocities are in the axes in which a step begins.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dynx.rbd.integration import moved_joints
from dynx.spatial.branchless import quat_exp
from dynx.spatial.scalar import Array
from dynx.spatial.so3 import cross, quat_product, rotate_back, rotation_from_quat


def floating_end_velocity(v: Array, a: Array, h: float, center: Array) -> Array:
    """Return the velocity (nv,) at the end of the step of
    `dynx.rbd.integration.floating_step`, in the axes in which it begins."""
    w = v[3:6]
    turned = cross(w, v[:3] + cross(w, center))
    return v + h * np.concatenate([a[:3] + turned, a[3:]])


def floating_displacement(
    q: Array, u: Array, w: Array, h: float, center: Array, balls: Sequence[int] = ()
) -> tuple[Array, Array]:
    """Return q (nq,) after a displacement at the velocity `u` (nv,) for the time h, and the velocity (nv,) in
    the axes of the end that is `w` (nv,) in those of the beginning.

    With u = w the velocity of `floating_end_velocity` it is the step of
    `dynx.rbd.integration.floating_step`.
    """
    R = rotation_from_quat(q[3:7])
    linear, angular = R @ (u[:3] + cross(u[3:6], center)), R @ u[3:6]
    quat = quat_product(quat_exp(h * angular), q[3:7])
    quat = quat / np.sqrt(quat.dot(quat))
    R_next = rotation_from_quat(quat)
    at = q[:3] + R @ center + h * linear
    w_next = rotate_back(R_next, R @ w[3:6])
    moved = rotate_back(R_next, R @ (w[:3] + cross(w[3:6], center))) - cross(w_next, center)
    q_next = np.concatenate([at - R_next @ center, quat, moved_joints(q[7:], h * u[6:], balls)])
    return q_next, np.concatenate([moved, w_next, w[6:]])
