"""A robot that stands on four feet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.motion import mean_contact_forces
from dynx.contacts.scenes import G
from dynx.model.loading import load
from dynx.world import PositionMotor, Scene, SceneRobot, World, ground

TRUNK, FOOT = 10.0, 0.5
"""Masses [kg] of the trunk and of each foot."""

AHEAD = 0.05
"""Distance [m] of the centre of mass of the trunk ahead of its middle."""

REACH = 0.2
"""Distance [m] of the feet from the middle, along the trunk."""

LEG, RADIUS = 0.25, 0.03
"""Length of the legs and radius of the feet [m]."""

FEET = {
    "front_left": (REACH, 0.15),
    "front_right": (REACH, -0.15),
    "rear_left": (-REACH, 0.15),
    "rear_right": (-REACH, -0.15),
}
SETTLING = 0.6
AVERAGING = 0.1


class StandingRobot(ContactCase):
    """A trunk on four legs of one prismatic joint each, which motors hold."""

    name: ClassVar[str] = "standing_robot"
    title: ClassVar[str] = "Forces on the feet of a robot that stands"
    law: ClassVar[str] = (
        "the forces of all feet add up to the weight, and those of the front feet to m g (c + l) / (2 l) and "
        "the weight of two feet, for a trunk m with its centre c ahead of the middle and feet at distances l"
    )
    source: ClassVar[str] = "balance of forces and moments"

    def scene(self, parameters: None) -> Scene:
        robot = load(quadruped(), base="floating")
        q = (0.0, 0.0, LEG + RADIUS, 0.0, 0.0, 0.0, 1.0, *[LEG] * len(FEET))
        return Scene("standing_robot", robots=(SceneRobot("robot", robot, q=q),), bodies=(ground(),))

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        motors = {"robot": PositionMotor(LEG, kp=30000.0, kd=1500.0)}
        world.run(SETTLING, motors=motors)
        means = mean_contact_forces(world, [f"robot/{foot}" for foot in FEET], AVERAGING, motors=motors)
        forces = {foot: float(means[f"robot/{foot}"][2]) for foot in FEET}
        weight, front = foot_forces()
        ahead = sum(force for foot, force in forces.items() if foot.startswith("front"))
        return [
            Figure("force of all feet", sum(forces.values()), weight, "N", weight),
            Figure("force of the front feet", ahead, front, "N", weight),
        ]


def quadruped() -> str:
    """Return the robot as URDF."""
    legs = "".join(
        f"""
  <joint name="{name}_leg" type="prismatic">
    <parent link="trunk"/><child link="{name}"/>
    <origin xyz="{x} {y} 0"/><axis xyz="0 0 -1"/>
    <limit lower="0" upper="1" effort="1000" velocity="100"/>
  </joint>
  <link name="{name}">
    <inertial>
      <mass value="{FOOT}"/>
      <inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <collision><geometry><sphere radius="{RADIUS}"/></geometry></collision>
  </link>"""
        for name, (x, y) in FEET.items()
    )
    return f"""<robot name="quadruped">
  <link name="trunk">
    <inertial>
      <origin xyz="{AHEAD} 0 0"/><mass value="{TRUNK}"/>
      <inertia ixx="0.1" iyy="0.3" izz="0.3" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>{legs}
</robot>"""


def foot_forces() -> tuple[float, float]:
    """Return the force [N] of all feet, and of the front ones."""
    front = TRUNK * (AHEAD + REACH) / (2.0 * REACH) + 2.0 * FOOT
    return G * (TRUNK + 4.0 * FOOT), G * front
