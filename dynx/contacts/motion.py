"""Scenes of the cases, motions of their bodies recorded step by step, and closed forms of impacts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from dynx.model import Pose
from dynx.model.geometry import Box, Collision, Cylinder, Shape, Sphere
from dynx.model.tree import STANDARD_GRAVITY
from dynx.spatial.scalar import Floats
from dynx.world import Material, Scene, SceneBody, World, WorldState, ground, sphere


@dataclass(frozen=True, eq=False)
class RecordedMotion:
    """States of a world after every step, the first of them before the first step."""

    times: Floats
    """Times (n,) [s]."""
    states: tuple[WorldState, ...]

    def positions(self, body: str) -> Floats:
        """Return the origin (n, 3) of the frame of a body [m]."""
        return np.array([state.bodies[body].T_world_body[:3, 3] for state in self.states])

    def rotations(self, body: str) -> Floats:
        """Return the rotation matrices (n, 3, 3) of a body."""
        return np.array([state.bodies[body].T_world_body[:3, :3] for state in self.states])

    def velocities(self, body: str) -> Floats:
        """Return linear [m/s] and angular [rad/s] velocities (n, 6) of a body, in world axes."""
        return np.array([state.bodies[body].twist for state in self.states])


def record(world: World, duration: float, **loads: Any) -> RecordedMotion:
    """Take steps for `duration` [s], during which `loads` act (arguments of `World.step`); return the
    motion."""
    states = [world.state]
    for _ in range(step_count(world, duration)):
        world.step(**loads)
        states.append(world.state)
    return RecordedMotion(np.array([state.time for state in states]), tuple(states))


def step_count(world: World, duration: float) -> int:
    """Return the number of steps of a world that is nearest to `duration` [s], at least 1."""
    return max(1, round(duration / world.dt))


def mean_contact_force(world: World, part: str) -> Floats:
    """Return the mean (3,) of the contact forces on a part over the world's `contact_interval` [N]."""
    total: Floats = np.zeros(3)
    for contact in world.mean_contacts(part):
        total += contact.force if contact.a == part else -contact.force
    return total


def acceleration(times: Floats, velocities: Floats) -> float:
    """Return the slope of the straight line through velocities over time (least squares)."""
    centred = times - times.mean()
    return float(centred @ velocities / (centred @ centred))


def tilts(rotations: Floats) -> Floats:
    """Return the angles (n,) [rad] of rotations (n, 3, 3) about the y axis."""
    return np.asarray(np.arctan2(rotations[:, 0, 2], rotations[:, 2, 2]))


def rate_at(angle: float, angles: Floats, rates: Floats) -> float:
    """Return the rate where angles (n,) first exceed `angle`, by linear interpolation; 0 if none does, or the
    first one already does."""
    after = int(np.argmax(angles > angle))
    return (
        float(np.interp(angle, angles[after - 1 : after + 1], rates[after - 1 : after + 1])) if after else 0.0
    )


G = -STANDARD_GRAVITY[2]
"""Magnitude of gravity [m/s^2]."""


def body_of(shape: Shape, name: str, position: tuple[float, float, float], mass: float) -> SceneBody:
    """Return a body of one shape, with the default material."""
    return SceneBody(name, (Collision(shape),), Pose(position), mass)


def resting_bodies() -> Scene:
    """Return a box, a ball and an upright cylinder of 2 kg and a height of 0.2 m, which touch the ground."""
    bodies = (
        body_of(Box((0.4, 0.4, 0.2)), "box", (0.0, 0.0, 0.1), 2.0),
        body_of(Sphere(0.1), "ball", (1.0, 0.0, 0.1), 2.0),
        body_of(Cylinder(0.1, 0.2), "cylinder", (0.0, 1.0, 0.1), 2.0),
    )
    return Scene("resting", bodies=(ground(), *bodies))


def ball_name(number: int) -> str:
    """Return the name of a ball of `balls_above`."""
    return f"ball {number}"


def balls_above(
    radius: float,
    heights: Sequence[float],
    material: Material,
    *,
    spacing: tuple[float, float] = (0.5, 0.0),
    twist: Sequence[float] = (0.0,) * 6,
) -> list[SceneBody]:
    """Return a row of balls of 1 kg, each at the height of its lowest point [m].

    `spacing` is the distance from one ball to the next along x and y [m]; all start with `twist` (6,).
    """
    dx, dy = spacing
    return [
        sphere(
            ball_name(k),
            radius,
            mass=1.0,
            pose=Pose((k * dx, k * dy, radius + height)),
            twist=twist,
            material=material,
        )
        for k, height in enumerate(heights)
    ]


def slope_axes(angle: float) -> tuple[Floats, Floats]:
    """Return the unit vectors (3,) down a slope of that angle [rad], and normal to it."""
    down = np.array([math.cos(angle), 0.0, -math.sin(angle)])
    return down, np.array([math.sin(angle), 0.0, math.cos(angle)])


def inclined(angle: float, position: Floats | None = None) -> Pose:
    """Return the pose at a position (3,) with x down a slope of that angle [rad] and z normal to it."""
    x, y, z = (0.0, 0.0, 0.0) if position is None else position.tolist()
    return Pose((x, y, z), (0.0, angle, 0.0))


CONTACT_DELAYS = tuple(0.8e-3 * k for k in range(5))
"""Delays [s] of bodies that touch at different moments, evenly spaced within steps of 4, 2 and 1 ms."""


def farthest(measured: Iterable[float], exact: float) -> float:
    """Return that one of several values which is farthest from the exact value."""
    return max(measured, key=lambda value: abs(value - exact))


def rms_deviation(measured: Sequence[float], exact: float) -> float:
    """Return the root mean square of the errors of several values."""
    return math.sqrt(sum((value - exact) ** 2 for value in measured) / len(measured))


def speeds_after_collision(
    m1: float, m2: float, v1: float, v2: float, restitution: float
) -> tuple[float, float]:
    """Return the speeds of two bodies after a central impact: momentum is conserved, and the bodies separate
    at the speed of their approach times the restitution."""
    center = (m1 * v1 + m2 * v2) / (m1 + m2)
    impulse = restitution * (v1 - v2) * m1 * m2 / (m1 + m2)
    return center - impulse / m1, center + impulse / m2


class Throw(NamedTuple):
    """A ball that meets the ground, with the coefficients of the impact."""

    speed: float
    """Speed along the ground [m/s]."""
    backspin: float
    """Speed at which backspin moves the lowest point of the surface forward, relative to the centre [m/s]."""
    fall: float
    """Speed towards the ground [m/s]."""
    friction: float
    restitution: float

    @property
    def slips(self) -> bool:
        """True if the ball still slips when it leaves the ground."""
        return self.friction * (1.0 + self.restitution) * self.fall < self.sticking_impulse

    @property
    def sticking_impulse(self) -> float:
        """Impulse of friction per mass that ends the slip [m/s]: 2/7 of the slip, for the moment of inertia
        2/5 m r^2 of a homogeneous ball."""
        return 2.0 / 7.0 * abs(self.speed + self.backspin)


def after_bounce(throw: Throw) -> tuple[float, float]:
    """Return the speed along the ground and the backspin [m/s] of a homogeneous ball after an impact.

    The normal impulse per mass is (1 + e) times the speed of the fall. Friction opposes the slip of the
    lowest point, in proportion to the normal impulse, until the slip is zero.
    """
    impulse = min(throw.friction * (1.0 + throw.restitution) * throw.fall, throw.sticking_impulse)
    impulse = math.copysign(impulse, throw.speed + throw.backspin)
    return throw.speed - impulse, throw.backspin - 2.5 * impulse
