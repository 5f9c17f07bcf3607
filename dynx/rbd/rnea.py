"""Inverse dynamics: the recursive Newton-Euler algorithm (Featherstone 2008, table 5.1)."""

from __future__ import annotations

import numpy as np

from dynx.model.mechanism import ROOT, Mechanism, joint_motion
from dynx.rbd.kinematics import joint_value
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array, along
from dynx.spatial.so3 import cross, rotate, rotate_back, rotation_from_quat

Wrench = tuple[Array, Array]
Twist = tuple[Array, Array]


def inverse_dynamics(mechanism: Mechanism, q: Array, v: Array, a: Array) -> Array:
    """The torque (..., nv) that gives the acceleration `a` (..., nv), in tree coordinates.

    Works in body coordinates; gravity enters as an acceleration of the root. With a floating base
    the first six entries are the force and the moment at the base frame's origin, in its axes.
    """
    twist, acceleration = root_motion(mechanism, q, v, a)
    twists, accelerations = [twist], [acceleration]
    wrenches = [body_wrench(mechanism.root, twist, acceleration)]
    placements: list[tuple[Array, Array]] = []
    for index, body in enumerate(mechanism.bodies):
        R, p = joint_motion(body, joint_value(mechanism, q, index))
        speed = body.axis * along(joint_value(mechanism, v, index))
        change = body.axis * along(joint_value(mechanism, a, index))
        linear, angular = carried(R, p, *twists[body.parent + 1])
        d_linear, d_angular = carried(R, p, *accelerations[body.parent + 1])
        if body.revolute:
            d_linear = d_linear + cross(linear, speed)
            d_angular = d_angular + change + cross(angular, speed)
            angular = angular + speed
        else:
            d_linear = d_linear + change + cross(angular, speed)
            linear = linear + speed
        placements.append((R, p))
        twists.append((linear, angular))
        accelerations.append((d_linear, d_angular))
        wrenches.append(body_wrench(body.inertia, twists[-1], accelerations[-1]))

    tau: list[Array] = []
    for index in reversed(range(len(mechanism.bodies))):
        body = mechanism.bodies[index]
        force, moment = wrenches[index + 1]
        tau.append(np.sum(body.axis * (moment if body.revolute else force), axis=-1))
        R, p = placements[index]
        below = rotate(R, force)
        parent_force, parent_moment = wrenches[body.parent + 1]
        wrenches[body.parent + 1] = (
            parent_force + below,
            parent_moment + rotate(R, moment) + cross(p, below),
        )
    joints = tau[::-1]
    if mechanism.floating:
        force, moment = wrenches[ROOT + 1]
        return np.concatenate([force, moment, *(along(t) for t in joints)], axis=-1)
    return np.stack(joints, axis=-1) if joints else np.zeros(v.shape)


def root_motion(mechanism: Mechanism, q: Array, v: Array, a: Array) -> tuple[Twist, Twist]:
    """Velocity and acceleration of the root body, in its axes, with gravity as an acceleration."""
    if not mechanism.floating:
        still = 0 * mechanism.gravity
        return (still, still), (-mechanism.gravity, still)
    up = rotate_back(rotation_from_quat(q[..., 3:7]), -mechanism.gravity)
    return (v[..., :3], v[..., 3:6]), (a[..., :3] + up, a[..., 3:6])


def carried(R: Array, p: Array, linear: Array, angular: Array) -> Twist:
    """A spatial motion of the parent seen in the child's frame, whose pose in the parent is (R, p)."""
    return rotate_back(R, linear + cross(angular, p)), rotate_back(R, angular)


def body_wrench(inertia: RigidInertia, twist: Twist, acceleration: Twist) -> Wrench:
    """Newton and Euler: force and moment about the origin, I a + v x* I v."""
    linear, angular = twist
    momentum, spin = inertia.momentum(linear, angular)
    force, moment = inertia.momentum(*acceleration)
    return (
        force + cross(angular, momentum),
        moment + cross(angular, spin) + cross(linear, momentum),
    )
