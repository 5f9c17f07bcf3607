"""Centre of mass, its Jacobian, centroidal momentum and energies of the whole robot, in world axes.

Orin, Goswami and Lee, Centroidal dynamics of a humanoid robot, 2013.
"""

from __future__ import annotations

import numpy as np

from dynx.model.mechanism import ROOT, Mechanism
from dynx.rbd.kinematics import Poses, body_twists, joint_axis
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array
from dynx.spatial.so3 import cross, rotate


def center_of_mass(mechanism: Mechanism, poses: Poses) -> Array:
    """Return the centre of mass (..., 3) [m], or the origin of the root if no body has mass."""
    mass, moment = subtree_moments(mechanism, poses)
    if not mechanism.has_mass:
        return np.asarray(poses[ROOT][1] + 0 * moment[0])
    return np.asarray(moment[0] / mass[0])


def center_of_mass_jacobian(mechanism: Mechanism, poses: Poses) -> Array:
    """Return the Jacobian (..., 3, nv) of the centre of mass; each column follows from a joint's subtree."""
    mass, moment = subtree_moments(mechanism, poses)
    total = mass[0] if mechanism.has_mass else mass[0] + 1
    columns = []
    if mechanism.floating:
        R, p = poses[ROOT]
        arm = center_of_mass(mechanism, poses) - p
        columns += [R[..., :, k] + 0 * arm for k in range(3)]
        columns += [cross(R[..., :, k], arm) for k in range(3)]
    for index, body in enumerate(mechanism.bodies):
        z, m = joint_axis(mechanism, poses, index), mass[index + 1]
        momentum = cross(z, moment[index + 1] - poses[index][1] * m) if body.revolute else z * m
        columns.append(momentum / total)
    if not columns:
        return np.zeros((*moment[0].shape[:-1], 3, 0))
    shape = np.broadcast_shapes(*(column.shape for column in columns))
    return np.stack([np.broadcast_to(column, shape) for column in columns], axis=-1)


def centroidal_momentum(mechanism: Mechanism, poses: Poses, v: Array) -> Array:
    """Return linear momentum [kg m/s], then angular momentum about the centre of mass [kg m^2/s] (..., 6)."""
    center = center_of_mass(mechanism, poses)
    total, spin = 0 * center, 0 * center
    for p, momentum, about_origin, _, _ in _body_momenta(mechanism, poses, v):
        total = total + momentum
        spin = spin + about_origin + cross(p - center, momentum)
    return np.concatenate([total, spin], axis=-1)


def kinetic_energy(mechanism: Mechanism, poses: Poses, v: Array) -> Array:
    """Return the sum of the bodies' kinetic energies (...,) [J]."""
    energy = 0 * np.sum(v, axis=-1)
    for _, momentum, spin, linear, angular in _body_momenta(mechanism, poses, v):
        energy = energy + np.sum(momentum * linear, axis=-1) + np.sum(spin * angular, axis=-1)
    return np.asarray(energy / 2)


def potential_energy(mechanism: Mechanism, poses: Poses) -> Array:
    """Return the potential energy -g . (mass times centre of mass) (...,) [J]."""
    _, moment = subtree_moments(mechanism, poses)
    return np.asarray(-np.sum(mechanism.gravity * moment[0], axis=-1))


def subtree_moments(mechanism: Mechanism, poses: Poses) -> tuple[list[Array], list[Array]]:
    """Return mass [kg] and first moment about the world origin [kg m] of each body's subtree, root first."""
    inertias = _inertias(mechanism)
    mass = [inertia.mass for inertia in inertias]
    moment = [
        rotate(R, inertia.first_moment) + p * inertia.mass
        for inertia, R, p in zip(inertias, poses.R, poses.p, strict=True)
    ]
    for index in reversed(range(len(mechanism.bodies))):
        parent = mechanism.bodies[index].parent + 1
        mass[parent] = np.asarray(mass[parent] + mass[index + 1])
        moment[parent] = moment[parent] + moment[index + 1]
    return mass, moment


def _inertias(mechanism: Mechanism) -> list[RigidInertia]:
    return [mechanism.root, *(body.inertia for body in mechanism.bodies)]


def _body_momenta(
    mechanism: Mechanism, poses: Poses, v: Array
) -> list[tuple[Array, Array, Array, Array, Array]]:
    """Return per body: origin, linear momentum, angular momentum about the origin, and the two velocities."""
    twists = body_twists(mechanism, poses, v)
    momenta = []
    for index, inertia in enumerate(_inertias(mechanism)):
        R, p = poses.R[index], poses.p[index]
        linear, angular = twists.linear[index], twists.angular[index]
        in_world = inertia.transform(R, 0 * p)
        momenta.append((p, *in_world.momentum(linear, angular), linear, angular))
    return momenta
