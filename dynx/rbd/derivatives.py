"""Partial derivatives of inverse dynamics in closed form.

Each pair of a joint and one of its ancestors takes some forty products, as in Singh, Russell and Wensing,
Efficient Analytical Derivatives of Rigid-Body Dynamics Using Spatial Vector Algebra, 2022. With S the motion
subspace of a joint, v and a the velocity and acceleration of its parent (gravity subtracted),

    S' = v x S,   S'' = a x S + v x S',

and with I, B and F the inertia, Coriolis terms and wrench of the subtree of joint i, for an ancestor j

    dtau_j/dq_i = S_j . (2 B S'_i + I S''_i + S_i x* F),    dtau_i/dq_j = S_i . (2 B S'_j + I S''_j),
    dtau_j/dv_i = S_j . (2 B S_i + 2 I S'_i),               dtau_i/dv_j = S_i . (2 B S_j + 2 I S'_j).

B = (v x* I - I v x + (I v) x~*) / 2 summed over the subtree maps the twist l + e x r to the force e x f and
the moment E e, where f is the momentum of the subtree and E = integral of -[r] [dr/dt] (`dynx.rbd.coriolis`).

All vectors are in the axes of the root body and about its origin, and velocities are relative to that of the
origin, so neither the position nor the velocity of the robot as a whole causes rounding errors. The base then
enters by its angular velocity and acceleration and the proper acceleration of its origin alone: derivatives
by its coordinates follow from these by the chain rule.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from dynx.model.mechanism import Body, Mechanism
from dynx.rbd.loops import Loops, PythonLoops
from dynx.rbd.placement import Placement, SpatialVector
from dynx.rbd.rnea import add_spatial
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array, append_axis
from dynx.spatial.so3 import cross, rotate, rotate_back, rotation_from_quat, skew


@dataclass(frozen=True)
class BodyMotion:
    """Pose (R, p) of a body in the root; its velocity and its acceleration minus gravity, spatial vectors."""

    R: Array
    p: Array
    velocity: SpatialVector
    acceleration: SpatialVector


class Base(NamedTuple):
    """Linear and angular velocity of a floating base, and gravity, in its axes."""

    linear: Array
    omega: Array
    gravity: Array

    @classmethod
    def of(cls, mechanism: Mechanism, q: Array, v: Array) -> Base:
        """Make the base from q (..., 7 or more) and v (..., 6 or more)."""
        gravity = rotate_back(rotation_from_quat(q[..., 3:7]), mechanism.gravity)
        return cls(v[..., :3], v[..., 3:6], gravity)

    def motion(self, a: Array) -> BodyMotion:
        """Return the motion of the root at acceleration a, relative to that of its origin."""
        proper = a[..., :3] + cross(self.omega, self.linear) - self.gravity
        identity, zero = np.eye(3, dtype=int), 0 * self.omega
        return BodyMotion(identity, zero, (zero, self.omega), (proper, a[..., 3:6]))


class JointMotion(NamedTuple):
    """Motion subspace S of a joint, S' and S'' (see the module)."""

    S: SpatialVector
    first: SpatialVector
    second: SpatialVector


@dataclass(frozen=True)
class Subtree:
    """A body with all bodies outboard of it: inertia, momentum f, E and the wrench that moves it."""

    inertia: RigidInertia
    momentum: Array
    E: Array
    wrench: SpatialVector

    @classmethod
    def of_body(cls, inertia: RigidInertia, motion: BodyMotion) -> Subtree:
        """Return the subtree of one body, whose inertia is given in its own frame."""
        own = inertia.transform(motion.R, motion.p)
        linear, omega = motion.velocity
        momentum, angular_momentum = own.momentum(linear, omega)
        E = -skew(own.first_moment) @ skew(linear) - skew(omega) @ own.second_moment_matrix
        force, moment = own.momentum(*motion.acceleration)
        moment = moment + cross(omega, angular_momentum) + cross(linear, momentum)
        return cls(own, momentum, np.asarray(E), (force + cross(omega, momentum), moment))

    def __add__(self, other: Subtree) -> Subtree:
        return Subtree(
            self.inertia + other.inertia,
            self.momentum + other.momentum,
            self.E + other.E,
            add_spatial(self.wrench, other.wrench),
        )


