"""A configuration moved by a small displacement, to first order: what derivatives by q mean.

With a floating base a configuration has one number more than a velocity, so derivatives are taken by a
displacement d (nv,) in the coordinates of a velocity: q (+) d, as `Model.integrate` has it.
"""

from __future__ import annotations

import numpy as np

from dynx.spatial.scalar import Array
from dynx.spatial.so3 import rotate, rotation_from_quat


def displaced(q: Array, d: Array, *, floating: bool) -> Array:
    """q (+) d (..., nq), right at d = 0 together with its first derivatives there.

    The base moves by R d[:3] and turns by the quaternion product of q with (d[3:6] / 2, 1).
    """
    if not floating:
        return np.asarray(q + d)
    x, y, z, w = (q[..., k] for k in range(3, 7))
    a, b, c = (d[..., k] for k in range(3, 6))
    change = [w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a, -x * a - y * b - z * c]
    position = q[..., :3] + rotate(rotation_from_quat(q[..., 3:7]), d[..., :3])
    quat = q[..., 3:7] + np.stack(change, axis=-1) * 0.5
    return np.concatenate([position, quat, q[..., 7:] + d[..., 6:]], axis=-1)
