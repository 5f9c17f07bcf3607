"""Coriolis matrix for which dM/dt - 2 C is skew-symmetric, as cheap to compute as the mass matrix.

Infinitely many matrices C satisfy C v + g = bias torque. The one computed here is

    C = integral of J' dJ/dt over the mass of the robot,

where J v is the velocity of a particle. On a fixed base it is the matrix of Christoffel symbols.
Integrated over rigid bodies it is eq. 24 of Echeandia and Wensing, Numerical Methods to Compute the
Coriolis Matrix and Christoffel Symbols for Rigid-Body Systems, 2021:

    C = sum over bodies of J' (I dJ/dt + B J),   B = (v x* I - I v x + (I v) x~*) / 2.

As in their algorithm, I and B of the subtree of each joint are summed first. The response of the subtree to
the motion of the joint is then transformed from body to body towards the root, and every joint on that path
takes its two entries of C from it.

Unlike in their algorithm, all quantities are in the axes of the body that the joint moves, and velocities are
relative to that of the body's origin: C depends neither on the position nor on the velocity of the robot as a
whole, which then cannot cause rounding errors. With r measured from the origin, B maps the twist l + e x r to
the force e x f and the moment E e, where

    f = integral of dr/dt,   E = integral of -[r] [dr/dt]:

f is the time derivative of the first moment of mass, and E + E' that of the rotational inertia.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dynx.model.mechanism import Body, Mechanism
from dynx.rbd.kinematics import Poses
from dynx.rbd.loops import Loops, PythonLoops
from dynx.rbd.placement import Placement
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array, append_axis
from dynx.spatial.so3 import cross, rotate, rotate_back, skew


def coriolis_matrix(mechanism: Mechanism, poses: Poses, v: Array) -> Array:
    """Return C (..., nv, nv) in tree coordinates, from the poses of all bodies."""
    placements = []
    for index, body in enumerate(mechanism.bodies):
        (R_parent, p_parent), (R, p) = poses[body.parent], poses[index]
        R_joint = _transposed(R_parent) @ R
        placements.append(Placement(R_joint, rotate_back(R_parent, p - p_parent), R_joint, None))
    return _matrix(PythonLoops(mechanism), placements, v)


def coriolis_matrix_at(mechanism: Mechanism, q: Array, v: Array, *, loops: Loops | None = None) -> Array:
    """Return C (..., nv, nv) from the tree configuration (..., nq), in fewer operations than from poses."""
    loops = loops or PythonLoops(mechanism)
    return _matrix(loops, loops.each(Placement.of, q), v)


@dataclass(frozen=True)
class ToParent:
    """Transform from a body to its parent: pose, and velocity `dp` of the body's origin in the parent."""

    placement: Placement
    dp: Array

    @property
    def R(self) -> Array:
        """Rotation from the axes of the body to those of the parent."""
        return self.placement.R

    @cached_property
    def lever(self) -> Array:
        """Matrix [p] with [p] b = p x b."""
        return skew(self.placement.p)

    @cached_property
    def lever_rate(self) -> Array:
        """Matrix [dp/dt]."""
        return skew(self.dp)


@dataclass(frozen=True)
class Subspace:
    """Motion subspace: velocity fields `linear` + `angular` x r at unit speed of each of d coordinates.

    They and their time derivatives are columns (..., 3, d) in the axes of the body that moves.
    """

    linear: Array
    angular: Array
    linear_rate: Array
    angular_rate: Array


@dataclass(frozen=True)
class SubtreeResponse:
    """Momenta and forces of a subtree moved by a motion subspace: columns (..., 3, d).

    For the velocity field u of a column, they are the integrals over the mass of u (`momentum`), r x u
    (`angular_momentum`), du/dt (`force`), r x du/dt (`moment`) and dr/dt x u (`couple`).
    """

    momentum: Array
    angular_momentum: Array
    force: Array
    moment: Array
    couple: Array

    def to_parent(self, step: ToParent) -> SubtreeResponse:
        """Return the response about the origin of the parent and relative to its velocity."""
        momentum, force = step.R @ self.momentum, step.R @ self.force
        return SubtreeResponse(
            momentum=momentum,
            angular_momentum=step.R @ self.angular_momentum + step.lever @ momentum,
            force=force,
            moment=step.R @ self.moment + step.lever @ force,
            couple=step.R @ self.couple + step.lever_rate @ momentum,
        )

    def entries(self, subspace: Subspace) -> tuple[Array, Array]:
        """Return the block of C in the rows of `subspace`, columns of this response, and its mirror block."""
        block = _transposed(subspace.linear) @ self.force + _transposed(subspace.angular) @ self.moment
        mirror_block = (
            _transposed(self.momentum) @ subspace.linear_rate
            + _transposed(self.angular_momentum) @ subspace.angular_rate
            + _transposed(self.couple) @ subspace.angular
        )
        return np.asarray(block), np.asarray(mirror_block)


