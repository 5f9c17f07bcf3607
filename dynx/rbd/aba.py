"""Forward dynamics: the articulated-body algorithm (Featherstone 2008, table 7.1).

Linear accelerations are proper accelerations of body origins (acceleration minus gravity), as in
`dynx.rbd.rnea`. An articulated inertia is stored as three 3 x 3 blocks; only one triangle of the two
symmetric blocks is computed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from dynx.model.mechanism import Body, Mechanism, rate_products
from dynx.rbd.linear import solve_positive_definite
from dynx.rbd.loops import Loops, PythonLoops
from dynx.rbd.placement import Placement, SpatialVector
from dynx.rbd.rnea import LocalMotion, add_spatial, body_wrench, child_motion, root_motion
from dynx.spatial.inertia import RigidInertia, symmetric_from_upper
from dynx.spatial.scalar import Array, append_axis
from dynx.spatial.so3 import rotate, rotate_back, skew


@dataclass(frozen=True)
class ArticulatedInertia:
    """Apparent inertia of a body with all bodies outboard of it, whose joints move freely.

    To give the body the proper acceleration d of its origin and the angular acceleration alpha takes the
    force f = M d + C alpha and the moment n = C' d + J alpha about that origin; M and J are symmetric.
    """

    M: Array
    C: Array
    J: Array

    @classmethod
    def of_rigid_body(cls, inertia: RigidInertia) -> ArticulatedInertia:
        """Return the spatial inertia of a single rigid body: M = m 1, C = -[h], J = I."""
        H = skew(inertia.first_moment)
        return cls(np.eye(3, dtype=int) * inertia.mass + 0 * H, -H, inertia.rotational_inertia + 0 * H)

    def __add__(self, other: ArticulatedInertia) -> ArticulatedInertia:
        return ArticulatedInertia(self.M + other.M, self.C + other.C, self.J + other.J)

    def wrench(self, linear: Array, angular: Array) -> SpatialVector:
        """Return the force and moment that produce the given acceleration."""
        force = rotate(self.M, linear) + rotate(self.C, angular)
        return force, rotate_back(self.C, linear) + rotate(self.J, angular)

    def without_joint(self, U: SpatialVector, K: SpatialVector, mask: SpatialVector) -> ArticulatedInertia:
        """Return I - U K', the inertia felt through a joint, where U = I S and K = U / (S' U).

        The result is exactly zero along the joint: `mask` is 0 there and 1 elsewhere.
        """
        (f, n), (kf, kn), (mask_f, mask_n) = U, K, mask
        return ArticulatedInertia(
            symmetric_from_upper((self.M - _outer(f, kf)) * _outer(mask_f, mask_f)),
            (self.C - _outer(f, kn)) * _outer(mask_f, mask_n),
            symmetric_from_upper((self.J - _outer(n, kn)) * _outer(mask_n, mask_n)),
        )

    def to_parent(self, placement: Placement) -> ArticulatedInertia:
        """Return this inertia about the origin of the parent, in its axes."""
        P = skew(placement.p)
        M = placement.rotate_symmetric(self.M)
        C = placement.rotate_tensor(self.C)
        J = placement.rotate_symmetric(self.J)
        C_parent, PC = C - M @ P, P @ C
        J_parent = J + P @ C_parent + np.swapaxes(PC, -1, -2)
        return ArticulatedInertia(M, C_parent, symmetric_from_upper(J_parent))

    def matrix(self) -> Array:
        """Return the inertia as one matrix (..., 6, 6), linear rows and columns first."""
        # Blocks that depend on no joint position have no batch axes yet.
        M, C, J = np.broadcast_arrays(self.M, self.C, self.J)
        top = np.concatenate([M, C], axis=-1)
        bottom = np.concatenate([np.swapaxes(C, -1, -2), J], axis=-1)
        return np.concatenate([top, bottom], axis=-2)


@dataclass(frozen=True)
class AngularVelocity:
    """Angular velocity of a body (..., 3), in its axes."""

    omega: Array

    @cached_property
    def motion(self) -> LocalMotion:
        """Motion with this angular velocity and zero accelerations."""
        return LocalMotion(self.omega, 0 * self.omega, 0 * self.omega)


class ArticulatedBody(NamedTuple):
    """Apparent inertia of a body and its bias wrench: the one that keeps it from accelerating."""

    inertia: ArticulatedInertia
    bias: SpatialVector


class JointPassed(NamedTuple):
    """Placement of a body, and its velocity-product acceleration: that of the body when its parent and its
    joint do not accelerate."""

    placement: Placement
    velocity_product: SpatialVector


class JointAcceleration(NamedTuple):
    """Acceleration of an eliminated joint: `u_over_D` minus the product of `K` with that of the body."""

    K: SpatialVector
    u_over_D: Array


def forward_dynamics(
    mechanism: Mechanism, q: Array, v: Array, tau: Array, *, loops: Loops | None = None
) -> Array:
    """Return the acceleration (..., nv) caused by `tau` (..., nv), in tree coordinates.

    q is (..., nq), v is (..., nv). Raises no error for a singular mass matrix: if nothing that a joint moves
    has inertia, it divides by zero.
    """
    loops = loops or PythonLoops(mechanism)
    root = loops.root(_root_motion, q, v)
    velocities, passed = loops.outward(_pass_joint, loops.root(_velocity, root), q, v)
    bodies = [loops.root(_root_body, velocities[0]), *loops.each(_rigid_body, velocities)]
    articulated, eliminated = loops.inward(_add_articulated, bodies, passed, tau)
    if mechanism.floating:
        base = loops.root(_base_acceleration, articulated[0], tau)
    else:
        base = loops.root(_fixed_acceleration, root)
    _, a = loops.outward(_accelerate, base, passed, eliminated)
    if mechanism.floating:
        base = loops.root(_without_gravity, root, base)
    found = loops.vector(base, a, like=v)
    return found + rate_products(mechanism, v) if mechanism.balls else found


def _root_motion(mechanism: Mechanism, q: Array, v: Array) -> LocalMotion:
    return root_motion(mechanism, q, v, 0 * v)


def _velocity(mechanism: Mechanism, root: LocalMotion) -> AngularVelocity:
    return AngularVelocity(root.omega)


def _pass_joint(
    body: Body, parent: AngularVelocity, q: Array, v: Array
) -> tuple[AngularVelocity, JointPassed]:
    placement = Placement.of(body, q)
    motion = child_motion(body, placement, parent.motion, v, 0 * v)
    return AngularVelocity(motion.omega), JointPassed(placement, (motion.proper_acceleration, motion.alpha))


def _root_body(mechanism: Mechanism, velocity: AngularVelocity) -> ArticulatedBody:
    return _rotating_body(mechanism.root, velocity)


def _rigid_body(body: Body, velocity: AngularVelocity) -> ArticulatedBody:
    return _rotating_body(body.inertia, velocity)


def _rotating_body(inertia: RigidInertia, velocity: AngularVelocity) -> ArticulatedBody:
    bias = body_wrench(inertia, velocity.motion)
    return ArticulatedBody(ArticulatedInertia.of_rigid_body(inertia), bias)


def _add_articulated(
    body: Body, own: ArticulatedBody, parent: ArticulatedBody, passed: JointPassed, tau: Array
) -> tuple[ArticulatedBody, JointAcceleration]:
    joint = eliminate_joint(body, own.inertia, own.bias, tau, passed.velocity_product)
    inertia = parent.inertia + joint.apparent.to_parent(passed.placement)
    bias = add_spatial(parent.bias, passed.placement.wrench_to_parent(*joint.wrench))
    return ArticulatedBody(inertia, bias), JointAcceleration(joint.K, joint.u_over_D)


def _base_acceleration(mechanism: Mechanism, body: ArticulatedBody, tau: Array) -> SpatialVector:
    net_wrench = tau[..., :6] - np.concatenate(body.bias, axis=-1)
    acceleration = solve_positive_definite(body.inertia.matrix(), net_wrench)
    return acceleration[..., :3], acceleration[..., 3:]


def _fixed_acceleration(mechanism: Mechanism, root: LocalMotion) -> SpatialVector:
    return root.proper_acceleration, root.alpha


def _accelerate(
    body: Body, parent: SpatialVector, passed: JointPassed, joint: JointAcceleration
) -> tuple[SpatialVector, Array]:
    moved = passed.placement.motion_to_child(*parent)
    return accelerate_joint(body, joint.K, joint.u_over_D, moved, passed.velocity_product)


def _without_gravity(mechanism: Mechanism, root: LocalMotion, acceleration: SpatialVector) -> SpatialVector:
    # `root` was computed with a = 0: its proper acceleration is omega x v minus gravity.
    return acceleration[0] - root.proper_acceleration, acceleration[1]


@dataclass(frozen=True)
class EliminatedJoint:
    """A joint whose acceleration is eliminated from the equations of its body.

    `K` is U / D and `u_over_D` the acceleration of the joint if the body does not accelerate otherwise.
    `apparent` and `wrench` are the inertia and the bias wrench that the parent feels through the joint.
    """

    K: SpatialVector
    u_over_D: Array
    apparent: ArticulatedInertia
    wrench: SpatialVector


def eliminate_joint(
    body: Body, A: ArticulatedInertia, bias: SpatialVector, tau: Array, velocity_product: SpatialVector
) -> EliminatedJoint:
    """Eliminate the acceleration of a joint with torque `tau` (...,) from the equations of its body."""
    S = _motion_subspace(body.axis, body.revolute)
    U, (force, moment) = A.wrench(*S), bias
    D = _dot(S, U)
    mask = _mask_off_axis(body)
    # K is exactly 1 along the joint.
    K_force, K_moment = (part / append_axis(D) * off_axis for part, off_axis in zip(U, mask, strict=True))
    K = (K_force + S[0] * (1 - mask[0]), K_moment + S[1] * (1 - mask[1]))
    u = tau - _dot(S, (force, moment))
    apparent = A.without_joint(U, K, mask)
    joint_wrench = K[0] * append_axis(u), K[1] * append_axis(u)
    velocity_wrench = apparent.wrench(*velocity_product)
    wrench = add_spatial(add_spatial((force, moment), velocity_wrench), joint_wrench)
    return EliminatedJoint(K, np.asarray(u / D), apparent, wrench)


def accelerate_joint(
    body: Body, K: SpatialVector, u_over_D: Array, parent: SpatialVector, velocity_product: SpatialVector
) -> tuple[SpatialVector, Array]:
    """Return the acceleration of a body and of its joint, from that of the `parent` at the body's origin."""
    linear, angular = add_spatial(parent, velocity_product)
    joint = u_over_D - _dot(K, (linear, angular))
    S = _motion_subspace(body.axis, body.revolute)
    return (linear + S[0] * append_axis(joint), angular + S[1] * append_axis(joint)), np.asarray(joint)


def inertia_matrix(inertia: RigidInertia) -> Array:
    """Return the spatial inertia (..., 6, 6), linear first: [[m 1, -[h]], [[h], I]]."""
    return ArticulatedInertia.of_rigid_body(inertia).matrix()


def _motion_subspace(axis: Array, revolute: bool) -> SpatialVector:
    """Return S, the twist of the joint at unit speed."""
    zero = 0 * axis
    return (zero, axis) if revolute else (axis, zero)


def _mask_off_axis(body: Body) -> SpatialVector:
    """Return 0 at the component along the joint, if its axis is a coordinate axis, and 1 elsewhere."""
    known = body.axis.dtype != object and np.count_nonzero(body.axis) == 1
    on_axis = body.axis != 0 if known else np.zeros(3, dtype=bool)
    off_axis, ones = 1 - on_axis.astype(int), np.ones(3, dtype=int)
    return (ones, off_axis) if body.revolute else (off_axis, ones)


def _dot(a: SpatialVector, b: SpatialVector) -> Array:
    return np.asarray(np.sum(a[0] * b[0] + a[1] * b[1], axis=-1))


def _outer(a: Array, b: Array) -> Array:
    return np.asarray(a[..., :, None] * b[..., None, :])
