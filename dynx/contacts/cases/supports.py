"""Bodies on supports that move: a wedge that is free to slide, a conveyor, and a turntable.

A surface with a prescribed motion is a robot whose joint a `VelocityMotor` of the scene drives.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.motion import G, acceleration, inclined, mean_contact_force, record, slope_axes
from dynx.model import Pose
from dynx.model.geometry import Box, Collision
from dynx.model.loading import load
from dynx.world import Material, Scene, SceneBody, SceneRobot, VelocityMotor, World, box, ground, sphere

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
        "N = m g cos(a) / (1 + m / M sin(a) (sin(a) - mu cos(a))). M dV/dt = -N (sin(a) - mu cos(a)). m "
        "(dv/dt + dV/dt cos(a)) = m g sin(a) - mu N. The block slides only if mu < tan(a). N is the normal "
        "force between block and wedge. The wedge has the mass M, the angle a and the horizontal speed V. "
        "The block has the mass m and the speed v down the wedge, relative to the wedge. mu is the friction "
        "coefficient of block and wedge."
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


DRIVEN_MASS, DRIVE_GAIN = 100.0, 1e6
"""Mass [kg] and moment of inertia [kg m^2] of a driven surface, and gain of its motor [N s/m, N m s/rad]: its
velocity does not feel what lies on it."""


def driven_surface(kind: str, axis: str, size: tuple[float, float, float]) -> str:
    """Return the URDF of a box with its top at z = 0 on one joint of this kind and axis."""
    moments = " ".join(f'{each}="{DRIVEN_MASS}"' for each in ("ixx", "iyy", "izz"))
    return f"""<robot name="drive">
  <link name="floor"/>
  <joint name="drive" type="{kind}">
    <parent link="floor"/><child link="surface"/><axis xyz="{axis}"/>
    <limit lower="-10" upper="10" effort="1e6" velocity="100"/>
  </joint>
  <link name="surface">
    <inertial>
      <mass value="{DRIVEN_MASS}"/>
      <inertia {moments} ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <collision>
      <origin xyz="0 0 {-0.5 * size[2]}"/><geometry><box size="{size[0]} {size[1]} {size[2]}"/></geometry>
    </collision>
  </link>
