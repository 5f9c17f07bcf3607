"""Poses and twists of the bodies and links, in world axes (Featherstone 2008, sections 4.4 and 5.3)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from dynx.model import Model
from dynx.model.mechanism import ROOT, Body, Mechanism, joint_motion
from dynx.rbd.loops import Loops, PythonLoops
from dynx.spatial.scalar import Array, Floats, append_axis
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import cross, rotate, rotation_from_quat

BodyPose = tuple[Array, Array]
"""Rotation R (..., 3, 3) and position p (..., 3) of a body in the world."""


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
    """Return the entry (...,) for the body's joint of a tree velocity (..., nv)."""
    return np.asarray(x[..., x.shape[-1] - len(mechanism.bodies) + body])


def body_poses(mechanism: Mechanism, q: Array) -> Poses:
    """Return the poses of all bodies at the tree configuration `q` (..., nq)."""
    return Poses(*zip(*pose_pairs(PythonLoops(mechanism), q), strict=True))


def pose_pairs(loops: Loops, q: Array) -> Sequence[BodyPose]:
    """Return the pose (R, p) of every body at `q` (..., nq), the root's first."""
    poses, _ = loops.outward(_child_pose, loops.root(_root_pose, q), q)
    return poses


def _root_pose(mechanism: Mechanism, q: Array) -> BodyPose:
    if mechanism.floating:
        return rotation_from_quat(q[..., 3:7]), q[..., :3]
    zero = 0 * mechanism.gravity
    return np.eye(3, dtype=int) + zero[:, None], zero


def _child_pose(body: Body, parent: BodyPose, value: Array) -> tuple[BodyPose, None]:
    R_joint, p_joint = joint_motion(body, value)
    R_parent, p_parent = parent
    return (R_parent @ R_joint, p_parent + rotate(R_parent, p_joint)), None


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


def link_poses(model: Model, q: Floats) -> Iterator[tuple[str, Floats]]:
    """Yield every link with its pose in the world (..., 4, 4) at the configuration q (..., nq)."""
    links = {link.name for link in model.links}
    return (each for each in frame_poses(model, q) if each[0] in links)


def frame_poses(model: Model, q: Floats) -> Iterator[tuple[str, Floats]]:
    """Yield every frame with its pose in the world (..., 4, 4) at the configuration q (..., nq)."""
    mechanism = model.mechanism
    poses = body_poses(mechanism, mechanism.tree_q(q))
    for frame in mechanism.frames:
        T = homogeneous(*poses[frame.body]) @ homogeneous(frame.R, frame.p)
        yield frame.name, np.asarray(T, dtype=np.float64)
