"""A chain of links around a drum that turns: the ratio of the forces at its ends."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.motion import mean_contact_force
from dynx.model.loading import load
from dynx.world import ExternalForce, Material, Scene, SceneRobot, VelocityMotor, World

DRUM_RADIUS = 0.5
"""Radius of the drum [m], whose axis is y."""

NODES = 6
"""Number of joints of the chain that lie on the drum."""

BEND = math.radians(30.0)
"""Angle between neighbouring links [rad]: the chain is around half of the drum."""

LINK_MASS, LINK_INERTIA, LINK_DAMPING = 0.5, 0.005, 0.1
"""Mass [kg] and moment of inertia [kg m^2] of a link, and damping of a joint [N m s/rad], which matter only
until the chain rests."""

FREE_LENGTH = 0.4
"""Length of the first link, from its hold to the drum, and of the last one [m]."""

SHOE_RADIUS = 0.05
"""Radius [m] of the balls by which the chain touches the drum, each at a joint."""

PULL = 10.0
"""Force at the free end [N]."""

CAPSTAN_FRICTION = 0.3
CAPSTAN_SETTLING, CAPSTAN_AVERAGING = 0.4, 0.2
"""Times [s] until the chain rests, and over which forces are averaged."""


class Capstan(ContactCase):
    """A chain that is held at one end and pulled at the other, around a drum that turns below it.

    Nothing weighs, and each ball touches the drum where its joint is: the links transmit forces along their
    length only.
    """

    name: ClassVar[str] = "capstan"
    title: ClassVar[str] = "A chain around a drum that turns"
    law: ClassVar[str] = (
        "T' / T = ((1 + mu tan(d / 2)) / (1 - mu tan(d / 2)))^n. For small d, this ratio is close to exp(mu "
        "n d). T is the smaller force at one end of the chain, and T' is the larger force at the other end. "
        "The chain has n joints on the drum. It bends by the angle d at each of these joints. The drum "
        "slides below all joints. mu is the friction coefficient, and mu tan(d / 2) < 1."
    )
    source: ClassVar[str] = (
        "balance of forces at each joint, and Coulomb's law; for a rope this is the equation of Euler and "
        "Eytelwein"
    )
    trials: ClassVar[dict[str, float]] = {"towards the pull": 1.0, "against the pull": -1.0}
    contact_interval: ClassVar[float | None] = CAPSTAN_AVERAGING

    def scene(self, parameters: float) -> Scene:
        material = Material(friction=CAPSTAN_FRICTION)
        motor = VelocityMotor(parameters * DRUM_SPEED, 1e4)
        speed = (parameters * DRUM_SPEED,)
        chain = SceneRobot("chain", load(chain_urdf()), material=material)
        drum = SceneRobot("drum", load(DRUM), v=speed, material=material, motors=(motor,))
        return Scene("capstan", robots=(chain, drum), gravity=(0.0, 0.0, 0.0))

    def measure(self, world: World, parameters: float) -> Sequence[Figure]:
        down = np.array([0.0, 0.0, -PULL])
        pull = ExternalForce(
            f"chain/link{NODES}", (*down.tolist(), 0.0, 0.0, 0.0), point=(FREE_LENGTH, 0.0, 0.0)
        )
        world.run(CAPSTAN_SETTLING + CAPSTAN_AVERAGING, forces=[pull])
        balls = [mean_contact_force(world, f"chain/link{k}") for k in range(1, NODES + 1)]
        # Across the plane of the chain its joints hold it.
        held = float(np.linalg.norm((down + np.sum(balls, axis=0))[[0, 2]]))
        exact = force_ratio(CAPSTAN_FRICTION) ** parameters
        return [Figure("ratio of the forces at hold and pull", held / PULL, exact, "", exact, 2e-3)]


def force_ratio(friction: float) -> float:
    """Return the ratio of the forces at the ends of the chain."""
    bend = friction * math.tan(0.5 * BEND)
    return float(((1.0 + bend) / (1.0 - bend)) ** NODES)


DRUM_SPEED = 1.0
"""Angular velocity of the drum [rad/s]."""

DRUM = f"""<robot name="drum">
  <link name="floor"/>
  <joint name="turn" type="continuous">
    <parent link="floor"/><child link="drum"/><axis xyz="0 1 0"/>
  </joint>
  <link name="drum">
    <inertial>
      <mass value="10"/><inertia ixx="10" iyy="10" izz="10" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <collision>
      <origin rpy="{0.5 * math.pi} 0 0"/>
      <geometry><cylinder radius="{DRUM_RADIUS}" length="0.4"/></geometry>
    </collision>
  </link>
</robot>"""
"""URDF of the drum, with its axis through the origin."""


def chain_urdf() -> str:
    """Return the URDF of the chain, whose configuration is zero where it is around the drum.

    The x axis of a link points to the next joint; the first points up, and each of the others is turned by
    the bend, so that the last one points down.
    """
    chord = 2.0 * DRUM_RADIUS * math.sin(0.5 * BEND)
    first = math.pi - 0.5 * BEND
    hold = (DRUM_RADIUS * math.cos(first), DRUM_RADIUS * math.sin(first) - FREE_LENGTH)
    outward = -SHOE_RADIUS * math.sin(0.5 * BEND), SHOE_RADIUS * math.cos(0.5 * BEND)
    parts = ['<robot name="chain"><link name="hold"/>']
    for k in range(NODES + 1):
        parent = f"link{k - 1}" if k else "hold"
        before = FREE_LENGTH if k == 1 else chord
        origin = f'xyz="{before} 0 0" rpy="0 {BEND} 0"'
        if k == 0:
            origin = f'xyz="{hold[0]} 0 {hold[1]}" rpy="0 {-0.5 * math.pi} 0"'
        length = chord if 0 < k < NODES else FREE_LENGTH
        ball = f"""
  <collision>
    <origin xyz="{outward[0]} 0 {outward[1]}"/><geometry><sphere radius="{SHOE_RADIUS}"/></geometry>
  </collision>"""
        parts.append(f"""
<joint name="joint{k}" type="continuous">
  <parent link="{parent}"/><child link="link{k}"/>
  <origin {origin}/><axis xyz="0 1 0"/><dynamics damping="{LINK_DAMPING}"/>
</joint>
<link name="link{k}">
  <inertial>
    <origin xyz="{0.5 * length} 0 0"/><mass value="{LINK_MASS}"/>
    <inertia ixx="{LINK_INERTIA}" iyy="{LINK_INERTIA}" izz="{LINK_INERTIA}" ixy="0" ixz="0" iyz="0"/>
  </inertial>{ball if k else ""}
</link>""")
    return "".join([*parts, "\n</robot>"])