class MovedSubtree(NamedTuple):
    """Motion of a joint, and the body that it moves."""

    joint: JointMotion
    subtree: Subtree


class JointResponse(NamedTuple):
    """Spatial vectors of a joint whose products with the motions of its ancestors are derivatives."""

    IS: SpatialVector
    BS: Array
    """Angular part of B' S; the linear part is zero."""
    by_q: SpatialVector
    by_v: SpatialVector


class Entries(NamedTuple):
    """Derivatives of the torque of one joint by the coordinates of another (...,) or of the base (..., 6)."""

    by_q: Array
    by_v: Array
    by_a: Array


def inverse_dynamics_derivatives(
    mechanism: Mechanism, q: Array, v: Array, a: Array, *, loops: Loops | None = None
) -> tuple[Array, ...]:
    """Return dtau/dq, dtau/dv and dtau/da (..., nv, nv) in tree coordinates, at q (..., nq), v, a (..., nv).

    With a floating base the derivative by q is the one by a displacement in the axes of the base, and with a
    ball joint by a rotation in the axes of its child.
    """
    loops = loops or PythonLoops(mechanism)
    if mechanism.floating:
        base = loops.root(Base.of, q, v)
        root = loops.root(_floating_root, base, a)
    else:
        base, root = None, loops.root(_fixed_root)
    has_balls = bool(mechanism.balls)
    motions, moved = loops.outward(_move_with_balls if has_balls else _move, root, q, v, a)
    joints: Sequence[Any] = [body.joint for body in moved]
    if has_balls:
        carriers = [motions[carrier + 1] for carrier in mechanism.axis_carriers]
        joints = loops.each(_joint_of_ball, joints, carriers)
    bodies = [loops.root(_root_subtree, root), *(body.subtree for body in moved)]
    subtrees = loops.subtrees(_add_subtree, bodies)
    matrices = loops.matrices(3, like=v)
    start, pair = (_respond_in_ball, _entries_with_balls) if has_balls else (_respond, _entries)
    loops.to_root(
        matrices, start, pair, _base_entries, own=(subtrees, joints), here=(joints,), at_base=(base,)
    )
    if mechanism.floating:
        loops.base_block(matrices, _base_block, subtrees[0], base)
    return loops.assembled(matrices)


def _floating_root(mechanism: Mechanism, base: Base, a: Array) -> BodyMotion:
    return base.motion(a)


def _fixed_root(mechanism: Mechanism) -> BodyMotion:
    """Return the motion of a fixed root, which gravity accelerates upwards."""
    zero = 0 * mechanism.gravity
    return BodyMotion(np.eye(3, dtype=int), zero, (zero, zero), (-mechanism.gravity, zero))


def _root_subtree(mechanism: Mechanism, motion: BodyMotion) -> Subtree:
    return Subtree.of_body(mechanism.root, motion)


def _move(body: Body, parent: BodyMotion, q: Array, v: Array, a: Array) -> tuple[BodyMotion, MovedSubtree]:
    # Compiled code keeps few values in memory if a body's subtree is computed together with its motion.
    motion, joint = move_child(body, parent, q, v, a)
    return motion, MovedSubtree(joint, Subtree.of_body(body.inertia, motion))


def _add_subtree(body: Body, subtree: Subtree, parent: Subtree) -> Subtree:
    return parent + subtree


def _respond(body: Body, subtree: Subtree, joint: JointMotion) -> tuple[JointResponse, Entries]:
    response = respond(subtree, joint)
    return response, by_ancestor(response, joint)


def _entries(
    body: Body, response: JointResponse, joint: JointMotion
) -> tuple[JointResponse, Entries, Entries]:
    # All vectors are in the axes of the root: the response is the same at every ancestor.
    return response, by_ancestor(response, joint), of_ancestor(response, joint)


def _base_entries(
    response: JointResponse | _BallResponse, base: Base
) -> tuple[Entries, tuple[list[Array], ...]]:
    """Return the derivatives of the torque of the joint by the coordinates of a floating base, and those of
    the base's wrench by the coordinate of the joint."""
    if isinstance(response, _BallResponse):
        response = response.response
    columns = by_base(response.IS, response.BS, base)
    wrenches = (np.concatenate(x, axis=-1) for x in (response.by_q, response.by_v, response.IS))
    return columns, tuple([wrench[..., k] for k in range(6)] for wrench in wrenches)


