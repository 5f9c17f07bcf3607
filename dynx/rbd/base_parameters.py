"""The same dynamics in fewer numbers: frames along the joint axes, inertias by base parameters.

Torques do not determine how mass is spread over the links. What a joint cannot tell from outside may
belong to either of the bodies that it joins: for a revolute joint whatever looks the same when turned
about the axis and has no inertia about it, that is mass spread along the axis; for a prismatic joint
rotational inertia without mass. Moved to the parent, wherever that body is, it leaves three of ten
parameters of a body zero for good, six for a prismatic joint (Gautier and Khalil, Direct calculation of
minimum set of inertial parameters of serial robots, 1990). Nor do torques know where on its axis a body's
frame sits: its origin is moved to where the ways from joint to joint have the fewest components.

Torque, mass matrix, energies, momentum and centre of mass stay what they are, as functions of the same
coordinates, in the terms of real arithmetic; frames keep their names and places. What does not stay is which
body has which inertia.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from dynx.model.mechanism import ROOT, Body, Mechanism
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array, sqrt
from dynx.spatial.so3 import cross

NOTHING = 1e-14
"""A length [m] that is zero but for rounding."""

Z = np.array([0, 0, 1])
"""The axis of every revolute joint of a mechanism that was `aligned`."""


def reduced(mechanism: Mechanism) -> Mechanism:
    """`regrouped` of `aligned`."""
    return regrouped(aligned(mechanism))


def aligned(mechanism: Mechanism) -> Mechanism:
    """Every body in a frame of which z is the axis of its joint, its origin slid along that axis if that
    saves numbers.

    A body on a prismatic joint has the axes of its parent, and its origin when the joint is at 0.
    """
    one, nothing = np.eye(3, dtype=int) + 0 * mechanism.gravity, 0 * mechanism.gravity
    # The new frame of each body, as its pose (Q, o) in the old one.
    frames: dict[int, tuple[Array, Array]] = {ROOT: (one, nothing)}
    bodies = []
    for index, body in enumerate(mechanism.bodies):
        Q_parent, o_parent = frames[body.parent]
        # The joint as the parent's new frame sees it.
        R, p = Q_parent.T @ body.R, Q_parent.T @ (body.p - o_parent)
        if body.revolute:
            onwards = [np.sum(child.p * body.axis) for child in mechanism.bodies if child.parent == index]
            Q, o = _axes(R, body.axis), _slide(R, p, body.axis, onwards)
        else:
            Q, o = R.T, -R.T @ p
        frames[index] = Q, o
        moved = replace(body, R=R @ Q, p=p + R @ o, axis=Z + nothing, inertia=_in_frame(body.inertia, Q, o))
        bodies.append(moved if body.revolute else replace(moved, R=one, p=nothing, axis=R @ body.axis))
    named = tuple(
        replace(frame, R=Q.T @ frame.R, p=Q.T @ (frame.p - o))
        for frame in mechanism.frames
        for Q, o in (frames[frame.body],)
    )
    return replace(mechanism, bodies=tuple(bodies), frames=named)


def regrouped(mechanism: Mechanism) -> Mechanism:
    """What may belong to the parent moved there, body after body from the tips to the root.

    Wants an `aligned` mechanism. The inertias that remain are those of no real body.
    """
    inertias = {ROOT: mechanism.root, **{k: body.inertia for k, body in enumerate(mechanism.bodies)}}
    for index in reversed(range(len(mechanism.bodies))):
        body = mechanism.bodies[index]
        inertias[index], moved = _parted(inertias[index], body)
        inertias[body.parent] = inertias[body.parent] + moved.seen_from(body.R, body.p)
    bodies = tuple(replace(body, inertia=inertias[k]) for k, body in enumerate(mechanism.bodies))
    return replace(mechanism, root=inertias[ROOT], bodies=bodies)


def _parted(inertia: RigidInertia, body: Body) -> tuple[RigidInertia, RigidInertia]:
    """What stays with a body, and what goes to its parent."""
    mass, h, tensor = inertia.mass, inertia.first_moment, inertia.second_moment
    if not body.revolute:
        return RigidInertia(mass, h, 0 * tensor), RigidInertia(0 * mass, 0 * h, tensor)
    x, y, line = (inertia.spread[k, k] for k in range(3))
    # With these moments the spread of what stays is x, y and, exactly, 0.
    (_, xy, xz), (_, _, yz), _ = tensor
    stays = np.array([[y, xy, xz], [xy, x, yz], [xz, yz, x + y]])
    across, along = np.array([1, 1, 0]), np.array([0, 0, 1])
    return (
        RigidInertia(0 * mass, h * across, stays),
        RigidInertia(mass, h * along, np.diag(across) * line),
    )


def _in_frame(inertia: RigidInertia, Q: Array, o: Array) -> RigidInertia:
    """An inertia about the origin of the frame with the pose (Q, o), in its axes."""
    return inertia.seen_from(Q.T, -Q.T @ o)


def _axes(R: Array, axis: Array) -> Array:
    """Q (3, 3), a rotation with z along `axis`: of coordinate axes if that is one, else such that R Q,
    the joint in its parent, has a zero."""
    k = int(np.argmax(np.abs(axis)))
    if np.count_nonzero(axis) == 1:
        x = np.eye(3, dtype=int)[(k + 1) % 3]
    else:
        x = cross(R.T @ Z, axis)
        if np.sum(x * x) < 1e-16:
            # The joint is parallel to z of the parent already: any x will do.
            x = cross(np.eye(3, dtype=int)[(k + 1) % 3] + 0 * axis, axis)
        x = x / sqrt(np.sum(x * x))
    return np.stack([x + 0 * axis, cross(axis, x + 0 * axis), axis], axis=-1)


def _slide(R: Array, p: Array, axis: Array, onwards: Sequence[Any]) -> Array:
    """Where on the axis (through the old origin) the new one is.

    There a component of p + R o vanishes, but others may come into being: `onwards` are the ways along
    the axis to the joints that the body carries. If that does not save a number the origin stays.
    Three axes through one point would otherwise be pulled apart, with bodies without mass between
    them, and forward dynamics would lose digits.
    """
    along = R @ axis
    k = int(np.argmax(np.abs(along)))
    way = -p[k] / along[k]
    before = (abs(p[k]) > NOTHING) + sum(abs(length) > NOTHING for length in onwards)
    after = sum(abs(length - way) > NOTHING for length in onwards)
    return np.asarray(axis * (way if after < before else 0 * way))
