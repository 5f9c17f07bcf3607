"""Forward dynamics: the articulated-body algorithm (Featherstone 2008, table 7.1).

Accelerations are those of origins less gravity, as in `dynx.rbd.rnea`, and an articulated inertia is
three blocks of which two are symmetric, so that half of each needs no computing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynx.model.mechanism import ROOT, Body, Mechanism
from dynx.rbd.kinematics import joint_value
from dynx.rbd.linear import solve_positive
from dynx.rbd.placement import Pair, Placement
from dynx.rbd.rnea import body_wrench, carried, root_motion, summed
from dynx.spatial.inertia import RigidInertia, mirrored
from dynx.spatial.scalar import Array, along
from dynx.spatial.so3 import rotate, rotate_back, skew


@dataclass(frozen=True)
class ArticulatedInertia:
    """What force and moment an acceleration of a body takes when the joints beyond it give way.

    f = M d + C w', n = C' d + J w', with M and J symmetric, about the origin of the body.
    """

    M: Array
    C: Array
    J: Array

    @classmethod
    def of(cls, inertia: RigidInertia) -> ArticulatedInertia:
        """That of a rigid body alone: M = m 1, C = -[h], J = I."""
        H = skew(inertia.first_moment)
        return cls(np.eye(3, dtype=int) * inertia.mass + 0 * H, -H, inertia.second_moment + 0 * H)

    def __add__(self, other: ArticulatedInertia) -> ArticulatedInertia:
        return ArticulatedInertia(self.M + other.M, self.C + other.C, self.J + other.J)

    def times(self, linear: Array, angular: Array) -> Pair:
        """Force and moment that an acceleration takes."""
        force = rotate(self.M, linear) + rotate(self.C, angular)
        return force, rotate_back(self.C, linear) + rotate(self.J, angular)

    def yielding(self, U: Pair, K: Pair, kept: Pair) -> ArticulatedInertia:
        """Less what a joint gives way: U K', where U = I S and K = U / (S' U).

        Nothing is left along the joint; `kept` is 0 there and 1 elsewhere, so that it need not be found.
        """
        (f, n), (kf, kn), (one_f, one_n) = U, K, kept
        return ArticulatedInertia(
            mirrored((self.M - _outer(f, kf)) * _outer(one_f, one_f)),
            (self.C - _outer(f, kn)) * _outer(one_f, one_n),
            mirrored((self.J - _outer(n, kn)) * _outer(one_n, one_n)),
        )

    def of_parent(self, placement: Placement) -> ArticulatedInertia:
        """The same about the parent's origin and in its axes."""
        shift = skew(placement.p)
        M, C, J = placement.symmetric(self.M), placement.similar(self.C), placement.symmetric(self.J)
        moved = C - M @ shift
        lever = shift @ C
        return ArticulatedInertia(M, moved, mirrored(J + shift @ moved + np.swapaxes(lever, -1, -2)))

    def matrix(self) -> Array:
        """As one (..., 6, 6), linear first."""
        # Parts that no joint turns come without the batch.
        M, C, J = np.broadcast_arrays(self.M, self.C, self.J)
        top = np.concatenate([M, C], axis=-1)
        below = np.concatenate([np.swapaxes(C, -1, -2), J], axis=-1)
        return np.concatenate([top, below], axis=-2)


def forward_dynamics(mechanism: Mechanism, q: Array, v: Array, tau: Array) -> Array:
    """The acceleration (..., nv) that `tau` (..., nv) gives, in tree coordinates.

    A joint that moves no inertia divides by zero.
    """
    bodies, nothing = mechanism.bodies, 0 * v
    root = root_motion(mechanism, q, v, nothing)
    motions, placements, products = [root.coasting()], [], []
    for index, body in enumerate(bodies):
        placement = Placement.of(body, joint_value(mechanism, q, index))
        speed = joint_value(mechanism, v, index)
        # What the body accelerates by if its parent and its joint do not.
        product = carried(body, placement, motions[body.parent + 1], speed, 0 * speed)
        placements.append(placement)
        products.append((product.proper, product.change))
        motions.append(product.coasting())

    inertias = [mechanism.root, *(body.inertia for body in bodies)]
    articulated = [ArticulatedInertia.of(inertia) for inertia in inertias]
    bias = [body_wrench(inertia, motion) for inertia, motion in zip(inertias, motions, strict=True)]
    reach: dict[int, tuple[Pair, Array]] = {}
    for index in reversed(range(len(bodies))):
        body, A = bodies[index], articulated[index + 1]
        S = _subspace(body.axis, body.revolute)
        U, (force, moment) = A.times(*S), bias[index + 1]
        D = _product(S, U)
        kept = _others(body)
        # K is 1 along the joint.
        force_of, moment_of = (part / along(D) * keep for part, keep in zip(U, kept, strict=True))
        K = (force_of + S[0] * (1 - kept[0]), moment_of + S[1] * (1 - kept[1]))
        u = joint_value(mechanism, tau, index) - _product(S, (force, moment))
        reach[index] = (K, u / D)
        handed = A.yielding(U, K, kept)
        given = K[0] * along(u), K[1] * along(u)
        wrench = summed(summed((force, moment), handed.times(*products[index])), given)
        parent, placement = body.parent + 1, placements[index]
        articulated[parent] = articulated[parent] + handed.of_parent(placement)
        bias[parent] = summed(bias[parent], placement.wrench_of_parent(*wrench))

    if mechanism.floating:
        found = solve_positive(articulated[0].matrix(), tau[..., :6] - np.concatenate(bias[0], axis=-1))
        accelerations: list[Pair] = [(found[..., :3], found[..., 3:])]
    else:
        accelerations = [(root.proper, root.change)]
    a: list[Array] = []
    for index, body in enumerate(bodies):
        moved = placements[index].motion_of_child(*accelerations[body.parent + 1])
        linear, angular = summed(moved, products[index])
        K, relative = reach[index]
        joint = relative - _product(K, (linear, angular))
        a.append(joint)
        S = _subspace(body.axis, body.revolute)
        accelerations.append((linear + S[0] * along(joint), angular + S[1] * along(joint)))
    if mechanism.floating:
        # The root's motion had a = 0, so `proper` is what gravity and the turning of its axes add.
        linear, angular = accelerations[ROOT + 1]
        return np.concatenate([linear - root.proper, angular, *(along(x) for x in a)], axis=-1)
    return np.stack(a, axis=-1) if a else np.zeros(v.shape)


def inertia_matrix(inertia: RigidInertia) -> Array:
    """Spatial inertia (..., 6, 6), linear first: [[m 1, -[h]], [[h], I]]."""
    return ArticulatedInertia.of(inertia).matrix()


def _subspace(axis: Array, revolute: bool) -> Pair:
    still = 0 * axis
    return (still, axis) if revolute else (axis, still)


def _others(body: Body) -> Pair:
    """1 for every coordinate but that which is the joint's own, if one is."""
    alone = body.axis != 0 if np.count_nonzero(body.axis) == 1 else np.zeros(3, dtype=bool)
    rest, all_three = 1 - alone.astype(int), np.ones(3, dtype=int)
    return (all_three, rest) if body.revolute else (rest, all_three)


def _product(a: Pair, b: Pair) -> Array:
    return np.asarray(np.sum(a[0] * b[0] + a[1] * b[1], axis=-1))


def _outer(a: Array, b: Array) -> Array:
    return np.asarray(a[..., :, None] * b[..., None, :])
