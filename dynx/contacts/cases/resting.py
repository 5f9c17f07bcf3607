"""Bodies at rest: force and depth of the ground, a stack, a standing robot, a block on a moving platform."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.motion import (
    G,
    acceleration,
    farthest,
    mean_contact_force,
    record,
    resting_bodies,
)
from dynx.model import Pose
from dynx.model.loading import load
from dynx.world import Material, PositionMotor, Scene, SceneRobot, World, box, ground

RESTING_FORCE_SETTLING = 0.8
"""Time [s] until bodies that are placed on the ground are at rest."""

RESTING_FORCE_AVERAGING = 0.2
"""Time [s] over which forces are averaged."""


class RestingForce(ContactCase):
    """Bodies of three shapes on a plane, each of whose weight the ground carries."""

    name: ClassVar[str] = "resting_force"
    title: ClassVar[str] = "Force of the ground on a body at rest"
    law: ClassVar[str] = "N = m g. The body has the mass m, and N is the force of the ground."
    source: ClassVar[str] = "balance of forces (Newton's first law)"
    contact_interval: ClassVar[float | None] = RESTING_FORCE_AVERAGING

    def scene(self, parameters: None) -> Scene:
        return resting_bodies()

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        world.run(RESTING_FORCE_SETTLING + RESTING_FORCE_AVERAGING)
        weights = {body.name: body.mass * G for body in world.scene.bodies if body.mass is not None}
        return [
            Figure(f"force on the {name}", float(mean_contact_force(world, name)[2]), weight, "N", weight)
            for name, weight in weights.items()
        ]


HEIGHT = 0.2
"""Height of the bodies [m]."""


class RestingDepth(ContactCase):
    """Bodies of three shapes on a plane, which rigid bodies do not penetrate."""

    name: ClassVar[str] = "resting_depth"
    title: ClassVar[str] = "Penetration of a body at rest"
    law: ClassVar[str] = (
        "z = h / 2. The body has the height h, and its centre is at the height z above the ground."
    )
    source: ClassVar[str] = "impenetrability of rigid bodies"

    def scene(self, parameters: None) -> Scene:
        return resting_bodies()

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        world.run(RESTING_FORCE_SETTLING)
        bodies = world.state.bodies
        # A hundred-thousandth of the height is far less than the accuracy of any machine.
        return [
            Figure(
                f"depth of the {body.name}",
                HEIGHT / 2 - float(bodies[body.name].T_world_body[2, 3]),
                0.0,
                "m",
                HEIGHT,
                1e-5,
            )
            for body in world.scene.bodies
            if not body.fixed
        ]


BOXES = 10
EDGE = 0.1
"""Edge of the boxes [m], whose mass is 1 kg."""

STACK_DURATION = 0.5
STACK_AVERAGING = 0.02
"""Time [s] at the end over which the forces are averaged."""


class Stack(ContactCase):
    """Ten cubes on top of each other, which touch at the start."""

    name: ClassVar[str] = "stack"
    title: ClassVar[str] = "A stack of ten boxes"
    law: ClassVar[str] = (
        "N_k = k m g, and H = 10 h. Each box has the mass m and the height h. N_k is the force between the "
        "k upper boxes and the boxes below. H is the height of the stack."
    )
    source: ClassVar[str] = "balance of forces on the boxes above each contact (Newton's first law)"
    contact_interval: ClassVar[float | None] = STACK_AVERAGING

    def scene(self, parameters: None) -> Scene:
        boxes = [
            box(_name(k), (EDGE,) * 3, mass=1.0, pose=Pose((0.0, 0.0, EDGE * (k + 0.5))))
            for k in range(BOXES)
        ]
        return Scene("stack", bodies=(ground(), *boxes))

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        world.run(STACK_DURATION)
        forces = np.zeros(BOXES)
        number = {_name(k): k for k in range(BOXES)} | {"ground": -1}
        for contact in world.mean_contacts():
            upper = max(number[contact.a], number[contact.b])
            forces[upper] += abs(float(contact.force[2]))
        ratios = forces / (G * np.arange(BOXES, 0, -1))
        centers = np.array([world.state.bodies[_name(k)].T_world_body[:3, 3] for k in range(BOXES)])
        height = float(centers[-1, 2]) + 0.5 * EDGE
        drift = float(np.max(np.linalg.norm(centers[:, :2], axis=1)))
        return [
            Figure(
                "force between two boxes, relative to the weight above",
                farthest(ratios.tolist(), 1.0),
                1.0,
                "",
                1.0,
            ),
            Figure("height", height, BOXES * EDGE, "m", BOXES * EDGE, 1e-5),
            Figure("largest drift to the side", drift, 0.0, "m", EDGE, 1e-4),
        ]


def _name(number: int) -> str:
    return f"box {number + 1}"


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
STANDING_ROBOT_SETTLING = 0.6
STANDING_ROBOT_AVERAGING = 0.1


class StandingRobot(ContactCase):
    """A trunk on four legs of one prismatic joint each, which motors hold."""

    name: ClassVar[str] = "standing_robot"
    title: ClassVar[str] = "Forces on the feet of a robot that stands"
    law: ClassVar[str] = (
        "All feet together carry the weight of the robot. The two front feet together carry m g (c + l) / "
        "(2 l) + 2 f g. The trunk has the mass m, and its centre of mass is c ahead of its middle. Each "
        "foot has the mass f. The front feet are l ahead of the middle, and the rear feet are l behind it."
    )
    source: ClassVar[str] = "balance of forces and moments"
    contact_interval: ClassVar[float | None] = STANDING_ROBOT_AVERAGING

    def scene(self, parameters: None) -> Scene:
        robot = load(quadruped(), base="floating")
        q = (0.0, 0.0, LEG + RADIUS, 0.0, 0.0, 0.0, 1.0, *[LEG] * len(FEET))
        return Scene("standing_robot", robots=(SceneRobot("robot", robot, q=q),), bodies=(ground(),))

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        motors = {"robot": PositionMotor(LEG, kp=30000.0, kd=1500.0)}
        world.run(STANDING_ROBOT_SETTLING + STANDING_ROBOT_AVERAGING, motors=motors)
        forces = {foot: float(mean_contact_force(world, f"robot/{foot}")[2]) for foot in FEET}
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


PLATFORM, BLOCK = 2.0, 1.0
"""Masses [kg]."""

FRICTION = 0.4
DRIVEN_PLATFORM_SETTLING = 0.1
DRIVEN_PLATFORM_DURATION = 0.4
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
        "If F <= mu g (M + m), block and platform move together: (M + m) dv/dt = F. If F is larger, the "
        "block slides: m dv/dt = mu m g, and M dV/dt = F - mu m g. The force F acts on the platform. The "
        "platform has the mass M and the speed V. The block has the mass m and the speed v. mu is the "
        "friction coefficient."
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
        world.run(DRIVEN_PLATFORM_SETTLING, torques=force)
        motion = record(world, DRIVEN_PLATFORM_DURATION, torques=force)
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