@dataclass(frozen=True)
class Composite:
    """Subtree of a body, itself included: its inertia, f (..., 3) and E (..., 3, 3) (see the module)."""

    inertia: RigidInertia
    f: Array
    E: Array

    @classmethod
    def of_rigid_body(cls, inertia: RigidInertia, w: Array) -> Composite:
        """Return the composite of one rigid body, in which dr/dt = w x r."""
        return cls(inertia, cross(w, inertia.first_moment), -skew(w) @ inertia.second_moment_matrix)

    def __add__(self, other: Composite) -> Composite:
        return Composite(self.inertia + other.inertia, self.f + other.f, self.E + other.E)

    def to_parent(self, step: ToParent) -> Composite:
        """Return the composite about the origin of the parent and relative to its velocity."""
        inertia, f = step.placement.inertia_to_parent(self.inertia), rotate(step.R, self.f)
        E = step.placement.rotate_tensor(self.E) - step.lever @ skew(f)
        E = E - skew(inertia.first_moment) @ step.lever_rate
        return Composite(inertia, f + step.dp * inertia.mass, np.asarray(E))

    def response(self, subspace: Subspace) -> SubtreeResponse:
        """Return the response of the subtree to the motion of its own body."""
        mass, J = self.inertia.mass, self.inertia.rotational_inertia
        H, F = skew(self.inertia.first_moment), skew(self.f)
        u, e, du, de = subspace.linear, subspace.angular, subspace.linear_rate, subspace.angular_rate
        return SubtreeResponse(
            momentum=u * mass - H @ e,
            angular_momentum=H @ u + J @ e,
            force=du * mass - H @ de - F @ e,
            moment=H @ du + J @ de + self.E @ e,
            couple=F @ u + _transposed(self.E) @ e,
        )


def _matrix(loops: Loops, placements: Sequence[Placement], v: Array) -> Array:
    omegas, velocities = loops.outward(_step_to_child, loops.root(_root_omega, v), placements, v)
    steps = loops.combined(ToParent, placements, velocities)
    rigid = [loops.root(_root_composite, omegas[0]), *loops.each(_rigid_composite, omegas)]
    composites = loops.subtrees(_add_composite, rigid, steps)
    base = loops.root(_base_subspace, omegas[0], stored=False)
    of_axes: Sequence[Array] = omegas
    if loops.mechanism.balls:
        of_axes = [omegas[body + 1] for body in loops.mechanism.axis_carriers]
    subspaces = loops.each(_joint_subspace, of_axes, stored=False)
    C = loops.matrices(1, like=v)
    loops.base_block(C, _base_block, composites[0], base)
    loops.to_root(
        C,
        _respond,
        _entries,
        _base_entries,
        own=(composites, subspaces),
        below=(steps,),
        here=(subspaces,),
        at_base=(base,),
    )
    return loops.assembled(C)[0]


def _root_omega(mechanism: Mechanism, v: Array) -> Array:
    return v[..., 3:6] if mechanism.floating else 0 * mechanism.gravity


def _step_to_child(body: Body, omega: Array, placement: Placement, speed: Array) -> tuple[Array, Array]:
    """Return the angular velocity of a body in its own axes, and the velocity of its origin in the parent,
    from the angular velocity `omega` of the parent and the speed (...,) of the joint."""
    R = placement.R
    own = body.axis * append_axis(speed)
    dp = cross(omega, placement.p)
    rotated = rotate_back(R, omega)
    if body.revolute:
        return rotated + own, dp
    return rotated, dp + rotate(R, own)


def _root_composite(mechanism: Mechanism, omega: Array) -> Composite:
    return Composite.of_rigid_body(mechanism.root, omega)


def _rigid_composite(body: Body, omega: Array) -> Composite:
    return Composite.of_rigid_body(body.inertia, omega)


def _add_composite(body: Body, composite: Composite, parent: Composite, step: ToParent) -> Composite:
    return parent + composite.to_parent(step)


def _respond(body: Body, composite: Composite, subspace: Subspace) -> tuple[SubtreeResponse, tuple[Array]]:
    response = composite.response(subspace)
    block, _ = response.entries(subspace)
    return response, (block[..., 0, 0],)


def _entries(
    body: Body, response: SubtreeResponse, step: ToParent, subspace: Subspace
) -> tuple[SubtreeResponse, tuple[Array], tuple[Array]]:
    moved = response.to_parent(step)
    block, mirror_block = moved.entries(subspace)
    return moved, (mirror_block[..., 0, 0],), (block[..., 0, 0],)


def _base_entries(
    response: SubtreeResponse, step: ToParent, base: Subspace
) -> tuple[tuple[Array], tuple[list[Array]]]:
    block, mirror_block = response.to_parent(step).entries(base)
    return (mirror_block[..., 0, :],), ([block[..., k, 0] for k in range(6)],)


def _base_block(mechanism: Mechanism, composite: Composite, base: Subspace) -> tuple[list[Array]]:
    block, _ = composite.response(base).entries(base)
    return ([block[..., k, :] for k in range(6)],)


def _base_subspace(mechanism: Mechanism, w: Array) -> Subspace:
    """Return the motion subspace of a floating base with angular velocity w: the axes of its frame."""
    axes = np.eye(3, dtype=int)
    linear, angular = (np.concatenate(pair, axis=-1) for pair in ((axes, 0 * axes), (0 * axes, axes)))
    return Subspace(linear, angular, skew(w) @ linear, skew(w) @ angular)


def _joint_subspace(body: Body, w: Array) -> Subspace:
    """Return the motion subspace of the joint of a body with angular velocity w."""
    axis = body.axis[..., None]
    linear, angular = (0 * axis, axis) if body.revolute else (axis, 0 * axis)
    return Subspace(linear, angular, skew(w) @ linear, skew(w) @ angular)


def _transposed(A: Array) -> Array:
    return np.swapaxes(A, -1, -2)
