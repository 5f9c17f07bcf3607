"""Scenes that several cases share."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from dynx.model import Pose
from dynx.model.geometry import Box, Collision, Cylinder, Shape, Sphere
from dynx.spatial.scalar import Floats
from dynx.world import Material, Scene, SceneBody, ground, sphere

G = 9.81
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