def move_child(
    body: Body, parent: BodyMotion, q: Array, speed: Array, acceleration: Array
) -> tuple[BodyMotion, JointMotion]:
    """Return the motion of a body and of its joint, from those of its parent and the joint's state (...,)."""
    placement = Placement.of(body, q)
    R, p = parent.R @ placement.R, parent.p + rotate(parent.R, placement.p)
    axis = rotate(R, body.axis)
    S = (cross(p, axis), axis) if body.revolute else (axis, 0 * axis)
    first = _cross_motion(parent.velocity, S)
    second = add_spatial(_cross_motion(parent.acceleration, S), _cross_motion(parent.velocity, first))
    velocity = add_spatial(parent.velocity, _scaled(S, speed))
    total = add_spatial(parent.acceleration, add_spatial(_scaled(S, acceleration), _scaled(first, speed)))
    return BodyMotion(np.asarray(R), p, velocity, total), JointMotion(S, first, second)


def respond(subtree: Subtree, joint: JointMotion) -> JointResponse:
    """Return the response of the subtree of a joint."""
    inertia, f, E = subtree.inertia, subtree.momentum, subtree.E
    (linear, angular), first, second = joint

    def coriolis(e: Array) -> SpatialVector:
        return cross(e, f), rotate(E, e)

    force, moment = subtree.wrench
    turned = cross(angular, force), cross(angular, moment) + cross(linear, force)
    by_q = add_spatial(_twice(coriolis(first[1])), add_spatial(inertia.momentum(*second), turned))
    by_v = _twice(add_spatial(coriolis(angular), inertia.momentum(*first)))
    return JointResponse(
        inertia.momentum(linear, angular), cross(f, linear) + rotate_back(E, angular), by_q, by_v
    )


def by_ancestor(response: JointResponse, joint: JointMotion) -> Entries:
    """Return the derivatives of the torque of the responding joint by the coordinate of an ancestor."""
    IS, BS = response.IS, response.BS
    return Entries(
        2 * _dot3(BS, joint.first[1]) + _dot(IS, joint.second),
        2 * (_dot3(BS, joint.S[1]) + _dot(IS, joint.first)),
        _dot(IS, joint.S),
    )


def of_ancestor(response: JointResponse, joint: JointMotion) -> Entries:
    """Return the derivatives of the torque of an ancestor by the coordinate of the responding joint."""
    return Entries(*(_dot(joint.S, x) for x in (response.by_q, response.by_v, response.IS)))


def by_base(IS: SpatialVector, BS: Array, base: Base) -> Entries:
    """Return the derivatives (..., 6) of a torque by the coordinates of a floating base.

    `IS` and `BS` are those of the joint (`JointResponse`).
    """
    force, moment = IS
    by_rotation = cross(base.gravity, force)
    by_omega = 2 * BS + cross(moment, base.omega) + cross(base.linear, force)
    return Entries(
        np.concatenate([0 * by_rotation, by_rotation], axis=-1),
        np.concatenate([cross(force, base.omega), by_omega], axis=-1),
        np.concatenate([force, moment], axis=-1),
    )


def _base_block(mechanism: Mechanism, subtree: Subtree, base: Base) -> tuple[list[Array], ...]:
    """Return the derivatives of the wrench of a floating base by its own coordinates, row by row."""
    axes, zero = np.eye(3, dtype=int) + 0 * subtree.E, 0 * subtree.momentum
    unit = [*((axes[..., k, :], zero) for k in range(3)), *((zero, axes[..., k, :]) for k in range(3))]
    rows = []
    for linear, angular in unit:
        BS = cross(subtree.momentum, linear) + rotate_back(subtree.E, angular)
        rows.append(by_base(subtree.inertia.momentum(linear, angular), BS, base))
    return tuple(list(matrix) for matrix in zip(*rows, strict=True))


def _cross_motion(a: SpatialVector, b: SpatialVector) -> SpatialVector:
    """Return a x b for motions."""
    return cross(a[1], b[0]) + cross(a[0], b[1]), cross(a[1], b[1])


