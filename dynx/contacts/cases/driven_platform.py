"""A block on a platform that a force drives along a rail."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.motion import acceleration, record
from dynx.contacts.scenes import G
from dynx.model import Pose
from dynx.model.loading import load
from dynx.world import Material, Scene, SceneRobot, World, box

PLATFORM, BLOCK = 2.0, 1.0
"""Masses [kg]."""

FRICTION = 0.4
SETTLING = 0.1
DURATION = 0.4
RAIL = f"""<robot name="rail">
  <link name="ground"/>
  <joint name="rail" type="prismatic">
    <parent link="ground"/><child link="platform"/><axis xyz="1 0 0"/>
    <limit lower="-10" upper="10" effort="1000" velocity="100"/>
  </joint>
  <link name="platform">
    <inertial>
      <mass value="{PLATFORM}"/>
      <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <collision><origin xyz="0 0 -0.05"/><geometry><box size="2 0.6 0.1"/></geometry></collision>
  </link>
</robot>"""
"""URDF of a platform with its top at z = 0 that moves along x."""


class DrivenPlatform(ContactCase):
    """A block on a platform, which is a robot with one prismatic joint under a constant force."""

    name: ClassVar[str] = "driven_platform"
    title: ClassVar[str] = "A block on a platform that is driven"
    law: ClassVar[str] = (
        "(M + m) dv/dt = F where F <= mu g (M + m); above, m dv/dt = mu m g and M dV/dt = F - mu m g, for "
        "the force F on the platform M with the block m and friction mu"
    )
    source: ClassVar[str] = "Newton's second law and Coulomb's law of friction"
    trials: ClassVar[dict[str, float]] = {"sticks": 9.0, "slides": 18.0}

    def scene(self, parameters: float) -> Scene:
        material = Material(friction=FRICTION)
        rail = SceneRobot("rail", load(RAIL), material=material)
        block = box("block", (0.2, 0.2, 0.1), mass=BLOCK, pose=Pose((0.0, 0.0, 0.05)), material=material)
        return Scene("driven_platform", robots=(rail,), bodies=(block,))

    def measure(self, world: World, parameters: float) -> Sequence[Figure]:
        force = {"rail": [parameters]}
        world.run(SETTLING, torques=force)
        motion = record(world, DURATION, torques=force)
        block = acceleration(motion.times, motion.velocities("block")[:, 0])
        speeds = np.array([state.robots["rail"].v[0] for state in motion.states])
        platform = acceleration(motion.times, speeds)
        block_exact, platform_exact = accelerations(parameters)
        return [
            Figure("acceleration of the block", block, block_exact, "m/s^2", block_exact),
            Figure("acceleration of the platform", platform, platform_exact, "m/s^2", platform_exact),
        ]


def accelerations(force: float) -> tuple[float, float]:
    """Return the accelerations of block and platform under a force on the platform."""
    together = force / (PLATFORM + BLOCK)
    if together <= FRICTION * G:
        return together, together
    return FRICTION * G, (force - FRICTION * BLOCK * G) / PLATFORM
