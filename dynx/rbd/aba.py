"""Forward dynamics: the articulated-body algorithm (Featherstone 2008, table 7.1)."""

from __future__ import annotations

import numpy as np

from dynx.model.mechanism import ROOT, Mechanism, joint_motion
from dynx.rbd.kinematics import joint_value
from dynx.rbd.linear import solve_positive
from dynx.rbd.rnea import Twist, body_wrench, carried, root_motion
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array, along
from dynx.spatial.so3 import cross, skew


def forward_dynamics(mechanism: Mechanism, q: Array, v: Array, tau: Array) -> Array:
    """The acceleration (..., nv) that `tau` (..., nv) gives, in tree coordinates.

    A joint that moves no inertia divides by zero.
    """
    bodies = mechanism.bodies
    nothing = 0 * v
    twist, up = root_motion(mechanism, q, v, nothing)
    twists: list[Twist] = [twist]
    placements: list[tuple[Array, Array]] = []
    velocity_products: list[Array] = []
    still = (0 * mechanism.gravity, 0 * mechanism.gravity)
    articulated = [inertia_matrix(mechanism.root)]
    bias = [np.concatenate(body_wrench(mechanism.root, twist, still), axis=-1)]
    for index, body in enumerate(bodies):
        R, p = joint_motion(body, joint_value(mechanism, q, index))
        linear, angular = carried(R, p, *twists[body.parent + 1])
        speed = body.axis * along(joint_value(mechanism, v, index))
        if body.revolute:
            product = np.concatenate([cross(linear, speed), cross(angular, speed)], axis=-1)
            angular = angular + speed
        else:
            product = np.concatenate([cross(angular, speed), 0 * (angular + speed)], axis=-1)
            linear = linear + speed
        placements.append((R, p))
        velocity_products.append(product)
        twists.append((linear, angular))
        articulated.append(inertia_matrix(body.inertia))
        bias.append(np.concatenate(body_wrench(body.inertia, twists[-1], still), axis=-1))

    reach: dict[int, tuple[Array, Array, Array]] = {}
    for index in reversed(range(len(bodies))):
        body = bodies[index]
        S = _subspace(body.axis, body.revolute)
        A, c = articulated[index + 1], velocity_products[index]
        U = (A @ S[..., None])[..., 0]
        D = np.sum(S * U, axis=-1)
        u = joint_value(mechanism, tau, index) - np.sum(S * bias[index + 1], axis=-1)
        reach[index] = (U, D, u)
        handed = A - U[..., :, None] * U[..., None, :] / along(along(D))
        wrench = bias[index + 1] + (handed @ c[..., None])[..., 0] + U * along(u / D)
        X = wrench_transform(*placements[index])
        parent = body.parent + 1
        articulated[parent] = articulated[parent] + X @ handed @ np.swapaxes(X, -1, -2)
        bias[parent] = bias[parent] + (X @ wrench[..., None])[..., 0]

    # Accelerations are relative to free fall until the root's own is read off.
    if mechanism.floating:
        root = solve_positive(articulated[0], tau[..., :6] - bias[0])
    else:
        root = np.concatenate(up, axis=-1) + 0 * bias[0]
    accelerations = [(root[..., :3], root[..., 3:])]
    a: list[Array] = []
    for index, body in enumerate(bodies):
        parent_acceleration = accelerations[body.parent + 1]
        moved = np.concatenate(carried(*placements[index], *parent_acceleration), axis=-1)
        moved = moved + velocity_products[index]
        U, D, u = reach[index]
        joint = (u - np.sum(U * moved, axis=-1)) / D
        a.append(joint)
        moved = moved + _subspace(body.axis, body.revolute) * along(joint)
        accelerations.append((moved[..., :3], moved[..., 3:]))
    if mechanism.floating:
        linear, angular = accelerations[ROOT + 1]
        return np.concatenate([linear - up[0], angular, *(along(x) for x in a)], axis=-1)
    return np.stack(a, axis=-1) if a else np.zeros(v.shape)


def inertia_matrix(inertia: RigidInertia) -> Array:
    """Spatial inertia (..., 6, 6), linear first: [[m 1, -[h]], [[h], I]]."""
    H = skew(inertia.first_moment)
    diagonal = np.eye(3, dtype=int) * inertia.mass + 0 * H
    top = np.concatenate([diagonal, -H], axis=-1)
    return np.concatenate([top, np.concatenate([H, inertia.second_moment], axis=-1)], axis=-2)


def wrench_transform(R: Array, p: Array) -> Array:
    """X (..., 6, 6) that refers a wrench on the child to its parent, (R, p) the child's pose in it.

    Its transpose refers motions the other way.
    """
    lever = skew(p) @ R
    R = R + 0 * lever
    top = np.concatenate([R, 0 * lever], axis=-1)
    return np.concatenate([top, np.concatenate([lever, R], axis=-1)], axis=-2)


def _subspace(axis: Array, revolute: bool) -> Array:
    still = 0 * axis
    return np.concatenate([still, axis] if revolute else [axis, still], axis=-1)