</robot>"""


def driven(urdf: str, speed: float, material: Material) -> SceneRobot:
    """Return a driven surface that has this speed [m/s or rad/s] from the start on."""
    return SceneRobot(
        "drive", load(urdf), v=(speed,), material=material, motors=(VelocityMotor(speed, DRIVE_GAIN),)
    )


CONVEYOR_FRICTION = 0.4
CONVEYOR_SPEED = 1.0
"""Speed of the belt [m/s]."""

CONVEYOR_STARTING, CONVEYOR_SLIDING, CONVEYOR_DURATION = 0.04, 0.16, 0.4
"""Times [s] after which the block slides steadily, of the measurement of the slide, and until it rests."""


class Conveyor(ContactCase):
    """A block that is placed at rest on a belt, which a motor keeps at its speed."""

    name: ClassVar[str] = "conveyor"
    title: ClassVar[str] = "A block placed on a conveyor"
    law: ClassVar[str] = (
        "At first the block slides: dv/dt = mu g. When v = V, the slide ends. Then the block moves with the "
        "belt: v = V. The path of the slide, relative to the belt, has the length V^2 / (2 mu g). The block "
        "has the speed v, and the belt has the speed V. mu is the friction coefficient."
    )
    source: ClassVar[str] = "Newton's second law and Coulomb's law of friction"

    def scene(self, parameters: None) -> Scene:
        material = Material(friction=CONVEYOR_FRICTION)
        belt = driven(driven_surface("prismatic", "1 0 0", (4.0, 0.6, 0.1)), CONVEYOR_SPEED, material)
        block = box("block", (0.2, 0.2, 0.1), mass=1.0, pose=Pose((0.0, 0.0, 0.05)), material=material)
        return Scene("conveyor", robots=(belt,), bodies=(block,))

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        world.run(CONVEYOR_STARTING)
        sliding = record(world, CONVEYOR_SLIDING)
        world.run(CONVEYOR_DURATION)
        exact = CONVEYOR_FRICTION * G
        belt, block = world.state.robots["drive"], world.state.bodies["block"]
        slide = float(belt.q[0]) - float(block.position[0])
        slide_exact = CONVEYOR_SPEED**2 / (2.0 * exact)
        gained = acceleration(sliding.times, sliding.velocities("block")[:, 0])
        slip = float(block.twist[0]) - CONVEYOR_SPEED
        return [
            Figure("acceleration of the block", gained, exact, "m/s^2", exact),
            Figure("length of the slide on the belt", slide, slide_exact, "m", slide_exact),
            Figure("speed of the block on the belt after it", slip, 0.0, "m/s", CONVEYOR_SPEED),
            Figure("speed of the belt", float(belt.v[0]), CONVEYOR_SPEED, "m/s", CONVEYOR_SPEED),
        ]


TURNTABLE_SPEED = 3.0
"""Angular velocity of the table [rad/s]."""

TURNTABLE_RADIUS = 0.3
"""Distance [m] of block and ball from the axis at the start."""

TURNTABLE_DURATION = 0.5
TURNTABLE_AVERAGING = 0.02
"""Time [s] at the end over which forces are averaged, in which the table turns by 3.4 degrees."""

ROLLING_BALL_RADIUS, ROLLING_BALL_SPEED = 0.1, 0.5
"""Radius of the ball [m], and its speed at the start [m/s], away from the axis."""


class Turntable(ContactCase):
    """A block that turns with a table, and a homogeneous ball that rolls on it without slipping."""

    name: ClassVar[str] = "turntable"
    title: ClassVar[str] = "A block and a ball on a turntable"
    law: ClassVar[str] = (
        "If W^2 r < mu g, the block does not slip, and the force F = m W^2 r pulls it towards the axis. If "
        "2/7 W v < mu g, the ball does not slip, and its velocity changes by dv/dt = 2/7 W x v. The ball "
        "then moves on a circle. W is the angular velocity of the table. The block has the mass m and the "
        "distance r from the axis. The homogeneous ball rolls with the velocity v. The sign x is the cross "
        "product. mu is the friction coefficient."
    )
    source: ClassVar[str] = (
        "Newton's second law; for the ball: Weltner, Stable circular orbits of freely moving balls on "
        "rotating discs, American Journal of Physics 47, 1979"
    )
    trials: ClassVar[dict[str, str]] = {"block": "block", "ball": "ball"}
    contact_interval: ClassVar[float | None] = TURNTABLE_AVERAGING

    def scene(self, parameters: str) -> Scene:
        material = Material(friction=0.8)
        table = driven(driven_surface("continuous", "0 0 1", (2.0, 2.0, 0.1)), TURNTABLE_SPEED, material)
        speed = TURNTABLE_SPEED * TURNTABLE_RADIUS
        if parameters == "block":
            at = Pose((TURNTABLE_RADIUS, 0.0, 0.03))
            twist = (0.0, speed, 0.0, 0.0, 0.0, TURNTABLE_SPEED)
            body = box("block", (0.1, 0.1, 0.06), mass=1.0, pose=at, twist=twist, material=material)
        else:
            r, v = ROLLING_BALL_RADIUS, ROLLING_BALL_SPEED
            # Its lowest point has the velocity of the table there.
            twist = (v, 0.0, 0.0, speed / r, v / r, 0.0)
            at = Pose((TURNTABLE_RADIUS, 0.0, r))
            body = sphere("ball", r, mass=1.0, pose=at, twist=twist, material=material)
        return Scene("turntable", robots=(table,), bodies=(body,))

    def measure(self, world: World, parameters: str) -> Sequence[Figure]:
        world.run(TURNTABLE_DURATION)
        body, table = world.state.bodies[parameters], world.state.robots["drive"]
        driving = Figure("speed of the table", float(table.v[0]), TURNTABLE_SPEED, "rad/s", TURNTABLE_SPEED)
        if parameters == "block":
            pull = float(np.linalg.norm(mean_contact_force(world, "block")[:2]))
            # The force turns with the table while it is averaged.
            half = 0.5 * TURNTABLE_SPEED * TURNTABLE_AVERAGING
            exact = TURNTABLE_SPEED**2 * TURNTABLE_RADIUS * math.sin(half) / half
            along = np.array([math.cos(table.q[0]), math.sin(table.q[0])])
            slip = float(np.linalg.norm(body.position[:2] - TURNTABLE_RADIUS * along))
            return [
                driving,
                Figure("force towards the axis", pull, exact, "N", exact),
                Figure("slip on the table", slip, 0.0, "m", TURNTABLE_RADIUS),
            ]
        x, y = orbit_on_turntable(world.time)
        radius = ROLLING_BALL_SPEED / (2.0 / 7.0 * TURNTABLE_SPEED)
        away = float(np.hypot(body.position[0] - x, body.position[1] - y))
        speed = float(np.linalg.norm(body.twist[:2]))
        return [
            driving,
            Figure("distance of the ball from its orbit", away, 0.0, "m", radius),
            Figure("speed of the ball", speed, ROLLING_BALL_SPEED, "m/s", ROLLING_BALL_SPEED),
        ]


def orbit_on_turntable(time: float) -> tuple[float, float]:
    """Return the position [m] of a ball that rolls on the table, at a time [s]."""
    rate = 2.0 / 7.0 * TURNTABLE_SPEED
    radius = ROLLING_BALL_SPEED / rate
    return TURNTABLE_RADIUS + radius * math.sin(rate * time), radius * (1.0 - math.cos(rate * time))
