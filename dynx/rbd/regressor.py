"""The inertial regressor: the torque as a linear function of the inertial parameters of the links.

    tau = Y(q, v, a) pi,   pi = the ten parameters of every link, link after link

Inverse dynamics is linear in mass, first moment and second moment of each link (Atkeson, An and
Hollerbach, Estimation of inertial parameters of manipulator loads and links, 1986; Siciliano et al.,
Robotics, section 7.2.2). The ten of a link, about the origin of the link's frame and in its axes, are

    m, m cx, m cy, m cz [kg m], Ixx, Ixy, Ixz, Iyy, Iyz, Izz [kg m^2]

with c the centre of mass and I the rotational inertia about the frame's origin, not about c. Pinocchio
lists the tensor as Ixx, Ixy, Iyy, Ixz, Iyz, Izz.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dynx.model import Model
from dynx.model.mechanism import Mechanism, Numbers, float64, pose_arrays
from dynx.rbd.jacobians import frame_jacobian
from dynx.rbd.kinematics import Poses, Twists, body_twists, frame_pose, joint_axis, joint_value
from dynx.spatial.inertia import RigidInertia, inertia_about_origin
from dynx.spatial.scalar import Array, along
from dynx.spatial.so3 import cross, rotate, rotate_back, skew

PARAMETERS = ("m", "mcx", "mcy", "mcz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
"""The ten parameters of a link, in order."""

TENSOR = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
"""Row and column of the last six."""


def inertial_regressor(
    mechanism: Mechanism, poses: Poses, v: Array, a: Array, frames: Sequence[int]
) -> Array:
    """Y (..., nv, 10 n) in tree coordinates, for bodies fixed to each of n `frames` (numbers).

    The columns of what no coordinate moves are zero.
    """
    twists = body_twists(mechanism, poses, v)
    accelerations = body_accelerations(mechanism, poses, twists, v, a)
    blocks = []
    for frame in frames:
        body = mechanism.frames[frame].body
        R, p = frame_pose(mechanism, poses, frame)
        turning, change = twists[body][1], accelerations[body][1]
        reach = p - poses[body][1]
        rising = accelerations[body][0] + cross(change, reach) + cross(turning, cross(turning, reach))
        proper = rotate_back(R, rising - mechanism.gravity)
        wrench = wrench_regressor(proper, rotate_back(R, turning), rotate_back(R, change))
        J = frame_jacobian(mechanism, poses, frame, "local")
        blocks.append(np.swapaxes(J, -1, -2) @ wrench)
    shape = np.broadcast_shapes(*(block.shape for block in blocks))
    return np.concatenate([np.broadcast_to(block, shape) for block in blocks], axis=-1)


def wrench_regressor(acceleration: Array, turning: Array, change: Array) -> Array:
    """A (..., 6, 10) with A pi the force and the moment about the origin of a frame that a body needs.

    `acceleration` (..., 3) is that of the origin less gravity, `turning` the angular velocity, `change`
    its derivative, all in the frame's axes: f = m d + w' x h + w x (w x h), n = h x d + I w' + w x I w.
    """
    acceleration, turning, change = np.broadcast_arrays(acceleration, turning, change)
    W = skew(turning)
    spin = skew(change) + W @ W
    moments = _tensor_columns(change) + W @ _tensor_columns(turning)
    column = acceleration[..., None]
    force = np.concatenate([column, spin, 0 * moments], axis=-1)
    moment = np.concatenate([0 * column, -skew(acceleration), moments], axis=-1)
    return np.concatenate([force, moment], axis=-2)


def body_accelerations(mechanism: Mechanism, poses: Poses, twists: Twists, v: Array, a: Array) -> Twists:
    """Second derivative of each body's origin, and of its angular velocity the first, in the world."""
    R, p = poses.R[0], poses.p[0]
    if mechanism.floating:
        # v is in axes that turn with the base: dv/dt in the world has the part w x v.
        linear = [rotate(R, a[..., :3]) + cross(twists.angular[0], twists.linear[0])]
        angular = [rotate(R, a[..., 3:6])]
    else:
        linear, angular = [0 * p], [0 * p]
    for index, body in enumerate(mechanism.bodies):
        axis = joint_axis(mechanism, poses, index)
        speed = axis * along(joint_value(mechanism, v, index))
        change = axis * along(joint_value(mechanism, a, index))
        turning, turned = twists[body.parent][1], angular[body.parent + 1]
        reach = poses[index][1] - poses[body.parent][1]
        moved = linear[body.parent + 1] + cross(turned, reach) + cross(turning, cross(turning, reach))
        if body.revolute:
            linear.append(moved)
            angular.append(turned + change + cross(turning, speed))
        else:
            linear.append(moved + change + 2 * cross(turning, speed))
            angular.append(turned)
    return Twists(tuple(linear), tuple(angular))


def inertial_parameters(model: Model, numbers: Numbers = float64) -> Array:
    """pi (10 n_links,): the ten of each of `model.links`, zeros for a link without inertia."""
    return np.concatenate([parameters_of(link_inertia(model, link.name, numbers)) for link in model.links])


def link_inertia(model: Model, link: str, numbers: Numbers = float64) -> RigidInertia:
    """The inertia of one link about the origin of its frame."""
    inertial = model.inertial(link)
    R, p = pose_arrays(inertial.origin, numbers)
    return inertia_about_origin(numbers(inertial.mass), p, R, numbers(inertial.tensor))


def parameters_of(inertia: RigidInertia) -> Array:
    """The ten (10,) of a rigid body about the origin in which it is given."""
    tensor = [inertia.second_moment[..., i, j] for i, j in TENSOR]
    first = [inertia.first_moment[..., k] for k in range(3)]
    return np.stack([np.asarray(x) for x in (inertia.mass, *first, *tensor)], axis=-1)


def inertia_of(parameters: Array) -> RigidInertia:
    """The rigid body that has the ten `parameters` (..., 10)."""
    tensor = {ij: parameters[..., 4 + k] for k, ij in enumerate(TENSOR)}
    rows = [[tensor[min(i, j), max(i, j)] for j in range(3)] for i in range(3)]
    second = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    return RigidInertia(np.asarray(parameters[..., 0]), parameters[..., 1:4], second)


def _tensor_columns(w: Array) -> Array:
    """L (..., 3, 6) with L (Ixx, Ixy, Ixz, Iyy, Iyz, Izz) = I w."""
    x, y, z = w[..., 0], w[..., 1], w[..., 2]
    o = 0 * x
    rows = [[x, y, z, o, o, o], [o, x, o, y, z, o], [o, o, x, o, y, z]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
