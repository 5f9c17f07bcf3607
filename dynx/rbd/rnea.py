"""Inverse dynamics: the recursive Newton-Euler algorithm, in body axes (Luh, Walker and Paul 1980).

Velocities and accelerations of rotation are carried from body to body, and of translation only the
acceleration of each origin: no torque depends on how fast the origin moves. With U the matrix that takes a
point r of the body to its acceleration relative to the origin, w' x r + w x (w x r), a body needs

    f = m d + U h,   n = h x d + sum of r x U r dm

where d is the acceleration of its origin less gravity (Khalil and Dombre, Modeling, Identification and
Control of Robots, section 9.3.3). That takes about half the operations of the spatial form.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dynx.model.mechanism import ROOT, Body, Mechanism
from dynx.rbd.kinematics import joint_value
from dynx.rbd.placement import Pair, Placement
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array, along
from dynx.spatial.so3 import cross, rotate, rotate_back, rotation_from_quat


@dataclass(frozen=True)
class Motion:
    """How a body moves, in its own axes: all arrays (..., 3).

    `turning` is its angular velocity w, `change` the derivative w', and `proper` the acceleration of its
    origin less gravity: what an accelerometer there would show.
    """

    turning: Array
    change: Array
    proper: Array

    @cached_property
    def squares(self) -> tuple[Array, Array, Array]:
        """wx wx, wy wy, wz wz."""
        x, y, z = (self.turning[..., k] for k in range(3))
        return x * x, y * y, z * z

    @cached_property
    def spin(self) -> Array:
        """U (..., 3, 3) with U r = w' x r + w x (w x r)."""
        x, y, z = (self.turning[..., k] for k in range(3))
        X, Y, Z = (self.change[..., k] for k in range(3))
        xx, yy, zz = self.squares
        xy, xz, yz = x * y, x * z, y * z
        rows = [
            [-(yy + zz), xy - Z, xz + Y],
            [xy + Z, -(xx + zz), yz - X],
            [xz - Y, yz + X, -(xx + yy)],
        ]
        return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)

    def coasting(self) -> Motion:
        """The same turning, with nothing accelerated."""
        return Motion(self.turning, 0 * self.change, 0 * self.proper)

    def at(self, p: Array) -> Array:
        """The acceleration (..., 3) of the point `p` of the body, less gravity."""
        return np.asarray(self.proper + rotate(self.spin, p))


def inverse_dynamics(mechanism: Mechanism, q: Array, v: Array, a: Array) -> Array:
    """The torque (..., nv) that gives the acceleration `a` (..., nv), in tree coordinates.

    Gravity enters as an acceleration of the root. With a floating base the first six entries are the
    force and the moment at the base frame's origin, in its axes.
    """
    motions = [root_motion(mechanism, q, v, a)]
    placements: list[Placement] = []
    for index, body in enumerate(mechanism.bodies):
        placement = Placement.of(body, joint_value(mechanism, q, index))
        speed, change = (joint_value(mechanism, x, index) for x in (v, a))
        placements.append(placement)
        motions.append(carried(body, placement, motions[body.parent + 1], speed, change))
    inertias = [mechanism.root, *(body.inertia for body in mechanism.bodies)]
    wrenches = [body_wrench(inertia, motion) for inertia, motion in zip(inertias, motions, strict=True)]

    tau: list[Array] = []
    for index in reversed(range(len(mechanism.bodies))):
        body = mechanism.bodies[index]
        force, moment = wrenches[index + 1]
        tau.append(np.sum(body.axis * (moment if body.revolute else force), axis=-1))
        below = placements[index].wrench_of_parent(force, moment)
        wrenches[body.parent + 1] = summed(wrenches[body.parent + 1], below)
    joints = tau[::-1]
    if mechanism.floating:
        force, moment = wrenches[ROOT + 1]
        return np.concatenate([force, moment, *(along(t) for t in joints)], axis=-1)
    return np.stack(joints, axis=-1) if joints else np.zeros(v.shape)


def root_motion(mechanism: Mechanism, q: Array, v: Array, a: Array) -> Motion:
    """The motion of the root body; gravity is an acceleration the other way.

    `v` and `a` of a floating base are components in axes that turn with it, so its origin
    accelerates by w x v more than `a` says.
    """
    if not mechanism.floating:
        still = 0 * mechanism.gravity
        return Motion(still, still, -mechanism.gravity)
    up = rotate_back(rotation_from_quat(q[..., 3:7]), -mechanism.gravity)
    turning = v[..., 3:6]
    return Motion(turning, a[..., 3:6], a[..., :3] + cross(turning, v[..., :3]) + up)


def carried(body: Body, placement: Placement, parent: Motion, speed: Array, change: Array) -> Motion:
    """The motion of a body whose joint moves at `speed` and `change` (...,), from that of its parent."""
    R, p = placement.R, placement.p
    rate, second = body.axis * along(speed), body.axis * along(change)
    turning, turned = rotate_back(R, parent.turning), rotate_back(R, parent.change)
    proper = rotate_back(R, parent.at(p))
    if body.revolute:
        return Motion(turning + rate, turned + second + cross(turning, rate), proper)
    return Motion(turning, turned, proper + second + 2 * cross(turning, rate))


def body_wrench(inertia: RigidInertia, motion: Motion) -> Pair:
    """Newton and Euler: the force and the moment about the origin that a body's motion needs."""
    U, d, h = motion.spin, motion.proper, inertia.first_moment
    return d * inertia.mass + rotate(U, h), cross(h, d) + _spin_moment(inertia.spread, motion)


def summed(a: Pair, b: Pair) -> Pair:
    """Both vectors added."""
    return a[0] + b[0], a[1] + b[1]


def _spin_moment(spread: Array, motion: Motion) -> Array:
    """The sum of r x U r over the mass of a body, of which `spread` is the sum of r r'."""
    U, (xx, yy, zz) = motion.spin, motion.squares

    def component(i: int, j: int, k: int, difference: Array) -> Array:
        # `difference` is U[k, k] - U[j, j].
        mixed = U[..., k, i] * spread[..., i, j] - U[..., j, i] * spread[..., i, k]
        plain = U[..., k, j] * spread[..., j, j] - U[..., j, k] * spread[..., k, k]
        return np.asarray(mixed + plain + difference * spread[..., j, k])

    moments = [component(0, 1, 2, zz - yy), component(1, 2, 0, xx - zz), component(2, 0, 1, yy - xx)]
    return np.stack(moments, axis=-1)
