"""Quantities of frames, written so that one kernel serves all frames of a chain of bodies.

A *chain* is the bodies on the way from the root to one of them. Where a frame sits is an input of its
chain's kernel, the *place*, which is the same for every sample of a call: the frame's pose in its
body, the reference, and for the root and each body of the chain a *share*, 1 for the body that the
frame is fixed to and 0 for the others. What differs from body to body is summed over the chain with
the shares as weights; all but one of them are zero, so the sum is exact.

The Jacobian in `local_world_aligned`, which is asked for more than all others, has a kernel for each
body, without shares.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dynx.model.mechanism import ROOT, Body, BodyFrame, Mechanism
from dynx.rbd.jacobians import (
    LOCAL_WORLD_ALIGNED,
    Reference,
    frame_jacobian,
    frame_jacobian_derivative,
)
from dynx.rbd.kinematics import Poses, ancestry, body_poses, frame_pose
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.so3 import skew

_POSITION, _ROTATION, _LOCAL, _WORLD, _SHARES = slice(0, 3), slice(3, 12), 12, 13, slice(14, None)
"""Where a place holds what. Of the two references at most one is 1; none for `local_world_aligned`."""


@dataclass(frozen=True)
class Chain:
    """Bodies from the root outwards, each carried by the one before it.

    With `shared`, the kernel serves frames on all of them and on the root, in every reference; without,
    those on the last body (on the root if there is none), in `local_world_aligned`.
    """

    bodies: tuple[int, ...]
    shared: bool

    @property
    def place_size(self) -> int:
        """Numbers of a place."""
        return _SHARES.start + (len(self.bodies) + 1 if self.shared else 0)


def chain_of(mechanism: Mechanism, quantity: str, frame: int, reference: Reference) -> Chain:
    """The chain whose kernel answers a question about frame number `frame`."""
    body = mechanism.frames[frame].body
    shared = quantity != "jacobian" or reference != LOCAL_WORLD_ALIGNED
    if shared:
        # Bodies are in depth-first order: the first that a body carries comes right after it.
        while body + 1 < len(mechanism.bodies) and mechanism.bodies[body + 1].parent == body:
            body += 1
    return Chain(tuple(reversed(ancestry(mechanism, body))), shared)


def place_of(mechanism: Mechanism, chain: Chain, frame: int, reference: Reference) -> Floats:
    """The place (place_size,) of frame number `frame`, asked for in `reference`."""
    fixed = mechanism.frames[frame]
    place = np.zeros(chain.place_size)
    place[_POSITION], place[_ROTATION] = fixed.p, fixed.R.ravel()
    place[_LOCAL], place[_WORLD] = reference == "local", reference == "world"
    if chain.shared:
        place[_SHARES] = [fixed.body == body for body in (ROOT, *chain.bodies)]
    return place


def on_chain(
    mechanism: Mechanism, quantity: str, chain: Chain, place: Array, q: Array, *rates: Array
) -> Array:
    """A quantity of the frame at `place` for one sample, in tree coordinates.

    q (nq,), rates (nv,) and place hold numbers or symbols. Quantities are ``jacobian``,
    ``jacobian_derivative``, ``frame_velocity`` and ``frame_acceleration``.
    """
    base_q, base_v = (7, 6) if mechanism.floating else (0, 0)
    own_q = [*range(base_q), *(base_q + body for body in chain.bodies)]
    own_v = [*range(base_v), *(base_v + body for body in chain.bodies)]
    moves = np.ones(len(own_v))
    if chain.shared:
        # A joint moves the frame if that sits on the joint's body or further out.
        shares = place[_SHARES]
        moves = np.array([1.0] * base_v + [np.sum(shares[k:]) for k in range(1, len(shares))])

    def all_columns(own: Array) -> Array:
        columns = np.zeros((6, mechanism.nv), dtype=object)
        columns[:, own_v] = own * moves
        return columns

    carrier, poses = _carrier(mechanism, chain, place, q[own_q])
    J = frame_jacobian(carrier, poses, 0, LOCAL_WORLD_ALIGNED)[:, :-1]
    if not chain.shared:
        return all_columns(J)
    axes = _Axes.of(place, *frame_pose(carrier, poses, 0))
    if quantity == "jacobian":
        return all_columns(axes.motion(J))
    v, *a = [rate[own_v] * moves for rate in rates]
    twist = J @ v
    if quantity == "frame_velocity":
        return axes.motion(twist)
    dJ = frame_jacobian_derivative(carrier, poses, np.append(v, 0.0), 0, LOCAL_WORLD_ALIGNED)[:, :-1]
    if quantity == "jacobian_derivative":
        return all_columns(axes.rate(J, dJ, twist))
    return axes.rate(twist, J @ a[0] + dJ @ v, twist)


def _carrier(mechanism: Mechanism, chain: Chain, place: Array, q: Array) -> tuple[Mechanism, Poses]:
    """The bodies of the chain and one more, the carrier, which has the frame as the only one.

    The carrier is where the body is that the frame is fixed to. It hangs on the last body, by a joint
    without motion: the last column of its Jacobian means nothing.
    """
    bodies = tuple(replace(mechanism.bodies[body], parent=k - 1) for k, body in enumerate(chain.bodies))
    last = len(bodies)
    poses = body_poses(replace(mechanism, bodies=bodies, frames=(), coupling=None), q)
    R, p = poses[last - 1]
    if chain.shared:
        R, p = _shared(place[_SHARES], poses.R), _shared(place[_SHARES], poses.p)
    axis = np.array([0.0, 0.0, 1.0])
    carrier = Body("", last - 1, True, np.eye(3), np.zeros(3), axis, mechanism.root)
    frame = BodyFrame("", last, place[_ROTATION].reshape(3, 3), place[_POSITION])
    carrying = replace(mechanism, bodies=(*bodies, carrier), frames=(frame,), coupling=None)
    return carrying, Poses((*poses.R, R), (*poses.p, p))


def _shared(shares: Array, each: tuple[Array, ...]) -> Array:
    """The one of `each` whose share is 1."""
    return np.asarray(sum(share * one for share, one in zip(shares, each, strict=True)))


@dataclass(frozen=True)
class _Axes:
    """The reference of a place: its axes (Featherstone 2008, section 2.8), and where its origin is.

    `R` turns the world's axes into those of the reference; `p` is the way from the reference's origin
    to the frame's, zero unless that is the world's; `turns` is 1 if the axes turn with the frame.
    """

    R: Array
    p: Array
    turns: Array
    stays: Array

    @classmethod
    def of(cls, place: Array, R: Array, p: Array) -> _Axes:
        """Those of a frame at (R, p) in the world."""
        local, world = place[_LOCAL], place[_WORLD]
        return cls(local * R.T + (1.0 - local) * np.eye(3), world * p, local, world)

    def motion(self, x: Array) -> Array:
        """Motions (6,) or (6, n) of the frame given in `local_world_aligned`."""
        return np.concatenate([self.R @ (x[:3] + skew(self.p) @ x[3:]), self.R @ x[3:]])

    def rate(self, x: Array, dx: Array, twist: Array) -> Array:
        """The time derivatives of `motion`, given `x` and its own, while the frame moves with `twist`."""
        turning = skew(self.turns * twist[3:])
        linear = dx[:3] - turning @ x[:3] + skew(self.p) @ dx[3:] + skew(self.stays * twist[:3]) @ x[3:]
        return np.concatenate([self.R @ linear, self.R @ (dx[3:] - turning @ x[3:])])
