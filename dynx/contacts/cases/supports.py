"""Bodies on supports that move: a wedge that is free to slide."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.motion import G, acceleration, inclined, record, slope_axes
from dynx.model import Pose
from dynx.model.geometry import Box, Collision
from dynx.world import Material, Scene, SceneBody, World, box, ground

WEDGE, BLOCK = 2.0, 1.0
"""Masses of wedge and block [kg]."""

WEDGE_ANGLE = math.atan(0.5)
"""Angle of the face of the wedge [rad], which descends along x."""

FOOT, FACE = (1.2, 0.4, 0.06), (1.0, 0.4, 0.1)
"""Edges of the two plates of which the wedge consists [m]: one lies on the ground, one below the block."""

WEDGE_BLOCK = (0.1, 0.1, 0.06)
"""Edges of the block [m]."""

FREE_WEDGE_STARTING, FREE_WEDGE_DURATION = 0.1, 0.3
"""Times [s] after which the block slides steadily, and of the measurement."""


class FreeWedge(ContactCase):
    """A block that slides down a wedge, which slides on the ground without friction."""

    name: ClassVar[str] = "free_wedge"
    title: ClassVar[str] = "A block on a wedge that is free to slide"
    law: ClassVar[str] = (
        "N = m g cos(a) / (1 + m / M sin(a) (sin(a) - mu cos(a))), M dV/dt = -N (sin(a) - mu cos(a)), and "
        "m (dv/dt + dV/dt cos(a)) = m g sin(a) - mu N, for the block m at the speed v down the face of the "
        "wedge M of angle a, and friction mu between the two"
    )
    source: ClassVar[str] = "Newton's laws for block and wedge, and Coulomb's law of friction"
    trials: ClassVar[dict[str, float]] = {"friction 0": 0.0, "friction 0.2": 0.2}

    def scene(self, parameters: float) -> Scene:
        material, smooth = Material(friction=parameters), Material(friction=0.0)
        down, normal = slope_axes(WEDGE_ANGLE)
        # The face is at the height of the block's start above the middle of the foot.
        middle = np.array([0.0, 0.0, 0.35])
        plate = inclined(WEDGE_ANGLE, middle - 0.5 * FACE[2] * normal)
        wedge = SceneBody(
            "wedge",
            (Collision(Box(FOOT), Pose((0.0, 0.0, 0.5 * FOOT[2]))), Collision(Box(FACE), plate)),
            mass=WEDGE,
            center_of_mass=(0.0, 0.0, 0.1),
            inertia=((0.1, 0.0, 0.0), (0.0, 0.2, 0.0), (0.0, 0.0, 0.2)),
            material=material,
        )
        at = inclined(WEDGE_ANGLE, middle - 0.3 * down + 0.5 * WEDGE_BLOCK[2] * normal)
        block = box("block", WEDGE_BLOCK, mass=BLOCK, pose=at, material=material)
        return Scene("free_wedge", bodies=(ground(material=smooth), wedge, block))

    def measure(self, world: World, parameters: float) -> Sequence[Figure]:
        world.run(FREE_WEDGE_STARTING)
        motion = record(world, FREE_WEDGE_DURATION)
        down, _ = slope_axes(WEDGE_ANGLE)
        wedge, block = (motion.velocities(name)[:, :3] for name in ("wedge", "block"))
        wedge_exact, block_exact = wedge_accelerations(parameters)
        sliding = acceleration(motion.times, (block - wedge) @ down)
        momentum = WEDGE * wedge[-1, 0] + BLOCK * block[-1, 0]
        return [
            Figure(
                "acceleration of the wedge",
                acceleration(motion.times, wedge[:, 0]),
                wedge_exact,
                "m/s^2",
                abs(wedge_exact),
            ),
            Figure("acceleration of the block down the face", sliding, block_exact, "m/s^2", block_exact),
            Figure("momentum along the ground", float(momentum), 0.0, "kg m/s", WEDGE * abs(wedge[-1, 0])),
        ]


def wedge_accelerations(friction: float) -> tuple[float, float]:
    """Return the accelerations of the wedge along x, and of the block down the face relative to it."""
    s, c = math.sin(WEDGE_ANGLE), math.cos(WEDGE_ANGLE)
    normal = BLOCK * G * c / (1.0 + BLOCK / WEDGE * s * (s - friction * c))
    wedge = -normal * (s - friction * c) / WEDGE
    return wedge, G * s - friction * normal / BLOCK - wedge * c