@dataclass(frozen=True)
class _MotionInBall(BodyMotion):
    """Motion of one of the three bodies of a ball joint, and the velocity and acceleration of the body that
    carries the joint."""

    carried: tuple[SpatialVector, SpatialVector]


class _BallJointMotion(NamedTuple):
    """`JointMotion` of any joint of a robot with ball joints, and the time derivative of S: v x S with the
    velocity of the child, S' of a joint with one coordinate. `ball` is the name of a ball joint."""

    motion: JointMotion
    rate: SpatialVector
    ball: str


class _BallResponse(NamedTuple):
    """`JointResponse`, its part by q without that of the wrench S x* F of the subtree, and the ball joint."""

    response: JointResponse
    by_q_inside: SpatialVector
    ball: str


def _move_with_balls(
    body: Body, parent: BodyMotion, q: Array, v: Array, a: Array
) -> tuple[BodyMotion, MovedSubtree]:
    """Do as `_move`; the axes of a ball joint are fixed to its child.

    So S' and S'' of all three are those with the velocity and acceleration of the body that carries the joint
    (Singh, Russell and Wensing 2022, for joints with several axes).
    """
    if body.ball is None:
        return _move(body, parent, q, v, a)
    carried = parent.carried if isinstance(parent, _MotionInBall) and body.ball else None
    velocity, acceleration = carried or (parent.velocity, parent.acceleration)
    motion, joint = move_child(body, replace(parent, velocity=velocity, acceleration=acceleration), q, v, a)
    inside = _MotionInBall(
        motion.R,
        motion.p,
        add_spatial(parent.velocity, _scaled(joint.S, v)),
        add_spatial(parent.acceleration, add_spatial(_scaled(joint.S, a), _scaled(joint.first, v))),
        (velocity, acceleration),
    )
    return inside, MovedSubtree(joint, Subtree.of_body(body.inertia, inside))


def _joint_of_ball(body: Body, joint: JointMotion, carrier: BodyMotion) -> _BallJointMotion:
    if body.ball is None:
        return _BallJointMotion(joint, joint.first, "")
    return _BallJointMotion(joint, _cross_motion(carrier.velocity, joint.S), body.joint)


def _respond_in_ball(body: Body, subtree: Subtree, joint: _BallJointMotion) -> tuple[_BallResponse, Entries]:
    found, motion = respond(subtree, joint.motion), joint.motion
    by_v = add_spatial(found.by_v, subtree.inertia.momentum(*_less(joint.rate, motion.first)))
    force, moment = subtree.wrench
    linear, angular = motion.S
    turned = cross(angular, force), cross(angular, moment) + cross(linear, force)
    response = _BallResponse(found._replace(by_v=by_v), _less(found.by_q, turned), joint.ball)
    return response, _by_ancestor_in_ball(response, joint)


def _by_ancestor_in_ball(response: _BallResponse, joint: _BallJointMotion) -> Entries:
    entries, IS = by_ancestor(response.response, joint.motion), response.response.IS
    return entries._replace(by_v=entries.by_v + _dot(IS, _less(joint.rate, joint.motion.first)))


def _entries_with_balls(
    body: Body, response: _BallResponse, joint: _BallJointMotion
) -> tuple[_BallResponse, Entries, Entries]:
    found = of_ancestor(response.response, joint.motion)
    if response.ball and response.ball == joint.ball:
        # The axes of one ball joint move together: none carries the wrench of another.
        found = found._replace(by_q=_dot(joint.motion.S, response.by_q_inside))
    return response, _by_ancestor_in_ball(response, joint), found


def _less(a: SpatialVector, b: SpatialVector) -> SpatialVector:
    return a[0] - b[0], a[1] - b[1]


def _twice(a: SpatialVector) -> SpatialVector:
    return 2 * a[0], 2 * a[1]


def _scaled(a: SpatialVector, factor: Array) -> SpatialVector:
    return a[0] * append_axis(factor), a[1] * append_axis(factor)


def _dot3(a: Array, b: Array) -> Array:
    return np.asarray(np.sum(a * b, axis=-1))


def _dot(a: SpatialVector, b: SpatialVector) -> Array:
    return _dot3(a[0], b[0]) + _dot3(a[1], b[1])
