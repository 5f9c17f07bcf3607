"""Base inertial parameters: an equivalent mechanism with fewer non-zero numbers and the same dynamics.

Joint torques do not determine all inertial parameters of a body: some may be assigned to the parent of its
joint instead. For a revolute joint these are the parameters of mass distributed along the axis, which do not
change when the body rotates; for a prismatic joint, rotational inertia without mass; for a ball joint, a mass
at its centre. Regrouped with the parent's, they leave three of the ten parameters of a body zero (six for a
prismatic joint, one for a ball joint), as in Gautier and Khalil, Direct calculation of minimum set of
inertial parameters of serial robots, 1990. The origin of a body frame may also lie anywhere on the joint
axis: it is moved to where the vectors between successive origins have the fewest non-zero components.

In exact arithmetic, torque, mass matrix, energies, momentum and centre of mass of the whole robot stay the
same functions of the same coordinates, and frames keep their names and poses. The inertia of a single body
does not stay the same.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from dynx.model.mechanism import ROOT, Body, BodyFrame, Mechanism
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array, sqrt
from dynx.spatial.so3 import cross, rotate_back

ZERO_LENGTH = 1e-14
"""Bound [m] below which a length counts as zero."""

Z_AXIS = np.array([0, 0, 1])
"""Axis of every revolute joint of a mechanism after `align_frames`."""


def align_frames(mechanism: Mechanism) -> Mechanism:
    """Return the mechanism with new body frames, whose z axes are the axes of revolute joints.

    The origin is moved along the axis if that makes more components zero. The frame of a body on a
    prismatic joint is that of its parent when the joint is at 0; that of a ball joint stays.
    """
    identity, zero = np.eye(3, dtype=int) + 0 * mechanism.gravity, 0 * mechanism.gravity
    # Pose (Q, o) of the new frame of each body in its old one.
    frames: dict[int, tuple[Array, Array]] = {ROOT: (identity, zero)}
    children: dict[int, list[Body]] = {}
    for body in mechanism.bodies:
        children.setdefault(body.parent, []).append(body)
    placed: list[tuple[Body, Array, Array, Array]] = []
    for index, body in enumerate(mechanism.bodies):
        Q_parent, o_parent = frames[body.parent]
        # Pose of the joint in the parent's new frame.
        R, p = Q_parent.T @ body.R, Q_parent.T @ (body.p - o_parent)
        if body.ball is not None:
            Q, o = identity, zero
            placed.append((body, R, p, body.axis))
        elif body.revolute:
            child_offsets = [np.sum(child.p * body.axis) for child in children.get(index, ())]
            Q, o = rotation_to_axis(R, body.axis), _origin_shift(R, p, body.axis, child_offsets)
            placed.append((body, R @ Q, p + R @ o, Z_AXIS + zero))
        else:
            Q, o = R.T, -R.T @ p
            placed.append((body, identity, zero, R @ body.axis))
        frames[index] = Q, o
    inertias = _inertias_in_frames(
        [body.inertia for body, *_ in placed], [frames[k] for k in range(len(placed))]
    )
    bodies = tuple(
        Body(body.joint, body.parent, body.revolute, R, p, axis, inertia, body.ball)
        for (body, R, p, axis), inertia in zip(placed, inertias, strict=True)
    )
    named_frames = tuple(
        BodyFrame(frame.name, frame.body, Q.T @ frame.R, Q.T @ (frame.p - o))
        for frame in mechanism.frames
        for Q, o in (frames[frame.body],)
    )
    return replace(mechanism, bodies=bodies, frames=named_frames)


def regroup_inertias(mechanism: Mechanism) -> Mechanism:
    """Return the mechanism with redundant inertial parameters moved to the parents, from tips to root.

    The mechanism must come from `align_frames`. The remaining inertias need not be physically consistent.
    """
    inertias = {ROOT: mechanism.root, **{k: body.inertia for k, body in enumerate(mechanism.bodies)}}
    for index in reversed(range(len(mechanism.bodies))):
        body = mechanism.bodies[index]
        inertias[index], redundant = split_inertia(inertias[index], body.revolute, body.ball is not None)
        inertias[body.parent] = inertias[body.parent] + redundant.transform(body.R, body.p)
    bodies = tuple(replace(body, inertia=inertias[k]) for k, body in enumerate(mechanism.bodies))
    return replace(mechanism, root=inertias[ROOT], bodies=bodies)


def split_inertia(
    inertia: RigidInertia, revolute: bool, ball: bool = False
) -> tuple[RigidInertia, RigidInertia]:
    """Split an inertia into the part that stays with the body and the part that moves to its parent.

    The body rotates about the z axis of its frame if it is `revolute`, about any axis through the origin if
    it is on a `ball` joint, and slides otherwise.
    """
    mass, h, tensor = inertia.mass, inertia.first_moment, inertia.rotational_inertia
    if ball:
        return RigidInertia(0 * mass, h, tensor), RigidInertia(mass, 0 * h, 0 * tensor)
    if not revolute:
        return RigidInertia(mass, h, 0 * tensor), RigidInertia(0 * mass, 0 * h, tensor)
    xx, yy, zz = (inertia.second_moment_matrix[k, k] for k in range(3))
    # With this tensor the second-moment matrix of the remaining part has the diagonal xx, yy and exactly 0.
    (_, xy, xz), (_, _, yz), _ = tensor
    remaining = np.array([[yy, xy, xz], [xy, xx, yz], [xz, yz, xx + yy]])
    across, along = np.array([1, 1, 0]), np.array([0, 0, 1])
    return (
        RigidInertia(0 * mass, h * across, remaining),
        RigidInertia(mass, h * along, np.diag(across) * zz),
    )


def _inertias_in_frames(
    inertias: Sequence[RigidInertia], frames: Sequence[tuple[Array, Array]]
) -> Iterator[RigidInertia]:
    """Yield each inertia about the origin of the frame that has the pose (Q, o), in its axes.

    They are computed together, which takes a fifth of the time of one by one.
    """
    if not inertias:
        return
    together = RigidInertia(
        np.array([each.mass for each in inertias]),
        np.array([each.first_moment for each in inertias]),
        np.array([each.rotational_inertia for each in inertias]),
    )
    Q, o = np.array([Q for Q, _ in frames]), np.array([o for _, o in frames])
    moved = together.transform(np.swapaxes(Q, -1, -2), -rotate_back(Q, o))
    for k in range(len(inertias)):
        yield moved[k]


def rotation_to_axis(R: Array, axis: Array) -> Array:
    """Return a rotation Q (3, 3) that maps z to `axis`.

    If `axis` is a coordinate axis, Q permutes axes; else it is chosen so that R Q has a zero entry.
    """
    k = int(np.argmax(np.abs(axis)))
    if np.count_nonzero(axis) == 1:
        x = np.eye(3, dtype=int)[(k + 1) % 3]
    else:
        x = cross(R.T @ Z_AXIS, axis)
        if np.sum(x * x) < 1e-16:
            # The joint axis is parallel to z of the parent: any x perpendicular to it gives the zero.
            x = cross(np.eye(3, dtype=int)[(k + 1) % 3] + 0 * axis, axis)
        x = x / sqrt(np.sum(x * x))
    return np.stack([x + 0 * axis, cross(axis, x + 0 * axis), axis], axis=-1)


def _origin_shift(R: Array, p: Array, axis: Array, child_offsets: Sequence[Any]) -> Array:
    """Return the displacement o (3,) of the origin along the joint axis.

    With it a component of p + R o vanishes, but the offsets along the axis to the child joints,
    `child_offsets` [m], may become non-zero. Unless the number of non-zero components falls, the origin
    stays: moving it regardless would separate three axes that meet in one point, with massless bodies
    between them, and forward dynamics would lose digits.
    """
    direction = R @ axis
    k = int(np.argmax(np.abs(direction)))
    shift = -p[k] / direction[k]
    before = (abs(p[k]) > ZERO_LENGTH) + sum(abs(length) > ZERO_LENGTH for length in child_offsets)
    after = sum(abs(length - shift) > ZERO_LENGTH for length in child_offsets)
    return np.asarray(axis * (shift if after < before else 0 * shift))
