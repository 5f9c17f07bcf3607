"""Inverse dynamics: the recursive Newton-Euler algorithm, in body axes (Luh, Walker and Paul 1980).

The outward pass computes angular velocity, angular acceleration and the acceleration of each body's origin,
but no linear velocity: no torque depends on it. With U the matrix that maps a point r of the body to its
acceleration relative to the origin, U r = alpha x r + omega x (omega x r), the wrench that moves a body is

    f = m d + U h,   n = h x d + integral of r x U r dm

where h is the first moment of mass and d the proper acceleration of the origin, its acceleration minus
gravity (Khalil and Dombre, Modeling, Identification and Control of Robots, section 9.3.3). This takes about
half the operations of the spatial form.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from dynx.model.mechanism import Body, Mechanism, rate_products
from dynx.rbd.loops import Loops, PythonLoops
from dynx.rbd.placement import Placement, SpatialVector
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array, append_axis
from dynx.spatial.so3 import cross, rotate, rotate_back, rotation_from_quat


@dataclass(frozen=True)
class LocalMotion:
    """Motion of a body, in its own axes: all arrays (..., 3).

    `omega` is the angular velocity, `alpha` the angular acceleration, and `proper_acceleration` the
    acceleration of the origin minus gravity, as an accelerometer there would measure it.
    """

    omega: Array
    alpha: Array
    proper_acceleration: Array

    @cached_property
    def omega_squares(self) -> tuple[Array, Array, Array]:
        """Squares of the components of `omega`."""
        x, y, z = (self.omega[..., k] for k in range(3))
        return x * x, y * y, z * z

    @cached_property
    def acceleration_matrix(self) -> Array:
        """U (..., 3, 3) with U r = alpha x r + omega x (omega x r)."""
        x, y, z = (self.omega[..., k] for k in range(3))
        X, Y, Z = (self.alpha[..., k] for k in range(3))
        xx, yy, zz = self.omega_squares
        xy, xz, yz = x * y, x * z, y * z
        rows = [
            [-(yy + zz), xy - Z, xz + Y],
            [xy + Z, -(xx + zz), yz - X],
            [xz - Y, yz + X, -(xx + yy)],
        ]
        return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)

    def proper_acceleration_at(self, p: Array) -> Array:
        """Return the proper acceleration (..., 3) of the point `p` of the body."""
        return np.asarray(self.proper_acceleration + rotate(self.acceleration_matrix, p))


class LoadedBody(NamedTuple):
    """Placement of a body whose joint moves, and the wrench that moves the body."""

    placement: Placement
    wrench: SpatialVector


def inverse_dynamics(
    mechanism: Mechanism, q: Array, v: Array, a: Array, *, loops: Loops | None = None
) -> Array:
    """Return the torque (..., nv) that produces the acceleration `a` (..., nv), in tree coordinates.

    q is (..., nq), v is (..., nv). Gravity enters as an acceleration of the root. With a floating base the
    first six entries are the force and the moment at the origin of the base frame, in its axes.
    """
    loops = loops or PythonLoops(mechanism)
    if mechanism.balls:
        a = a - rate_products(mechanism, v)
    root = loops.root(root_motion, q, v, a)
    root_wrench = loops.root(_root_wrench, root)
    _, moved = loops.outward(_move, root, q, v, a)
    wrenches, tau = loops.inward(_react, [root_wrench, *(body.wrench for body in moved)], moved)
    return loops.vector(wrenches[0], tau, like=v)


def _root_wrench(mechanism: Mechanism, motion: LocalMotion) -> SpatialVector:
    return body_wrench(mechanism.root, motion)


def _move(body: Body, parent: LocalMotion, q: Array, v: Array, a: Array) -> tuple[LocalMotion, LoadedBody]:
    # A body's wrench is computed together with its motion, most of which nothing else needs: compiled code
    # then keeps few values in memory, which makes that of a humanoid a quarter faster.
    placement = Placement.of(body, q)
    motion = child_motion(body, placement, parent, v, a)
    return motion, LoadedBody(placement, body_wrench(body.inertia, motion))


def _react(
    body: Body, wrench: SpatialVector, parent: SpatialVector, moved: LoadedBody
) -> tuple[SpatialVector, Array]:
    """Add the wrench on a body to that on its parent; return also the torque of its joint."""
    force, moment = wrench
    torque = np.sum(body.axis * (moment if body.revolute else force), axis=-1)
    return add_spatial(parent, moved.placement.wrench_to_parent(force, moment)), torque


def bias_torque(mechanism: Mechanism, q: Array, v: Array, *, loops: Loops | None = None) -> Array:
    """Return C v + g (..., nv): inverse dynamics at zero acceleration."""
    return inverse_dynamics(mechanism, q, v, np.zeros(v.shape), loops=loops)


def gravity_torque(mechanism: Mechanism, q: Array, *, loops: Loops | None = None) -> Array:
    """Return g (..., nv): inverse dynamics at rest."""
    rest = np.zeros((*q.shape[:-1], mechanism.nv))
    return inverse_dynamics(mechanism, q, rest, rest, loops=loops)


def root_motion(mechanism: Mechanism, q: Array, v: Array, a: Array) -> LocalMotion:
    """Return the motion of the root body; gravity g enters as the proper acceleration -g.

    `v` and `a` of a floating base are components in axes that rotate with it, so the acceleration of its
    origin is `a` plus omega x v.
    """
    if not mechanism.floating:
        zero = 0 * mechanism.gravity
        return LocalMotion(zero, zero, -mechanism.gravity)
    minus_gravity = rotate_back(rotation_from_quat(q[..., 3:7]), -mechanism.gravity)
    omega = v[..., 3:6]
    return LocalMotion(omega, a[..., 3:6], a[..., :3] + cross(omega, v[..., :3]) + minus_gravity)


def child_motion(
    body: Body, placement: Placement, parent: LocalMotion, speed: Array, acceleration: Array
) -> LocalMotion:
    """Return the motion of a body from that of its parent and its joint's speed and acceleration (...,)."""
    R, p = placement.R, placement.p
    axis_speed = body.axis * append_axis(speed)
    axis_acceleration = body.axis * append_axis(acceleration)
    omega, alpha = rotate_back(R, parent.omega), rotate_back(R, parent.alpha)
    proper = rotate_back(R, parent.proper_acceleration_at(p))
    if body.revolute:
        return LocalMotion(omega + axis_speed, alpha + axis_acceleration + cross(omega, axis_speed), proper)
    return LocalMotion(omega, alpha, proper + axis_acceleration + 2 * cross(omega, axis_speed))


