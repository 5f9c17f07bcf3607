"""Momentum and energy of the bodies of a scene, from their states."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dynx.spatial.scalar import Floats
from dynx.world import Scene, WorldState


def linear_momentum(scene: Scene, state: WorldState) -> Floats:
    """Return the momentum (3,) of all bodies that move [kg m/s]."""
    total: Floats = np.zeros(3)
    for mass, _, velocity, _, _ in _moving_bodies(scene, state):
        total += mass * velocity
    return total


def angular_momentum(scene: Scene, state: WorldState) -> Floats:
    """Return the angular momentum (3,) of all bodies that move about their common centre of mass
    [kg m^2/s]."""
    total, center, momentum, mass = np.zeros(3), np.zeros(3), np.zeros(3), 0.0
    for m, position, velocity, spin, inertia in _moving_bodies(scene, state):
        total += m * np.cross(position, velocity) + inertia @ spin
        center += m * position
        momentum += m * velocity
        mass += m
    about: Floats = total - np.cross(center, momentum) / mass
    return about


def kinetic_energy(scene: Scene, state: WorldState) -> float:
    """Return the kinetic energy of all bodies that move, in the frame of their common centre of mass [J]."""
    total, momentum, mass = 0.0, np.zeros(3), 0.0
    for m, _, velocity, spin, inertia in _moving_bodies(scene, state):
        total += 0.5 * m * float(velocity @ velocity) + 0.5 * float(spin @ inertia @ spin)
        momentum += m * velocity
        mass += m
    return total - 0.5 * float(momentum @ momentum) / mass


def _moving_bodies(scene: Scene, state: WorldState) -> Iterator[tuple[float, Floats, Floats, Floats, Floats]]:
    """Yield mass, centre of mass, its velocity, angular velocity and inertia about it, in world axes."""
    for body in scene.bodies:
        if body.fixed:
            continue
        inertial = body.inertial
        T, twist = state.bodies[body.name]
        R, lever = T[:3, :3], T[:3, :3] @ np.array(inertial.origin.xyz)
        tensor = inertial.tensor
        yield (
            inertial.mass,
            T[:3, 3] + lever,
            twist[:3] + np.cross(twist[3:], lever),
            twist[3:],
            R @ tensor @ R.T,
        )
