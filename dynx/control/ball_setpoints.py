"""Errors from a setpoint in the coordinates of a robot with ball joints, for arrays of any scalar.

The error of a ball joint is the rotation vector e from its child to the attitude wanted, in the axes of the
child: the rotation is R_e. Velocity and acceleration of the setpoint are in the axes of the child as wanted.
In those of the child as it is they are R_e w* and R_e a* - w x R_e w*, the time derivative of R_e w*. Then
e . de/dt = e . (R_e w* - w), so that feedback of e and of R_e w* - w damps every rotation (Bullo and Murray,
Tracking for fully actuated mechanical systems, 1999); about one axis they are the plain differences.

`balls` are the indices in q at which the quaternions of ball joints begin, in order.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from dynx.spatial.manifold import coordinate_runs, difference
from dynx.spatial.scalar import Array
from dynx.spatial.so3 import cross, quat_product, rotate, rotation_from_quat


def position_error(q: Array, q_wanted: Array, balls: Sequence[int] = ()) -> Array:
    """Return the error q* - q (nv,), of a ball joint its rotation vector [rad]."""
    if not balls:
        return np.asarray(q_wanted - q) if isinstance(q, np.ndarray) else q_wanted - q
    return difference(q, q_wanted, floating=False, balls=balls)


def in_present_axes(
    q: Array, v: Array, q_wanted: Array, v_wanted: Array, a_wanted: Array, balls: Sequence[int] = ()
) -> tuple[Array, Array]:
    """Return velocity and acceleration (nv,) of a setpoint in the axes of the children as they are at q."""
    if not balls:
        return v_wanted, a_wanted
    velocities: list[Any] = []
    accelerations: list[Any] = []
    for kind, of_q, of_v in coordinate_runs(len(q), floating=False, balls=balls):
        rate, acceleration = v_wanted[of_v], a_wanted[of_v]
        if kind == "ball":
            start = q[of_q]
            back = np.concatenate([-start[:3], start[3:]])
            R = rotation_from_quat(quat_product(back, q_wanted[of_q]))
            rate = rotate(R, rate)
            acceleration = rotate(R, acceleration) - cross(v[of_v], rate)
        velocities.append(rate)
        accelerations.append(acceleration)
    return np.concatenate(velocities), np.concatenate(accelerations)
