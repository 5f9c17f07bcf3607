"""Poses and twists of the bodies, in world axes (Featherstone 2008, sections 4.4 and 5.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynx.model.mechanism import ROOT, Mechanism, joint_motion
from dynx.spatial.scalar import Array, append_axis
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import cross, rotate, rotation_from_quat


@dataclass(frozen=True)
class Poses:
    """Pose (R, p) in the world of the root body (index ROOT) and of every moving body."""

    R: tuple[Array, ...]
    p: tuple[Array, ...]

    def __getitem__(self, body: int) -> tuple[Array, Array]:
        return self.R[body + 1], self.p[body + 1]


@dataclass(frozen=True)
class BodyVectors:
    """A linear and an angular vector of each body, in world axes, root body first.

    Velocities of the origins and angular velocities, or accelerations of both.
    """

    linear: tuple[Array, ...]
    angular: tuple[Array, ...]

    def __getitem__(self, body: int) -> tuple[Array, Array]:
        return self.linear[body + 1], self.angular[body + 1]


def joint_value(mechanism: Mechanism, x: Array, body: int) -> Array:
    """Return the entry (...,) for the body's joint of a tree configuration or velocity (..., n)."""
    return np.asarray(x[..., x.shape[-1] - len(mechanism.bodies) + body])


def body_poses(mechanism: Mechanism, q: Array) -> Poses:
    """Return the poses of all bodies at the tree configuration `q` (..., nq)."""
    if mechanism.floating:
        R, p = [rotation_from_quat(q[..., 3:7])], [q[..., :3]]
    else:
        zero = 0 * mechanism.gravity
        R, p = [np.eye(3, dtype=int) + zero[:, None]], [zero]
    for index, body in enumerate(mechanism.bodies):
        R_joint, p_joint = joint_motion(body, joint_value(mechanism, q, index))
        R_parent, p_parent = R[body.parent + 1], p[body.parent + 1]
        R.append(R_parent @ R_joint)
        p.append(p_parent + rotate(R_parent, p_joint))
    return Poses(tuple(R), tuple(p))


def poses_from_frames(mechanism: Mechanism, placements: Array) -> Poses:
    """Return the poses of all bodies, taken from the placements (..., n_frames, 4, 4) of all frames."""
    own = [placements[..., index, :, :] for index in mechanism.body_frames]
    if not mechanism.floating:
        # The root body is the world, in which the base frame may have any pose.
        own[0] = np.eye(4) + 0 * own[0]
    return Poses(tuple(T[..., :3, :3] for T in own), tuple(T[..., :3, 3] for T in own))


def frame_pose(mechanism: Mechanism, poses: Poses, frame: int) -> tuple[Array, Array]:
    """Return the pose (R, p) of frame number `frame` in the world."""
    fixed = mechanism.frames[frame]
    R, p = poses[fixed.body]
    return R @ fixed.R, p + rotate(R, fixed.p)


def frame_placement(mechanism: Mechanism, poses: Poses, frame: int) -> Array:
    """Return T_world_frame (..., 4, 4) of frame number `frame`."""
    return homogeneous(*frame_pose(mechanism, poses, frame))


def frame_placements(mechanism: Mechanism, q: Array) -> Array:
    """Return T_world_frame of every frame (..., n_frames, 4, 4)."""
    poses = body_poses(mechanism, q)
    shape = (*q.shape[:-1], 4, 4)
    all_frames = (frame_placement(mechanism, poses, k) for k in range(len(mechanism.frames)))
    return np.stack([np.broadcast_to(T, shape) for T in all_frames], axis=-3)


def joint_axis(mechanism: Mechanism, poses: Poses, body: int) -> Array:
    """Return the unit axis (..., 3) of the body's joint in world axes."""
    return rotate(poses[body][0], mechanism.bodies[body].axis)


def body_twists(mechanism: Mechanism, poses: Poses, v: Array) -> BodyVectors:
    """Return the velocities of all bodies in world axes at the tree velocity `v` (..., nv)."""
    R_root, p_root = poses[ROOT]
    if mechanism.floating:
        linear, angular = [rotate(R_root, v[..., :3])], [rotate(R_root, v[..., 3:6])]
    else:
        linear, angular = [0 * p_root], [0 * p_root]
    for index, body in enumerate(mechanism.bodies):
        speed = joint_axis(mechanism, poses, index) * append_axis(joint_value(mechanism, v, index))
        omega = angular[body.parent + 1]
        lever = poses[index][1] - poses[body.parent][1]
        velocity = linear[body.parent + 1] + cross(omega, lever)
        linear.append(velocity if body.revolute else velocity + speed)
        angular.append(omega + speed if body.revolute else omega)
    return BodyVectors(tuple(linear), tuple(angular))


def ancestry(mechanism: Mechanism, body: int) -> list[int]:
    """List the moving bodies on the path from `body` to the root, `body` first and the root left out."""
    path = []
    while body != ROOT:
        path.append(body)
        body = mechanism.bodies[body].parent
    return path
