"""Bodies that roll down a slope without slipping."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.motion import acceleration, record
from dynx.contacts.scenes import G, inclined, slope_axes
from dynx.model import Pose
from dynx.model.elements import Vector
from dynx.model.geometry import Collision, Cylinder, Shape, Sphere
from dynx.world import Material, Scene, SceneBody, World, ground

RADIUS = 0.1
MASS = 1.0
TANGENT = 0.3
STARTING = 0.1
"""Time [s] after which bodies roll steadily."""

DURATION = 0.6

INERTIA_FACTORS = {"sphere": 0.4, "cylinder": 0.5, "hoop": 1.0}
"""Moment of inertia about the axis of rolling, divided by mass and squared radius."""


class Rolling(ContactCase):
    """A sphere, a cylinder and a hoop of friction 1 on a slope of tangent 0.3."""

    name: ClassVar[str] = "rolling"
    title: ClassVar[str] = "Rolling down a slope without slipping"
    law: ClassVar[str] = (
        "dv/dt = g sin(a) / (1 + I / (m r^2)): 5/7, 2/3 and 1/2 of g sin(a) for a sphere, a cylinder and a "
        "hoop of moment of inertia I, mass m and radius r, on a slope of angle a"
    )
    source: ClassVar[str] = "equations of Newton and Euler with the rolling constraint v = omega r"
    trials: ClassVar[dict[str, str]] = {name: name for name in INERTIA_FACTORS}

    def scene(self, parameters: str) -> Scene:
        angle = math.atan(TANGENT)
        _, normal = slope_axes(angle)
        material = Material(friction=1.0)
        body = SceneBody(
            "body",
            (_shape(parameters),),
            inclined(angle, RADIUS * normal),
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
        motion = record(world, DURATION)
        velocities = motion.velocities("body")
        speeds = velocities[:, :3] @ down
        exact = G * math.sin(angle) / (1.0 + INERTIA_FACTORS[parameters])
        slip = float(abs(speeds[-1] - RADIUS * velocities[-1, 4]))
        return [
            Figure("acceleration", acceleration(motion.times, speeds), exact, "m/s^2", exact),
            Figure("slip at the end", slip, 0.0, "m/s", exact * float(motion.times[-1])),
        ]


def _shape(kind: str) -> Collision:
    # The axis of a cylinder of URDF is z; that of rolling is y.
    shape: Shape = Sphere(RADIUS) if kind == "sphere" else Cylinder(RADIUS, 0.1)
    return Collision(shape, Pose(rpy=(0.5 * math.pi, 0.0, 0.0)) if kind != "sphere" else Pose())


def _inertia(kind: str) -> tuple[Vector, Vector, Vector]:
    about = INERTIA_FACTORS[kind] * MASS * RADIUS**2
    across = about if kind == "sphere" else 0.5 * about + MASS * 0.1**2 / 12.0
    return ((across, 0.0, 0.0), (0.0, about, 0.0), (0.0, 0.0, across))
