"""Momentum of bodies that collide in free fall."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import ClassVar

import numpy as np

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.motion import record
from dynx.model import Pose
from dynx.model.geometry import Box, Capsule, Collision, Cylinder, Shape, Sphere
from dynx.spatial.scalar import Floats
from dynx.world import Material, Scene, SceneBody, World, WorldState


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


DURATION = 0.5

BODIES: tuple[tuple[str, Shape, float, tuple[float, float, float], tuple[float, ...]], ...] = (
    ("box", Box((0.2, 0.3, 0.2)), 2.0, (-0.4, 0.02, 0.0), (1.5, 0.0, 0.0, 0.0, 1.0, 2.0)),
    ("ball", Sphere(0.12), 1.0, (0.4, -0.03, 0.04), (-1.5, 0.1, 0.0, 3.0, 0.0, 0.0)),
    ("capsule", Capsule(0.08, 0.2), 1.0, (0.03, 0.45, 0.0), (0.0, -2.0, 0.1, 0.0, 0.0, 1.0)),
    ("cylinder", Cylinder(0.1, 0.2), 3.0, (0.02, -0.5, -0.05), (0.2, 1.0, 0.0, 1.0, 0.0, 0.0)),
)
"""Name, shape, mass [kg], position [m] and twist of each body."""


class FreeMomentum(ContactCase):
    """Four rotating bodies that collide with one another, with friction, and with nothing else."""

    name: ClassVar[str] = "free_momentum"
    title: ClassVar[str] = "Momentum of bodies that collide in free fall"
    law: ClassVar[str] = (
        "p(t) = p(0) + M g t and L(t) = L(0), for momentum p and angular momentum L about the centre of mass "
        "of bodies of total mass M; the kinetic energy in the falling frame does not grow"
    )
    source: ClassVar[str] = "conservation of momentum and angular momentum (Newton's third law)"

    def scene(self, parameters: None) -> Scene:
        material = Material(friction=0.5)
        bodies = tuple(
            SceneBody(name, (Collision(shape),), Pose(position), mass, twist=twist, material=material)
            for name, shape, mass, position, twist in BODIES
        )
        return Scene("falling bodies", bodies=bodies)

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        scene, begin = world.scene, world.state
        gravity = np.array(scene.gravity)
        motion = record(world, DURATION)
        total = sum(body.inertial.mass for body in scene.bodies)
        changes, turns, energies = [], [], []
        p0, L0, E0 = (
            linear_momentum(scene, begin),
            angular_momentum(scene, begin),
            kinetic_energy(scene, begin),
        )
        for state in motion.states:
            fallen = total * gravity * state.time
            changes.append(float(np.linalg.norm(linear_momentum(scene, state) - p0 - fallen)))
            turns.append(float(np.linalg.norm(angular_momentum(scene, state) - L0)))
            energies.append(kinetic_energy(scene, state) - E0)
        momenta: float = sum(mass * float(np.linalg.norm(twist[:3])) for _, _, mass, _, twist in BODIES)
        return [
            Figure("largest change of momentum", max(changes), 0.0, "kg m/s", momenta, 1e-6),
            Figure("largest change of angular momentum", max(turns), 0.0, "kg m^2/s", 0.5 * momenta),
            Figure("largest gain of energy", max(energies), 0.0, "J", E0),
        ]
