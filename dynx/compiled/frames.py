"""Quantities of frames, written so that one kernel serves all frames of a chain of bodies.

A *chain* consists of the bodies between the root and one body. The last input of its kernel, the *place*,
selects a frame and is the same for every sample of a call: the frame's pose in its body, the reference, and a
*weight* for the root and each body of the chain, 1 for the body that the frame is fixed to and 0 for the
others. Properties of the bodies are summed over the chain with these weights. All but one of them are zero,
so the sum is exact.

Jacobians and their derivatives in `local_world_aligned`, which are used most, have a kernel for each body,
without weights: on a chain of 64 joints it is three times as fast.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dynx.model.mechanism import ROOT, Body, BodyFrame, Mechanism
from dynx.rbd.jacobians import (
    LOCAL_WORLD_ALIGNED,
    Reference,
    frame_jacobian,
    frame_jacobian_derivative,
    is_rotation,
    moving_columns,
)
from dynx.rbd.kinematics import Poses, ancestry, body_poses, body_twists, frame_pose
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.so3 import cross, skew

_POSITION, _ROTATION, _LOCAL, _WORLD, _WEIGHTS = slice(0, 3), slice(3, 12), 12, 13, slice(14, None)
"""Parts of a place. At most one of `_LOCAL` and `_WORLD` is 1; both are 0 for `local_world_aligned`."""

_WITH_OWN_KERNELS = frozenset({"jacobian", "jacobian_derivative"})
"""Quantities that have a kernel for each body in `local_world_aligned`."""


@dataclass(frozen=True)
class BodyChain:
    """Bodies from the root outwards, each the child of the one before it.

    With `shared`, the kernel serves frames on all of these bodies and on the root, in every reference.
    Without it, it serves frames on the last body (or on the root), in `local_world_aligned` only.
    """

    bodies: tuple[int, ...]
    shared: bool

    @property
    def place_size(self) -> int:
        """Number of entries of a place."""
        return _WEIGHTS.start + (len(self.bodies) + 1 if self.shared else 0)


def chain_of(mechanism: Mechanism, quantity: str, frame: int, reference: Reference) -> BodyChain:
    """Return the chain whose kernel computes a quantity of frame number `frame`."""
    body = mechanism.frames[frame].body
    shared = quantity not in _WITH_OWN_KERNELS or reference != LOCAL_WORLD_ALIGNED
    if shared:
        # Bodies are in depth-first order: the first child of a body follows it.
        while body + 1 < len(mechanism.bodies) and mechanism.bodies[body + 1].parent == body:
            body += 1
    return BodyChain(tuple(reversed(ancestry(mechanism, body))), shared)


def place_of(mechanism: Mechanism, chain: BodyChain, frame: int, reference: Reference) -> Floats:
    """Return the place (place_size,) of frame number `frame` in `reference`."""
    fixed = mechanism.frames[frame]
    place = np.zeros(chain.place_size)
    place[_POSITION], place[_ROTATION] = fixed.p, fixed.R.ravel()
    place[_LOCAL], place[_WORLD] = reference == "local", reference == "world"
    if chain.shared:
        place[_WEIGHTS] = [fixed.body == body for body in (ROOT, *chain.bodies)]
    return place


def on_chain(
    mechanism: Mechanism, quantity: str, chain: BodyChain, place: Array, q: Array, *rates: Array
) -> Array:
    """Evaluate a quantity of the frame at `place` for one sample, in tree coordinates.

    q (nq,), rates (nv,) and place hold numbers or symbols. Quantities are ``jacobian``,
    ``jacobian_derivative``, ``frame_velocity`` and ``frame_acceleration``.
    """
    base_q, base_v = (7, 6) if mechanism.floating else (0, 0)
    own_q = [*range(base_q), *(place for body in chain.bodies for place in _places(mechanism, body))]
    own_v = [*range(base_v), *(base_v + body for body in chain.bodies)]
    moves = np.ones(len(own_v))
    if chain.shared:
        # A joint moves the frames on its child body and on all bodies beyond it.
        moves = np.concatenate([np.ones(base_v), np.cumsum(place[_WEIGHTS][:0:-1])[::-1]])

    def all_columns(own: Array) -> Array:
        columns = np.zeros((6, mechanism.nv), dtype=object)
        columns[:, own_v] = own * moves
        return columns

    carrier, poses = _carrier(mechanism, chain, place, q[own_q])
    # The last column is that of the carrier's joint.
    v, *a = [np.append(rate[own_v] * moves, 0.0) for rate in rates] or [q]
    if quantity == "jacobian_derivative":
        if chain.shared:
            return all_columns(_jacobian(carrier, poses, place, v)[:, :-1])
        return all_columns(frame_jacobian_derivative(carrier, poses, v, 0, LOCAL_WORLD_ALIGNED)[:, :-1])
    if quantity == "jacobian" and chain.shared:
        return all_columns(_jacobian(carrier, poses, place)[:, :-1])
    J = frame_jacobian(carrier, poses, 0, LOCAL_WORLD_ALIGNED)
    if quantity == "jacobian":
        return all_columns(J[:, :-1])
    axes = _ReferenceAxes.of(place, *frame_pose(carrier, poses, 0))
    twist = J @ v
    if quantity == "frame_velocity":
        return axes.motion(twist)
    dJ = frame_jacobian_derivative(carrier, poses, v, 0, LOCAL_WORLD_ALIGNED)
    return axes.rate(twist, J @ a[0] + dJ @ v, twist)


def _places(mechanism: Mechanism, body: int) -> Sequence[int]:
    """Return the indices in q of the joint of a body: of a ball joint the quaternion, at its first body."""
    ball = mechanism.bodies[body].ball
    first = mechanism.places[body + (6 if mechanism.floating else 0)]
    return range(first, first + (1 if ball is None else 4 * (ball == 0)))


def _jacobian(mechanism: Mechanism, poses: Poses, place: Array, v: Array | None = None) -> Array:
    """Return J (6, nv) of the only frame of `mechanism` in `local` or `world`, or dJ/dt at a velocity `v`.

    The column of a joint on body k is the motion of a screw S that is fixed to the body, so its derivative is
    (V_k - V) x S with the velocities of the body and of the axes of the reference (Featherstone 2008, eq.
    2.45). That takes half of the operations of differentiating the columns and then their transformation.
    """
    R, p = frame_pose(mechanism, poses, 0)
    local, frame = place[_LOCAL], mechanism.frames[0].body
    origin = local * p
    if v is not None:
        twists = body_twists(mechanism, poses, v)
        omega = local * twists[frame][1]
        velocity = local * (twists[frame][0] + cross(twists[frame][1], p - poses[frame][1]))
    columns = np.zeros((6, mechanism.nv), dtype=object)
    for column, z, o, owner in moving_columns(mechanism, poses, frame):
        lever = origin - o
        angular = z if is_rotation(mechanism, column, owner) else 0 * z
        linear = cross(z, lever) if is_rotation(mechanism, column, owner) else z
        if v is not None:
            carrier = twists[owner if owner == ROOT else mechanism.axis_carriers[owner]]
            relative = carrier[1] - omega
            at_origin = carrier[0] + cross(carrier[1], lever) - velocity
            linear = cross(relative, linear) + cross(at_origin, angular)
            angular = cross(relative, angular)
        columns[:3, column], columns[3:, column] = linear, angular
    axes = _ReferenceAxes.of(place, R, p).R
    return np.concatenate([axes @ columns[:3], axes @ columns[3:]])


def _carrier(mechanism: Mechanism, chain: BodyChain, place: Array, q: Array) -> tuple[Mechanism, Poses]:
    """Return the bodies of the chain and one more, the carrier, to which the only frame is fixed.

    The carrier has the pose of the body that the frame is fixed to. Its parent is the last body; its joint
    does not move, so the last column of its Jacobian has no meaning.
    """
    bodies = tuple(replace(mechanism.bodies[body], parent=k - 1) for k, body in enumerate(chain.bodies))
    last = len(bodies)
    poses = body_poses(replace(mechanism, bodies=bodies, frames=(), coupling=None), q)
    R, p = poses[last - 1]
    if chain.shared:
        R, p = _weighted_sum(place[_WEIGHTS], poses.R), _weighted_sum(place[_WEIGHTS], poses.p)
    axis = np.array([0.0, 0.0, 1.0])
    carrier = Body("", last - 1, True, np.eye(3), np.zeros(3), axis, mechanism.root)
    frame = BodyFrame("", last, place[_ROTATION].reshape(3, 3), place[_POSITION])
    carrying = replace(mechanism, bodies=(*bodies, carrier), frames=(frame,), coupling=None)
    return carrying, Poses((*poses.R, R), (*poses.p, p))


def _weighted_sum(weights: Array, terms: tuple[Array, ...]) -> Array:
    """Return the term whose weight is 1."""
    return np.asarray(sum(weight * term for weight, term in zip(weights, terms, strict=True)))


@dataclass(frozen=True)
class _ReferenceAxes:
    """The axes and the origin of the reference of a place (Featherstone 2008, section 2.8).

    `R` maps vectors from the world's axes to those of the reference; `p` is the position of the frame
    relative to the reference's origin, zero except in `world`; `rotates` is 1 if the axes rotate with the
    frame, `fixed` is 1 if the origin is that of the world.
    """

    R: Array
    p: Array
    rotates: Array
    fixed: Array

    @classmethod
    def of(cls, place: Array, R: Array, p: Array) -> _ReferenceAxes:
        """Make the axes for a frame at (R, p) in the world."""
        local, world = place[_LOCAL], place[_WORLD]
        return cls(local * R.T + (1.0 - local) * np.eye(3), world * p, local, world)

    def motion(self, x: Array) -> Array:
        """Transform twists (6,) or (6, n) of the frame from `local_world_aligned`."""
        return np.concatenate([self.R @ (x[:3] + skew(self.p) @ x[3:]), self.R @ x[3:]])

    def rate(self, x: Array, dx: Array, twist: Array) -> Array:
        """Return the time derivative of `motion(x)`; `dx` is the time derivative of `x`, and `twist` the
        velocity of the frame."""
        omega = skew(self.rotates * twist[3:])
        linear = dx[:3] - omega @ x[:3] + skew(self.p) @ dx[3:] + skew(self.fixed * twist[:3]) @ x[3:]
        return np.concatenate([self.R @ linear, self.R @ (dx[3:] - omega @ x[3:])])
