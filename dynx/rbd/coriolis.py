"""The Coriolis matrix for which dM/dt - 2 C is skew-symmetric, in as many steps as a mass matrix takes.

C v + g is the bias for infinitely many matrices C. The one meant here is

    C = integral of J' dJ/dt over the mass of the robot,

where J v is the velocity of a particle. On a fixed base it is the matrix of Christoffel symbols.
Integrated over rigid bodies it is eq. 24 of Echeandia and Wensing, Numerical Methods to Compute the
Coriolis Matrix and Christoffel Symbols for Rigid-Body Systems, 2021:

    C = sum over bodies of J' (I dJ/dt + B J),   B = (v x* I - I v x + (I v) x~*) / 2.

As in their algorithm, the I and B of all that a joint carries are summed first; what they make of the
joint's motion is then handed down to the root, and every joint on the way takes its two entries from it.

Other than there, all is in the coordinates of the body that the joint moves, and velocities are relative
to that of the body's origin: C depends neither on the place nor on the speed of the robot as a whole,
which then cannot cost digits. With r counted from the origin, B takes the motion l + e x r to the force
e x f and the moment E e, where

    f = integral of dr/dt,   E = integral of -[r] [dr/dt]:

f is the rate of the first moment, and E + E' that of the second.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dynx.model.mechanism import ROOT, Mechanism
from dynx.rbd.kinematics import Poses, ancestry, joint_value
from dynx.rbd.placement import Placement
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array, along
from dynx.spatial.so3 import cross, rotate, rotate_back, skew


def coriolis_matrix(mechanism: Mechanism, poses: Poses, v: Array) -> Array:
    """C (..., nv, nv) in tree coordinates, from the poses of all bodies."""
    placements = []
    for index, body in enumerate(mechanism.bodies):
        (R_parent, p_parent), (R, p) = poses[body.parent], poses[index]
        R_joint = _transposed(R_parent) @ R
        placements.append(Placement(R_joint, rotate_back(R_parent, p - p_parent), R_joint, None))
    return _matrix(mechanism, placements, v)


def coriolis_matrix_at(mechanism: Mechanism, q: Array, v: Array) -> Array:
    """The same from the tree configuration (..., nq), in fewer operations."""
    bodies = enumerate(mechanism.bodies)
    return _matrix(mechanism, [Placement.of(body, joint_value(mechanism, q, k)) for k, body in bodies], v)


@dataclass(frozen=True)
class _Step:
    """From a body to its parent: its pose there, and the velocity of its origin."""

    placement: Placement
    dp: Array

    @property
    def R(self) -> Array:
        """Rotation from the axes of the body to those of the parent."""
        return self.placement.R

    @cached_property
    def lever(self) -> Array:
        """[p]."""
        return skew(self.placement.p)

    @cached_property
    def lever_rate(self) -> Array:
        """[dp/dt]."""
        return skew(self.dp)


@dataclass(frozen=True)
class _Motion:
    """Velocity fields `linear` + `angular` x r that belong to unit speed of the coordinates `numbers`.

    They and their rates are columns (..., 3, d) in the coordinates of the body that these move.
    """

    numbers: range
    linear: Array
    angular: Array
    linear_rate: Array
    angular_rate: Array


@dataclass(frozen=True)
class _Response:
    """What motions do to the matter that they move: columns (..., 3, d), integrals over the mass.

    For the velocity field u of a column: of u and r x u, of du/dt and r x du/dt, and of dr/dt x u.
    """

    momentum: Array
    spin: Array
    force: Array
    moment: Array
    couple: Array

    def seen_from_parent(self, step: _Step) -> _Response:
        """The same about the origin of the parent, and relative to its velocity."""
        momentum, force = step.R @ self.momentum, step.R @ self.force
        return _Response(
            momentum=momentum,
            spin=step.R @ self.spin + step.lever @ momentum,
            force=force,
            moment=step.R @ self.moment + step.lever @ force,
            couple=step.R @ self.couple + step.lever_rate @ momentum,
        )

    def along(self, motion: _Motion) -> tuple[Array, Array]:
        """C in the rows of `motion` and the columns of this response, and the other way round."""
        forward = _transposed(motion.linear) @ self.force + _transposed(motion.angular) @ self.moment
        backward = (
            _transposed(self.momentum) @ motion.linear_rate
            + _transposed(self.spin) @ motion.angular_rate
            + _transposed(self.couple) @ motion.angular
        )
        return np.asarray(forward), np.asarray(backward)


@dataclass(frozen=True)
class _Composite:
    """The matter that a body carries, itself included: its inertia, f (..., 3) and E (..., 3, 3)."""

    inertia: RigidInertia
    f: Array
    E: Array

    def __add__(self, other: _Composite) -> _Composite:
        return _Composite(self.inertia + other.inertia, self.f + other.f, self.E + other.E)

    def seen_from_parent(self, step: _Step) -> _Composite:
        """The same about the origin of the parent, and relative to its velocity."""
        inertia, f = step.placement.inertia_of_parent(self.inertia), rotate(step.R, self.f)
        E = step.placement.similar(self.E) - step.lever @ skew(f)
        E = E - skew(inertia.first_moment) @ step.lever_rate
        return _Composite(inertia, f + step.dp * inertia.mass, np.asarray(E))

    def response(self, motion: _Motion) -> _Response:
        """To the motions of the body itself."""
        mass, J = self.inertia.mass, self.inertia.second_moment
        H, F = skew(self.inertia.first_moment), skew(self.f)
        u, e, du, de = motion.linear, motion.angular, motion.linear_rate, motion.angular_rate
        return _Response(
            momentum=u * mass - H @ e,
            spin=H @ u + J @ e,
            force=du * mass - H @ de - F @ e,
            moment=H @ du + J @ de + self.E @ e,
            couple=F @ u + _transposed(self.E) @ e,
        )


def _matrix(mechanism: Mechanism, placements: Sequence[Placement], v: Array) -> Array:
    turning, steps = _turning_and_steps(mechanism, placements, v)
    moving = range(ROOT if mechanism.floating else 0, len(mechanism.bodies))
    carried = {body: _alone(mechanism, body, turning[body]) for body in moving}
    for body in reversed(range(len(mechanism.bodies))):
        parent = mechanism.bodies[body].parent
        if parent in carried:
            carried[parent] = carried[parent] + carried[body].seen_from_parent(steps[body])

    nothing = 0 * np.sum(v, axis=-1)
    C = [[nothing] * mechanism.nv for _ in range(mechanism.nv)]
    motions = {body: _own_motion(mechanism, body, turning[body]) for body in moving}
    for body in moving:
        response = carried[body].response(motions[body])
        carriers = ancestry(mechanism, body) + ([ROOT] if mechanism.floating else [])
        for carrier in carriers:
            forward, backward = response.along(motions[carrier])
            for i, row in enumerate(motions[carrier].numbers):
                for j, column in enumerate(motions[body].numbers):
                    C[row][column] = forward[..., i, j]
                    if carrier != body:
                        C[column][row] = backward[..., j, i]
            if carrier != carriers[-1]:
                response = response.seen_from_parent(steps[carrier])
    if not C:
        return np.zeros((*v.shape[:-1], 0, 0))
    entries = np.broadcast_arrays(*(np.asarray(entry) for row in C for entry in row))
    answer = np.stack(entries, axis=-1)
    return answer.reshape(*answer.shape[:-1], mechanism.nv, mechanism.nv)


def _turning_and_steps(
    mechanism: Mechanism, placements: Sequence[Placement], v: Array
) -> tuple[dict[int, Array], list[_Step]]:
    """The angular velocity of every body in its own axes, and the steps from bodies to their parents."""
    turning = {ROOT: v[..., 3:6] if mechanism.floating else 0 * mechanism.gravity}
    steps = []
    for index, (body, placement) in enumerate(zip(mechanism.bodies, placements, strict=True)):
        R = placement.R
        speed = body.axis * along(joint_value(mechanism, v, index))
        dp = cross(turning[body.parent], placement.p)
        turning[index] = rotate_back(R, turning[body.parent])
        if body.revolute:
            turning[index] = turning[index] + speed
        else:
            dp = dp + rotate(R, speed)
        steps.append(_Step(placement, dp))
    return turning, steps


def _alone(mechanism: Mechanism, body: int, w: Array) -> _Composite:
    """A rigid body with nothing on it, where dr/dt = w x r."""
    inertia = mechanism.root if body == ROOT else mechanism.bodies[body].inertia
    return _Composite(inertia, cross(w, inertia.first_moment), -skew(w) @ inertia.spread)


def _own_motion(mechanism: Mechanism, body: int, w: Array) -> _Motion:
    """Of a joint, its axis; of a floating base, the axes of its frame."""
    if body == ROOT:
        numbers, axes = range(6), np.eye(3, dtype=int)
        linear, angular = (np.concatenate(pair, axis=-1) for pair in ((axes, 0 * axes), (0 * axes, axes)))
    else:
        first = mechanism.nv - len(mechanism.bodies) + body
        numbers, axis = range(first, first + 1), mechanism.bodies[body].axis[..., None]
        linear, angular = (0 * axis, axis) if mechanism.bodies[body].revolute else (axis, 0 * axis)
    return _Motion(numbers, linear, angular, skew(w) @ linear, skew(w) @ angular)


def _transposed(A: Array) -> Array:
    return np.swapaxes(A, -1, -2)
