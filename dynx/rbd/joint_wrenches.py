"""Wrenches that joints transmit: recursive Newton-Euler that keeps the force and the moment at every link.

The wrench that the parent exerts on the child of a joint is the sum of what moves the links beyond the joint,
m (c'' - g) and the rate of their angular momentum (Featherstone 2008, table 5.1), less the wrenches that act
on them from outside. It includes the torque of the motor: its component along the axis of a joint is that
joint's entry of inverse dynamics. Joints are those of the description, so links count one by one: the wrench
at a fixed joint is that on the links behind it, which `Mechanism.bodies` has merged with those before it.

Damping, friction and armature of a joint act between the motor and the child. At a given acceleration they
change the torque that the motor must give, not what arrives at the child.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from dynx.model.mechanism import ROOT, Mechanism
from dynx.rbd.jacobians import Reference
from dynx.rbd.kinematics import Poses, frame_pose
from dynx.rbd.loops import PythonLoops
from dynx.rbd.placement import SpatialVector
from dynx.rbd.regressor import body_states
from dynx.rbd.rnea import LocalMotion, add_spatial, body_wrench
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.so3 import cross, rotate, rotate_back


def joint_wrenches(mechanism: Mechanism, poses: Poses, v: Array, a: Array) -> Array:
    """Return the wrench (..., n_joints, 6) on the child link of every joint, at the origin of the child's
    frame in its axes, at the tree velocity v and acceleration a (..., nv)."""
    _, *wrenches = _link_wrenches(mechanism, poses, v, a)
    if not wrenches:
        return np.zeros((*v.shape[:-1], 0, 6))
    shape = np.broadcast_shapes(*(wrench.shape for wrench in wrenches))
    return np.stack([np.broadcast_to(wrench, shape) for wrench in wrenches], axis=-2)


def base_wrench(mechanism: Mechanism, poses: Poses, v: Array, a: Array) -> Array:
    """Return the wrench (..., 6) that the world exerts on the root link, at the origin of its frame in its
    axes."""
    return _link_wrenches(mechanism, poses, v, a)[0]


def _link_wrenches(mechanism: Mechanism, poses: Poses, v: Array, a: Array) -> list[Array]:
    """Return for every link the wrench (..., 6) on it and on all links beyond it, in its own frame."""
    states, _ = body_states(PythonLoops(mechanism), list(zip(poses.R, poses.p, strict=True)), v, a)
    placed: list[tuple[Array, Array]] = []
    totals: list[SpatialVector] = []
    for number, link in enumerate(mechanism.links):
        R, p = frame_pose(mechanism, poses, number)
        body = states[mechanism.frames[number].body - ROOT]
        omega, alpha, acceleration = body.omega, body.alpha, body.acceleration_at(p)
        force, moment = body_wrench(
            link.inertia, LocalMotion(*(rotate_back(R, x) for x in (omega, alpha, acceleration)))
        )
        placed.append((R, p))
        totals.append((rotate(R, force), rotate(R, moment)))
    for number in reversed(range(1, len(totals))):
        parent, (force, moment) = mechanism.links[number].parent, totals[number]
        lever = placed[number][1] - placed[parent][1]
        totals[parent] = add_spatial(totals[parent], (force, moment + cross(lever, force)))
    return [
        np.concatenate(np.broadcast_arrays(rotate_back(R, force), rotate_back(R, moment)), axis=-1)
        for (R, _), (force, moment) in zip(placed, totals, strict=True)
    ]


def about_world(wrench: Array, p: Array) -> Array:
    """Return a wrench (..., 6) in world axes about the point p (..., 3) as one about the world's origin."""
    force, moment = wrench[..., :3], wrench[..., 3:]
    return np.concatenate([force, moment + cross(*np.broadcast_arrays(p, force))], axis=-1)


class AppliedWrench(NamedTuple):
    """A wrench from outside on link number `link`: force and moment (..., 3) in world axes, the moment about
    the point (..., 3) of the world."""

    link: int
    point: Array
    force: Array
    moment: Array

    @classmethod
    def of(cls, link: int, T_world_frame: Floats, wrench: Floats, reference: Reference) -> AppliedWrench:
        """Return a wrench (..., 6) on a frame of a link, given in one of the references of a Jacobian."""
        R, p = T_world_frame[..., :3, :3], T_world_frame[..., :3, 3]
        force, moment = wrench[..., :3], wrench[..., 3:]
        if reference == "local":
            force, moment = rotate(R, force), rotate(R, moment)
        return cls(link, 0.0 * p if reference == "world" else p, force, moment)


class LinkWrenches:
    """Wrenches (..., n, 6) on links and all that is beyond them, in the frames of the links.

    `links` are the numbers of the n links, and `T` (..., n_links, 4, 4) has the poses in the world of all
    links of `mechanism`.
    """

    def __init__(self, mechanism: Mechanism, links: range, T: Floats, wrenches: Floats) -> None:
        self._mechanism = mechanism
        self._links = links
        T = T[..., links.start : links.stop, :, :]
        self._R, self._p = T[..., :3, :3], T[..., :3, 3]
        self._force: Floats = rotate(self._R, wrenches[..., :3])
        self._moment: Floats = rotate(self._R, wrenches[..., 3:])

    def subtract(self, applied: Iterable[AppliedWrench]) -> None:
        """Subtract wrenches from outside from those of the links that carry them."""
        for link, point, force, moment in applied:
            carriers = []
            while link != ROOT:
                if link in self._links:
                    carriers.append(link - self._links.start)
                link = self._mechanism.links[link].parent
            on = np.zeros(len(self._links))
            on[carriers] = 1.0
            lever = point[..., None, :] - self._p
            force, moment = on[:, None] * force[..., None, :], on[:, None] * moment[..., None, :]
            self._moment = self._moment - moment - cross(*np.broadcast_arrays(lever, force))
            self._force = self._force - force

    def expressed(self, reference: Reference, T_world_frame: Floats | None = None) -> Floats:
        """Return the wrenches (..., n, 6) in a reference of the frame with this pose (..., 4, 4); of the
        frame of each link if it is None."""
        R, p = self._R, self._p
        if T_world_frame is not None:
            R, p = T_world_frame[..., None, :3, :3], T_world_frame[..., None, :3, 3]
        force, moment = self._force, self._moment
        origin = 0.0 * p if reference == "world" else p
        moment = moment + cross(*np.broadcast_arrays(self._p - origin, force))
        if reference == "local":
            force, moment = rotate_back(R, force), rotate_back(R, moment)
        return np.concatenate(np.broadcast_arrays(force, moment), axis=-1)
