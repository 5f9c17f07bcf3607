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

import numpy as np

from dynx.model import Model
from dynx.model.mechanism import Mechanism, ScalarConverter, float64, pose_arrays
from dynx.model.model import refuse_other_than_model
from dynx.rbd.jacobians import frame_jacobian
from dynx.rbd.kinematics import BodyVectors, Poses, body_twists, frame_pose, joint_axis, joint_value
from dynx.spatial.inertia import RigidInertia, inertia_about_origin
from dynx.spatial.scalar import Array, append_axis
from dynx.spatial.so3 import cross, rotate, rotate_back, skew

PARAMETERS = ("m", "mcx", "mcy", "mcz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
"""Names of the ten inertial parameters of a link, in order."""

TENSOR_ENTRIES = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
"""Row and column in the inertia tensor of each of the last six parameters."""


def inertial_regressor(
    mechanism: Mechanism, poses: Poses, v: Array, a: Array, frames: Sequence[int]
) -> Array:
    """Return Y (..., nv, 10 n) in tree coordinates, for one rigid body fixed to each of n `frames`.

    Columns of bodies that no coordinate moves are zero.
    """
    twists = body_twists(mechanism, poses, v)
    accelerations = body_accelerations(mechanism, poses, twists, v, a)
    blocks = []
    for frame in frames:
        body = mechanism.frames[frame].body
        R, p = frame_pose(mechanism, poses, frame)
        omega, alpha = twists[body][1], accelerations[body][1]
        acceleration = accelerations[body][0] + fixed_point_acceleration(omega, alpha, p - poses[body][1])
        proper_acceleration = rotate_back(R, acceleration - mechanism.gravity)
        wrench = wrench_regressor(proper_acceleration, rotate_back(R, omega), rotate_back(R, alpha))
        J = frame_jacobian(mechanism, poses, frame, "local")
        blocks.append(np.swapaxes(J, -1, -2) @ wrench)
    shape = np.broadcast_shapes(*(block.shape for block in blocks))
    return np.concatenate([np.broadcast_to(block, shape) for block in blocks], axis=-1)


def wrench_regressor(proper_acceleration: Array, omega: Array, alpha: Array) -> Array:
    """Return A (..., 6, 10) such that A pi is the wrench that gives a body the stated motion.

    Force and moment are about the origin of the body frame. `proper_acceleration` (..., 3) d is that of the
    origin (acceleration minus gravity), `omega` the angular velocity w and `alpha` the angular
    acceleration, all in the axes of the frame (Newton and Euler, with h = m c):

        f = m d + alpha x h + w x (w x h),   n = h x d + I alpha + w x I w
    """
    d, omega, alpha = np.broadcast_arrays(proper_acceleration, omega, alpha)
    return assemble_wrench_regressor(d, *moment_matrices(omega, alpha))


def moment_matrices(omega: Array, alpha: Array) -> tuple[Array, Array]:
    """Return the matrices (..., 3, 3) by which the first moment is multiplied in the force, and (..., 3, 6)
    by which the second moments are multiplied in the moment."""
    W = skew(omega)
    return skew(alpha) + W @ W, _tensor_columns(alpha) + W @ _tensor_columns(omega)


def assemble_wrench_regressor(d: Array, acceleration_matrix: Array, moments: Array) -> Array:
    """Return the matrix of `wrench_regressor` from its blocks."""
    column = d[..., None]
    force = np.concatenate([column, acceleration_matrix, 0 * moments], axis=-1)
    moment = np.concatenate([0 * column, -skew(d), moments], axis=-1)
    return np.concatenate([force, moment], axis=-2)


def body_accelerations(
    mechanism: Mechanism, poses: Poses, twists: BodyVectors, v: Array, a: Array
) -> BodyVectors:
    """Return the linear acceleration of each body's origin and its angular acceleration, in world axes."""
    R, p = poses.R[0], poses.p[0]
    if mechanism.floating:
        # v is expressed in axes that rotate with the base: the acceleration in the world includes omega x v.
        linear = [rotate(R, a[..., :3]) + cross(twists.angular[0], twists.linear[0])]
        angular = [rotate(R, a[..., 3:6])]
    else:
        linear, angular = [0 * p], [0 * p]
    for index, body in enumerate(mechanism.bodies):
        axis = joint_axis(mechanism, poses, index)
        parent = BodyState(
            poses[body.parent][1], twists[body.parent][1], linear[body.parent + 1], angular[body.parent + 1]
        )
        acceleration, alpha = child_acceleration(
            parent,
            poses[index][1],
            axis * append_axis(joint_value(mechanism, v, index)),
            axis * append_axis(joint_value(mechanism, a, index)),
            revolute=body.revolute,
        )
        linear.append(acceleration)
        angular.append(alpha)
    return BodyVectors(tuple(linear), tuple(angular))


@dataclass(frozen=True)
class BodyState:
    """Position and acceleration of the origin of a body, its angular velocity and acceleration, in world
    axes."""

    p: Array
    omega: Array
    acceleration: Array
    alpha: Array


def child_acceleration(
    parent: BodyState, p: Array, speed: Array, joint_acceleration: Array, *, revolute: bool
) -> tuple[Array, Array]:
    """Return the linear acceleration of the origin `p` of a body and its angular acceleration.

    `speed` and `joint_acceleration` are those of the joint along its axis, in world axes (..., 3).
    """
    omega, alpha = parent.omega, parent.alpha
    acceleration = parent.acceleration + fixed_point_acceleration(omega, alpha, p - parent.p)
    if revolute:
        return acceleration, alpha + joint_acceleration + cross(omega, speed)
    return acceleration + joint_acceleration + 2 * cross(omega, speed), alpha


def fixed_point_acceleration(omega: Array, alpha: Array, lever: Array) -> Array:
    """Return the acceleration of a point of a body relative to its origin, from which it is `lever` away."""
    return cross(alpha, lever) + cross(omega, cross(omega, lever))


def inertial_parameters(model: Model, convert: ScalarConverter = float64) -> Array:
    """Return pi (10 n_links,): the ten parameters of each of `model.links`, zeros without an inertial."""
    refuse_other_than_model(model)
    return np.concatenate(
        [parameters_from_inertia(link_inertia(model, link.name, convert)) for link in model.links]
    )


def link_inertia(model: Model, link: str, convert: ScalarConverter = float64) -> RigidInertia:
    """Return the inertia of one link about the origin of the link frame, in its axes."""
    inertial = model.inertial(link)
    R, p = pose_arrays(inertial.origin, convert)
    return inertia_about_origin(convert(inertial.mass), p, R, convert(inertial.tensor))


def parameters_from_inertia(inertia: RigidInertia) -> Array:
    """Return the ten parameters (..., 10) of a rigid body, about the origin of its frame."""
    tensor = [inertia.rotational_inertia[..., i, j] for i, j in TENSOR_ENTRIES]
    first_moment = [inertia.first_moment[..., k] for k in range(3)]
    return np.stack([np.asarray(x) for x in (inertia.mass, *first_moment, *tensor)], axis=-1)


def inertia_from_parameters(parameters: Array) -> RigidInertia:
    """Return the inertia that has the ten `parameters` (..., 10)."""
    tensor = {ij: parameters[..., 4 + k] for k, ij in enumerate(TENSOR_ENTRIES)}
    rows = [[tensor[min(i, j), max(i, j)] for j in range(3)] for i in range(3)]
    rotational_inertia = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    return RigidInertia(np.asarray(parameters[..., 0]), parameters[..., 1:4], rotational_inertia)


def _tensor_columns(w: Array) -> Array:
    """Return L (..., 3, 6) with L (Ixx, Ixy, Ixz, Iyy, Iyz, Izz) = I w."""
    x, y, z = w[..., 0], w[..., 1], w[..., 2]
    o = 0 * x
    rows = [[x, y, z, o, o, o], [o, x, o, y, z, o], [o, o, x, o, y, z]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
