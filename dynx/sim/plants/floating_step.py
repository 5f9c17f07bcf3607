"""A step of semi-implicit Euler with a floating base, for arrays of any scalar.

The base moves as in Bullet (btMultiBody): Euler's method is applied to the velocity of the root's centre of
mass and to its angular velocity, both in world axes. Because those axes do not rotate, a free body keeps its
linear momentum exactly.
"""

from __future__ import annotations

import numpy as np

from dynx.spatial.branchless import quat_exp
from dynx.spatial.scalar import Array
from dynx.spatial.so3 import cross, quat_product, rotate_back, rotation_from_quat


def floating_step(
    q: Array, v: Array, a: Array, h: float, center: Array, moves: Array | float = 1.0
) -> tuple[Array, Array]:
    """Return q (nq,) and v (nv,) after a step of length `h` [s] with acceleration `a` (nv,).

    `center` (3,) [m] is the centre of mass of the root, in the axes of the base frame. Joints where `moves`
    is 0 and not 1 end at rest.
    """
    R, w = rotation_from_quat(q[3:7]), v[3:6]
    lever = cross(w, center)
    # The classical acceleration of the centre of mass, because v is expressed in axes that rotate with the
    # base.
    rising = a[:3] + cross(w, v[:3]) + cross(a[3:6], center) + cross(w, lever)
    linear = R @ (v[:3] + lever + h * rising)
    angular = R @ (w + h * a[3:6])
    quat = quat_product(quat_exp(h * angular), q[3:7])
    quat = quat / np.sqrt(quat.dot(quat))
    R_next = rotation_from_quat(quat)
    at = q[:3] + R @ center + h * linear
    w_next = rotate_back(R_next, angular)
    joints = moves * (v[6:] + h * a[6:])
    v_next = np.concatenate([rotate_back(R_next, linear) - cross(w_next, center), w_next, joints])
    return np.concatenate([at - R_next @ center, quat, q[7:] + h * joints]), v_next
