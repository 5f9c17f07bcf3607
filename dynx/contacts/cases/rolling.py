"""Bodies that roll: without slipping, from sliding on, and slowed by rolling friction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.motion import G, acceleration, inclined, record, slope_axes, step_count
from dynx.model import Pose
from dynx.model.elements import Vector
from dynx.model.geometry import Collision, Cylinder, Shape, Sphere
from dynx.world import Material, Scene, SceneBody, World, ground, sphere

ROLLING_RADIUS = 0.1
MASS = 1.0
TANGENT = 0.3
STARTING = 0.1
"""Time [s] after which bodies roll steadily."""

ROLLING_DURATION = 0.6

INERTIA_FACTORS = {"sphere": 0.4, "cylinder": 0.5, "hoop": 1.0}
"""Moment of inertia about the axis of rolling, divided by mass and squared radius."""


class Rolling(ContactCase):
    """A sphere, a cylinder and a hoop of friction 1 on a slope of tangent 0.3."""

    name: ClassVar[str] = "rolling"
    title: ClassVar[str] = "Rolling down a slope without slipping"
    law: ClassVar[str] = (
        "dv/dt = g sin(a) / (1 + I / (m r^2)). The result is 5/7 g sin(a) for a sphere, 2/3 g sin(a) for a "
        "cylinder and 1/2 g sin(a) for a hoop. The slope has the angle a. The body has the mass m, the "
        "radius r, the moment of inertia I and the speed v."
    )
    source: ClassVar[str] = "Newton's and Euler's equations with the rolling constraint v = w r"
    trials: ClassVar[dict[str, str]] = {name: name for name in INERTIA_FACTORS}

    def scene(self, parameters: str) -> Scene:
        angle = math.atan(TANGENT)
        _, normal = slope_axes(angle)
        material = Material(friction=1.0)
        body = SceneBody(
            "body",
            (_shape(parameters),),
            inclined(angle, ROLLING_RADIUS * normal),
            MASS,
            inertia=_inertia(parameters),
            center_of_mass=(0.0, 0.0, 0.0),
            material=material,
        )
        return Scene("rolling", bodies=(ground(pose=inclined(angle), material=material), body))

    def measure(self, world: World, parameters: str) -> Sequence[Figure]:
        angle = math.atan(TANGENT)
        down, _ = slope_axes(angle)
        world.run(STARTING)
        motion = record(world, ROLLING_DURATION)
        velocities = motion.velocities("body")
        speeds = velocities[:, :3] @ down
        exact = G * math.sin(angle) / (1.0 + INERTIA_FACTORS[parameters])
        slip = float(abs(speeds[-1] - ROLLING_RADIUS * velocities[-1, 4]))
        return [
            Figure("acceleration", acceleration(motion.times, speeds), exact, "m/s^2", exact),
            Figure("slip at the end", slip, 0.0, "m/s", exact * float(motion.times[-1])),
        ]


def _shape(kind: str) -> Collision:
    # The axis of a cylinder of URDF is z; that of rolling is y.
    shape: Shape = Sphere(ROLLING_RADIUS) if kind == "sphere" else Cylinder(ROLLING_RADIUS, 0.1)
    return Collision(shape, Pose(rpy=(0.5 * math.pi, 0.0, 0.0)) if kind != "sphere" else Pose())


def _inertia(kind: str) -> tuple[Vector, Vector, Vector]:
    about = INERTIA_FACTORS[kind] * MASS * ROLLING_RADIUS**2
    across = about if kind == "sphere" else 0.5 * about + MASS * 0.1**2 / 12.0
    return ((across, 0.0, 0.0), (0.0, about, 0.0), (0.0, 0.0, across))


SLIDING_TO_ROLLING_RADIUS = 0.1
FRICTION = 0.5
SLIDING_TO_ROLLING_SPEED = 2.0
"""Speed at the start [m/s]."""

SLIDING_TO_ROLLING_DURATION = 0.4
"""Time [s], more than three times that of the slide."""


class SlidingToRolling(ContactCase):
    """A bowling ball: it slides along a plane until friction has made it roll."""

    name: ClassVar[str] = "sliding_to_rolling"
    title: ClassVar[str] = "Sliding that turns into rolling"
    law: ClassVar[str] = (
        "The ball starts without spin, at the speed v0, and slides until the time t = 2 v0 / (7 mu g). "
        "After that the ball rolls at the speed v = 5/7 v0. mu is the friction coefficient."
    )
    source: ClassVar[str] = "conservation of the angular momentum about the point of contact"

    def scene(self, parameters: None) -> Scene:
        material = Material(friction=FRICTION)
        ball = sphere(
            "ball",
            SLIDING_TO_ROLLING_RADIUS,
            mass=1.0,
            pose=Pose((0.0, 0.0, SLIDING_TO_ROLLING_RADIUS)),
            twist=(SLIDING_TO_ROLLING_SPEED, 0.0, 0.0, 0.0, 0.0, 0.0),
            material=material,
        )
        return Scene("bowling ball", bodies=(ground(material=material), ball))

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        world.step(step_count(world, SLIDING_TO_ROLLING_DURATION))
        ball = world.state.bodies["ball"]
        rolls, speed = (
            2.0 * SLIDING_TO_ROLLING_SPEED / (7.0 * FRICTION * G),
            5.0 / 7.0 * SLIDING_TO_ROLLING_SPEED,
        )
        distance = (
            SLIDING_TO_ROLLING_SPEED * rolls - 0.5 * FRICTION * G * rolls**2 + speed * (world.time - rolls)
        )
        travelled = float(ball.T_world_body[0, 3])
        return [
            Figure("speed", float(ball.twist[0]), speed, "m/s", speed),
            Figure(
                "spin",
                float(ball.twist[4]),
                speed / SLIDING_TO_ROLLING_RADIUS,
                "rad/s",
                speed / SLIDING_TO_ROLLING_RADIUS,
            ),
            Figure("distance", travelled, distance, "m", distance),
        ]


ROLLING_RESISTANCE_RADIUS = 0.1
COEFFICIENT = 0.002
"""Rolling friction [m]: moment per normal force."""

ROLLING_RESISTANCE_SPEED = 1.0
"""Speed at the start [m/s]."""

DIRECTIONS = {"along x": 0.0, "along y": 0.5 * math.pi, "diagonally": 0.25 * math.pi}
"""Directions of motion [rad]."""

SETTLING = 0.1
ROLLING_RESISTANCE_DURATION = 0.4


class RollingResistance(ContactCase):
    """Homogeneous balls that roll without slipping, in three directions."""

    name: ClassVar[str] = "rolling_resistance"
    title: ClassVar[str] = "A rolling ball under rolling friction"
    law: ClassVar[str] = (
        "7/5 m dv/dt = -c m g / r. The ball has the mass m, the radius r and the speed v. c is the "
        "coefficient of rolling friction [m]."
    )
    source: ClassVar[str] = (
        "Coulomb's law for the moment that opposes rolling, and Newton's and Euler's equations"
    )

    def scene(self, parameters: None) -> Scene:
        material = Material(friction=1.0, rolling_friction=COEFFICIENT)
        balls = []
        for k, (name, angle) in enumerate(DIRECTIONS.items()):
            x, y = ROLLING_RESISTANCE_SPEED * math.cos(angle), ROLLING_RESISTANCE_SPEED * math.sin(angle)
            twist = (x, y, 0.0, -y / ROLLING_RESISTANCE_RADIUS, x / ROLLING_RESISTANCE_RADIUS, 0.0)
            pose = Pose((-2.0 * k, 2.0 * k, ROLLING_RESISTANCE_RADIUS))
            balls.append(
                sphere(name, ROLLING_RESISTANCE_RADIUS, mass=1.0, pose=pose, twist=twist, material=material)
            )
        return Scene("rolling_resistance", bodies=(ground(material=material), *balls))

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        exact = 5.0 / 7.0 * COEFFICIENT * G / ROLLING_RESISTANCE_RADIUS
        world.run(SETTLING)
        motion = record(world, ROLLING_RESISTANCE_DURATION)
        figures = []
        for name, angle in DIRECTIONS.items():
            along = motion.velocities(name)[:, :2] @ np.array([math.cos(angle), math.sin(angle)])
            slowing = -acceleration(motion.times, along)
            figures.append(
                Figure(f"deceleration {name}", slowing, exact, "m/s^2", exact, rests_on=("rolling_friction",))
            )
        return figures
