"""Inertial regressor: the torque as a linear function of the inertial parameters of the links.

    tau = Y(q, v, a) pi,   pi = the ten inertial parameters of every link, in the order of the links

Inverse dynamics is linear in mass, first moment and second moment of each link (Atkeson, An and
Hollerbach, Estimation of inertial parameters of manipulator loads and links, 1986; Siciliano et al.,
Robotics, section 7.2.2). The ten parameters of a link, in the axes of the link frame, are

    m, m cx, m cy, m cz [kg m], Ixx, Ixy, Ixz, Iyy, Iyz, Izz [kg m^2]

with c the centre of mass and I the rotational inertia about the origin of the link frame, not about c.
Pinocchio lists the tensor as Ixx, Ixy, Iyy, Ixz, Iyz, Izz.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, shown
from dynx.model import Model
from dynx.model.mechanism import (
    Body,
    BodyFrame,
    Mechanism,
    ScalarConverter,
    float64,
    pose_arrays,
    rate_products,
)
from dynx.rbd.kinematics import BodyPose, Poses, pose_pairs
from dynx.rbd.loops import Loops, PythonLoops
from dynx.spatial.inertia import RigidInertia, inertia_about_origin, parameters_from_inertia
from dynx.spatial.scalar import Array, append_axis
from dynx.spatial.so3 import cross, rotate, rotate_back, skew

PARAMETERS = ("m", "mcx", "mcy", "mcz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
"""Names of the ten inertial parameters of a link, in order."""


def inertial_regressor(
    mechanism: Mechanism, poses: Poses, v: Array, a: Array, frames: Sequence[int]
) -> Array:
    """Return Y (..., nv, 10 n) in tree coordinates, for one rigid body fixed to each of n `frames`.

    Columns of bodies that no coordinate moves are zero.
    """
    return _regressor(PythonLoops(mechanism), list(zip(poses.R, poses.p, strict=True)), v, a, frames)


def inertial_regressor_at(
    mechanism: Mechanism, q: Array, v: Array, a: Array, frames: Sequence[int], *, loops: Loops | None = None
) -> Array:
    """Return Y (..., nv, 10 n) at the tree configuration q (..., nq)."""
    loops = loops or PythonLoops(mechanism)
    return _regressor(loops, pose_pairs(loops, q), v, a, frames)


@dataclass(frozen=True)
class BodyKinematics:
    """Rotation R and position p of a body, its angular velocity, the proper acceleration of its origin
    (acceleration minus gravity) and its angular acceleration, in world axes."""

    R: Array
    p: Array
    omega: Array
    acceleration: Array
    alpha: Array

    def acceleration_at(self, p: Array) -> Array:
        """Return the proper acceleration of the point of the body that is at `p` in the world."""
        lever = p - self.p
        return np.asarray(
            self.acceleration + cross(self.alpha, lever) + cross(self.omega, cross(self.omega, lever))
        )


@dataclass(frozen=True)
class FrameMotion:
    """Pose (R, p) of a frame, and the blocks of its wrench regressor.

    `d` is its proper acceleration. `U` (..., 3, 3) multiplies the first moment in the force; `moments`
    (..., 3, 6) multiplies the second moments in the moment.
    """

    R: Array
    p: Array
    d: Array
    U: Array
    moments: Array

    @classmethod
    def of(cls, R: Array, p: Array, d: Array, omega: Array, alpha: Array) -> FrameMotion:
        """Return the motion of a frame with the proper acceleration d of its origin, the angular velocity and
        the angular acceleration (..., 3), all in its axes."""
        d, omega, alpha = np.broadcast_arrays(d, omega, alpha)
        W = skew(omega)
        return cls(R, p, d, skew(alpha) + W @ W, _tensor_columns(alpha) + W @ _tensor_columns(omega))

    @cached_property
    def wrench(self) -> Array:
        """Matrix A (..., 6, 10) such that A pi is the wrench that gives a body of inertia pi this motion.

        Force and moment are about the origin of the frame, in its axes. With the angular velocity w and the
        angular acceleration alpha in the axes of the frame (Newton and Euler, with h = m c)

            f = m d + alpha x h + w x (w x h),   n = h x d + I alpha + w x I w
        """
        column = self.d[..., None]
        force = np.concatenate([column, self.U, 0 * self.moments], axis=-1)
        moment = np.concatenate([0 * column, -skew(self.d), self.moments], axis=-1)
        return np.concatenate([force, moment], axis=-2)


def _regressor(loops: Loops, poses: Sequence[BodyPose], v: Array, a: Array, frames: Sequence[int]) -> Array:
    states, axes = body_states(loops, poses, v, a)
    Y = loops.matrices(1, like=v, blocks=len(frames), width=10)
    loops.frames_to_root(
        Y, frames, _frame_motion, _row, _base_rows, own=(states,), here=(states, axes), at_base=(states[0],)
    )
    return loops.assembled(Y)[0]


def body_states(
    loops: Loops, poses: Sequence[BodyPose], v: Array, a: Array
) -> tuple[Sequence[BodyKinematics], Sequence[Array]]:
    """Return the state of every body, the root's first, and the axes (..., 3) of the joints in the world."""
    if loops.mechanism.balls:
        a = a - rate_products(loops.mechanism, v)
    return loops.outward(_move, loops.root(_root_state, poses[0], v, a), poses, v, a)