def body_wrench(inertia: RigidInertia, motion: LocalMotion) -> SpatialVector:
    """Return the force and the moment about the body's origin that produce its motion (Newton and Euler)."""
    U, d, h = motion.acceleration_matrix, motion.proper_acceleration, inertia.first_moment
    force = d * inertia.mass + rotate(U, h)
    return force, cross(h, d) + _rotation_moment(inertia.second_moment_matrix, motion)


def add_spatial(a: SpatialVector, b: SpatialVector) -> SpatialVector:
    """Return the sum of two spatial vectors of the same frame."""
    return a[0] + b[0], a[1] + b[1]


def _rotation_moment(sigma: Array, motion: LocalMotion) -> Array:
    """Return the integral of r x U r over the mass of a body, where `sigma` is the integral of r r'."""
    U, (xx, yy, zz) = motion.acceleration_matrix, motion.omega_squares

    def component(i: int, j: int, k: int, difference: Array) -> Array:
        # `difference` is U[k, k] - U[j, j].
        mixed = U[..., k, i] * sigma[..., i, j] - U[..., j, i] * sigma[..., i, k]
        diagonal = U[..., k, j] * sigma[..., j, j] - U[..., j, k] * sigma[..., k, k]
        return np.asarray(mixed + diagonal + difference * sigma[..., j, k])

    moments = [component(0, 1, 2, zz - yy), component(1, 2, 0, xx - zz), component(2, 0, 1, yy - xx)]
    return np.stack(moments, axis=-1)