def _root_state(mechanism: Mechanism, pose: BodyPose, v: Array, a: Array) -> BodyKinematics:
    R, p = pose
    if not mechanism.floating:
        return BodyKinematics(R, p, 0 * p, 0 * p - mechanism.gravity, 0 * p)
    # v is expressed in axes that rotate with the base: the acceleration in the world includes omega x v.
    omega = rotate(R, v[..., 3:6])
    acceleration = rotate(R, a[..., :3]) + cross(omega, rotate(R, v[..., :3])) - mechanism.gravity
    return BodyKinematics(R, p, omega, acceleration, rotate(R, a[..., 3:6]))


def _move(
    body: Body, parent: BodyKinematics, pose: BodyPose, v: Array, a: Array
) -> tuple[BodyKinematics, Array]:
    """Return the state of a body, and the axis of its joint in world axes."""
    R, p = pose
    axis = rotate(R, body.axis)
    speed, joint_acceleration = axis * append_axis(v), axis * append_axis(a)
    acceleration = parent.acceleration_at(p)
    across = cross(parent.omega, speed)
    if body.revolute:
        alpha = parent.alpha + joint_acceleration + across
        return BodyKinematics(R, p, parent.omega + speed, acceleration, alpha), axis
    return BodyKinematics(
        R, p, parent.omega, acceleration + joint_acceleration + 2 * across, parent.alpha
    ), axis


def _frame_motion(frame: BodyFrame, body: BodyKinematics) -> FrameMotion:
    R, p = body.R @ frame.R, body.p + rotate(body.R, frame.p)
    states = body.acceleration_at(p), body.omega, body.alpha
    return FrameMotion.of(R, p, *(rotate_back(R, x) for x in states))


def _row(body: Body, frame: FrameMotion, state: BodyKinematics, axis: Array) -> tuple[Array]:
    """Return the row of the regressor for the joint of a body that moves the frame."""
    if body.revolute:
        return (_rotation_row(frame, axis, state.p),)
    return (_translation_row(frame, axis),)


def _base_rows(frame: FrameMotion, root: BodyKinematics) -> tuple[list[Array]]:
    axes = [root.R[..., k] for k in range(3)]
    translations = [_translation_row(frame, axis) for axis in axes]
    return ([*translations, *(_rotation_row(frame, axis, root.p) for axis in axes)],)


def _translation_row(frame: FrameMotion, axis: Array) -> Array:
    return _times(rotate_back(frame.R, axis), frame.wrench[..., :3, :])


def _rotation_row(frame: FrameMotion, axis: Array, p: Array) -> Array:
    motion = rotate_back(frame.R, cross(axis, frame.p - p)), rotate_back(frame.R, axis)
    return _times(np.concatenate(np.broadcast_arrays(*motion), axis=-1), frame.wrench)


def _times(row: Array, A: Array) -> Array:
    return np.asarray((row[..., None, :] @ A)[..., 0, :])


@checks_types
def inertial_parameters(model: Model, convert: ScalarConverter = float64) -> Array:
    """Return the inertial parameters pi (10 n_links,) of all `model.links`; zeros without an inertial.

    `convert` gives arrays of another scalar type. Raises ArgumentError if `convert` changes the shape.
    """
    if np.shape(made := convert(np.zeros(3))) != (3,):
        raise ArgumentError(
            f"convert returns {shown(made)} for 3 numbers; wanted an array of their shape (3,)"
        )
    return np.concatenate(
        [parameters_from_inertia(link_inertia(model, link.name, convert)) for link in model.links]
    )


def link_inertia(model: Model, link: str, convert: ScalarConverter = float64) -> RigidInertia:
    """Return the inertia of one link about the origin of the link frame, in its axes."""
    inertial = model.inertial(link)
    R, p = pose_arrays(inertial.origin, convert)
    return inertia_about_origin(convert(inertial.mass), p, R, convert(inertial.tensor))


def _tensor_columns(w: Array) -> Array:
    """Return L (..., 3, 6) with L (Ixx, Ixy, Ixz, Iyy, Iyz, Izz) = I w."""
    x, y, z = w[..., 0], w[..., 1], w[..., 2]
    o = 0 * x
    rows = [[x, y, z, o, o, o], [o, x, o, y, z, o], [o, o, x, o, y, z]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
