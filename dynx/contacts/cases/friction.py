"""Dry friction: slopes, directions, pairs of materials, boxes that tip or must not, and spinning bodies."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations_with_replacement
from typing import ClassVar, NamedTuple

import numpy as np

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.motion import (
    G,
    acceleration,
    body_of,
    farthest,
    inclined,
    rate_at,
    record,
    slope_axes,
    tilts,
)
from dynx.model import Pose
from dynx.model.geometry import Box, Cylinder, Shape
from dynx.world import ExternalForce, Material, Scene, World, box, ground, sphere

SLOPE_FRICTION = 0.5
SLOPE_SIZE = (0.4, 0.4, 0.2)
"""Edges of the box [m]."""

SLOPE_SETTLING = 0.3
"""Time [s] after which the box sticks or slides steadily."""

SLOPE_DURATION = 0.7
"""Time [s] over which the motion is measured."""


class Slope(ContactCase):
    """A box of friction 0.5 on slopes of several tangents, with its edges along the slope."""

    name: ClassVar[str] = "slope"
    title: ClassVar[str] = "A box on a slope: stick and slide"
    law: ClassVar[str] = (
        "If tan(a) < mu, the box stays at rest: v = 0. If tan(a) > mu, the box slides: dv/dt = g (sin(a) - "
        "mu cos(a)). The slope has the angle a, and the box has the speed v. mu is the friction "
        "coefficient."
    )
    source: ClassVar[str] = "Coulomb's law of friction"
    trials: ClassVar[dict[str, float]] = {"tangent 0.4": 0.4, "tangent 1": 1.0}

    def scene(self, parameters: float) -> Scene:
        material = Material(friction=SLOPE_FRICTION)
        angle = math.atan(parameters)
        _, normal = slope_axes(angle)
        brick = box(
            "box", SLOPE_SIZE, mass=1.0, pose=inclined(angle, 0.5 * SLOPE_SIZE[2] * normal), material=material
        )
        return Scene("slope", bodies=(ground(pose=inclined(angle), material=material), brick))

    def measure(self, world: World, parameters: float) -> Sequence[Figure]:
        angle = math.atan(parameters)
        down, normal = slope_axes(angle)
        world.run(SLOPE_SETTLING)
        motion = record(world, SLOPE_DURATION)
        if parameters < SLOPE_FRICTION:
            moved = float((motion.positions("box")[-1] - motion.positions("box")[0]) @ down)
            creep = moved / float(motion.times[-1] - motion.times[0])
            # Relative to the speed that a body gains when it falls by its own height.
            return [Figure("creep speed", creep, 0.0, "m/s", math.sqrt(2.0 * G * SLOPE_SIZE[2]), 1e-6)]
        exact = G * (math.sin(angle) - SLOPE_FRICTION * math.cos(angle))
        measured = acceleration(motion.times, motion.velocities("box")[:, :3] @ down)
        lift = motion.positions("box") @ normal - 0.5 * SLOPE_SIZE[2]
        return [
            Figure("acceleration", measured, exact, "m/s^2", exact),
            Figure("largest lift off the slope", float(np.max(lift)), 0.0, "m", SLOPE_SIZE[2], 1e-4),
        ]


FRICTION_ISOTROPY_FRICTION = 0.5
FRICTION_ISOTROPY_SPEED = 2.0
FRICTION_ISOTROPY_SIZE = (0.3, 0.3, 0.05)
"""Edges of the plates [m]."""

DIRECTIONS = (0.0, 15.0, 30.0, 45.0, 60.0)
"""Directions of sliding [deg], in the plane, from an edge of the plates."""

STARTING = 0.15
"""Time [s] after which the plates slide steadily."""

FRICTION_ISOTROPY_DURATION = 0.2
"""Time [s] of the measurement, at the end of which the plates still slide."""


class FrictionIsotropy(ContactCase):
    """Equal plates that slide along a plane in five directions."""

    name: ClassVar[str] = "friction_isotropy"
    title: ClassVar[str] = "Friction in several directions"
    law: ClassVar[str] = (
        "dv/dt = -mu g v / |v|. Each plate moves on a straight line. The deceleration is the same in every "
        "direction. The vector v is the velocity of a plate. mu is the friction coefficient."
    )
    source: ClassVar[str] = "Coulomb's law of friction"

    def scene(self, parameters: None) -> Scene:
        material = Material(friction=FRICTION_ISOTROPY_FRICTION)
        plates = (
            box(
                _name(direction),
                FRICTION_ISOTROPY_SIZE,
                mass=1.0,
                pose=Pose((0.0, 3.0 * k, 0.5 * FRICTION_ISOTROPY_SIZE[2])),
                twist=(*(FRICTION_ISOTROPY_SPEED * along(direction)).tolist(), 0.0, 0.0, 0.0),
                material=material,
            )
            for k, direction in enumerate(DIRECTIONS)
        )
        return Scene("plates", bodies=(ground(material=material), *plates))

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        world.run(STARTING)
        motion = record(world, FRICTION_ISOTROPY_DURATION)
        exact = FRICTION_ISOTROPY_FRICTION * G
        decelerations, drifts = [], []
        for direction in DIRECTIONS:
            velocities = motion.velocities(_name(direction))[:, :3]
            ahead = along(direction)
            decelerations.append(-acceleration(motion.times, velocities @ ahead))
            moved = motion.positions(_name(direction))[-1] - motion.positions(_name(direction))[0]
            drifts.append(abs(float(np.cross(ahead, moved)[2])))
        found = farthest(decelerations, exact)
        return [
            Figure("deceleration farthest from mu g", found, exact, "m/s^2", exact),
            Figure(
                "largest drift to a side",
                max(drifts),
                0.0,
                "m",
                FRICTION_ISOTROPY_SPEED * FRICTION_ISOTROPY_DURATION,
            ),
        ]


def along(direction: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return the unit vector (3,) of a direction [deg] in the plane."""
    angle = math.radians(direction)
    return np.array([math.cos(angle), math.sin(angle), 0.0])


def _name(direction: float) -> str:
    return f"plate at {direction:g} deg"


FRICTION_PAIRS_FRICTION = (0.0, 0.1, 0.5, 1.0)
FRICTION_PAIRS_SIZE = (0.2, 0.2, 0.1)
"""Edges of the boxes [m]."""

FRICTION_PAIRS_SPEED = 3.0
"""Speed at the start [m/s], so that no box stops."""

FRICTION_PAIRS_DURATION = 0.2


class FrictionPairs(ContactCase):
    """Boxes that slide on slabs, one for every pair of four materials."""

    name: ClassVar[str] = "friction_pairs"
    title: ClassVar[str] = "Friction of two materials"
    law: ClassVar[str] = (
        "mu = sqrt(mu_a mu_b). The two materials have the friction coefficients mu_a and mu_b. mu is the "
        "friction coefficient of their contact."
    )
    source: ClassVar[str] = (
        "Coulomb's law; for two materials dynx takes the geometric mean of their friction coefficients"
    )

    def scene(self, parameters: None) -> Scene:
        width = 1.5 * len(FRICTION_PAIRS_FRICTION) * FRICTION_PAIRS_SIZE[1]
        bodies = []
        for k, friction in enumerate(FRICTION_PAIRS_FRICTION):
            pose = Pose((0.0, k * width, -0.5))
            bodies.append(
                box(f"slab {k}", (3.0, width, 1.0), pose=pose, material=Material(friction=friction))
            )
        for name, i, j in _pairs():
            pose = Pose(
                (-0.5, (i + (j - 1.5) / len(FRICTION_PAIRS_FRICTION)) * width, 0.5 * FRICTION_PAIRS_SIZE[2])
            )
            twist = (FRICTION_PAIRS_SPEED, 0.0, 0.0, 0.0, 0.0, 0.0)
            material = Material(friction=FRICTION_PAIRS_FRICTION[j])
            bodies.append(box(name, FRICTION_PAIRS_SIZE, mass=1.0, pose=pose, twist=twist, material=material))
        return Scene("friction_pairs", bodies=tuple(bodies))

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        world.run(FRICTION_PAIRS_DURATION)
        figures = []
        for name, i, j in _pairs():
            vx, _, vz = world.state.bodies[name].twist[:3].tolist()
            # The impulse of friction relative to that of the normal force, which counts for boxes that hop.
            measured = (FRICTION_PAIRS_SPEED - vx) / (G * world.time + vz)
            figures.append(
                Figure(
                    name,
                    measured,
                    math.sqrt(FRICTION_PAIRS_FRICTION[i] * FRICTION_PAIRS_FRICTION[j]),
                    "",
                    1.0,
                )
            )
        return figures


def _pairs() -> Iterator[tuple[str, int, int]]:
    for i, j in combinations_with_replacement(range(len(FRICTION_PAIRS_FRICTION)), 2):
        yield f"friction of {FRICTION_PAIRS_FRICTION[i]:g} and {FRICTION_PAIRS_FRICTION[j]:g}", i, j


HALF_WIDTH, HALF_HEIGHT = 0.1, 0.2
"""Half the edges of the box along the slope and normal to it [m]: it tips above the tangent 0.5."""

DEPTH = 0.2
ANGLES = (0.2, 0.4)
"""Angles of tilt [rad] at which the angular velocity of the box is measured."""

TIPPING_BOX_SETTLING = 0.2
"""Time [s] after which the box slides steadily."""

TIPPING_BOX_DURATION = 0.6
"""Time [s] in which a box that tips exceeds the angles."""


class Incline(NamedTuple):
    """A slope, and the friction of box and slope."""

    tangent: float
    friction: float


class TippingBox(ContactCase):
    """A box twice as tall as wide, released on slopes; gravity is inclined, and the ground is level."""

    name: ClassVar[str] = "tipping_box"
    title: ClassVar[str] = "A tall box on a slope: rest, slide or tip"
    law: ClassVar[str] = (
        "If tan(a) < mu and tan(a) < b / h, the box stays at rest: v = 0. If mu < tan(a) and mu < b / h, "
        "the box slides: dv/dt = g (sin(a) - mu cos(a)). If b / h < tan(a) and b / h < mu, the box tips: "
        "2/3 r w^2 = g (cos(c - a) - cos(c - a - p)). The slope has the angle a, and mu is the friction "
        "coefficient. The box has the half width b, the half height h and the speed v. When it tips, it has "
        "the tilt p and the angular velocity w. r = sqrt(b^2 + h^2), and tan(c) = b / h."
    )
    source: ClassVar[str] = "balance of moments about the lower edge, and conservation of energy"
    trials: ClassVar[dict[str, Incline]] = {
        "rests": Incline(0.4, 0.8),
        "slides": Incline(0.4, 0.3),
        "tips": Incline(0.6, 1.0),
    }

    def scene(self, parameters: Incline) -> Scene:
        material = Material(friction=parameters.friction)
        angle = math.atan(parameters.tangent)
        size = (2.0 * HALF_WIDTH, DEPTH, 2.0 * HALF_HEIGHT)
        body = box("box", size, mass=1.0, pose=Pose((0.0, 0.0, HALF_HEIGHT)), material=material)
        gravity = (G * math.sin(angle), 0.0, -G * math.cos(angle))
        return Scene("tipping_box", bodies=(ground(material=material), body), gravity=gravity)

    def measure(self, world: World, parameters: Incline) -> Sequence[Figure]:
        angle = math.atan(parameters.tangent)
        if parameters.tangent < min(parameters.friction, HALF_WIDTH / HALF_HEIGHT):
            motion = record(world, TIPPING_BOX_DURATION)
            moved = float(motion.positions("box")[-1, 0])
            return [
                Figure("displacement", moved, 0.0, "m", 0.5 * G * TIPPING_BOX_DURATION**2),
                Figure("tilt", float(tilts(motion.rotations("box"))[-1]), 0.0, "rad", 1.0),
            ]
        if parameters.friction < HALF_WIDTH / HALF_HEIGHT:
            world.run(TIPPING_BOX_SETTLING)
            motion = record(world, TIPPING_BOX_DURATION)
            exact = G * (math.sin(angle) - parameters.friction * math.cos(angle))
            measured = acceleration(motion.times, motion.velocities("box")[:, 0])
            tilt = tilts(motion.rotations("box"))
            return [
                Figure("acceleration", measured, exact, "m/s^2", exact),
                Figure("largest tilt", float(np.max(np.abs(tilt))), 0.0, "rad", 1.0),
            ]
        motion = record(world, TIPPING_BOX_DURATION)
        tilt, rates = tilts(motion.rotations("box")), motion.velocities("box")[:, 4]
        return [
            Figure(f"angular velocity at {p} rad", rate_at(p, tilt, rates), w, "rad/s", w)
            for p, w in ((p, tipping_speed_on_slope(angle, p)) for p in ANGLES)
        ]


def tipping_speed_on_slope(angle: float, tilt: float) -> float:
    """Return the angular velocity [rad/s] of a box on a slope that has tipped about its lower edge."""
    r, c = math.hypot(HALF_WIDTH, HALF_HEIGHT), math.atan(HALF_WIDTH / HALF_HEIGHT)
    # The moment of inertia about the edge is 4/3 m r^2.
    return math.sqrt(1.5 * G / r * (math.cos(c - angle) - math.cos(c - angle - tilt)))


HALF = 0.1
"""Half the edge of the cube [m], whose mass is 1 kg."""

PUSHED_BOX_SETTLING = 0.1
"""Time [s] after which the cube slides steadily."""

PUSHED_BOX_DURATION = 0.5
TILT = 0.3
"""Angle [rad] at which the angular velocity of a cube that tips is measured."""


class BoxPush(NamedTuple):
    """A horizontal force on a cube, and the friction of cube and ground."""

    force: float
    """Force [N]."""
    height: float
    """Height [m] of the point of the cube at which it acts."""
    friction: float


class PushedBox(ContactCase):
    """A cube on level ground, pushed at half its height or at the top."""

    name: ClassVar[str] = "pushed_box"
    title: ClassVar[str] = "A box under a push: stay, slide or tip"
    law: ClassVar[str] = (
        "If F < mu m g and F z < m g b, the box stays at rest: v = 0. If F > mu m g and F z < m g b, the "
        "box slides: m dv/dt = F - mu m g. If F < mu m g and F z > m g b, the box tips: 4/3 m b^2 w^2 = F x "
        "- m g y. The box is a cube with the mass m, the edge 2 b and the speed v. The force F pushes at "
        "the height z. When the box tips, it has the angular velocity w. The point at which the force acts "
        "has moved by x in the direction of the force. The centre has risen by y. mu is the friction "
        "coefficient."
    )
    source: ClassVar[str] = (
        "Coulomb's law, balance of moments about the edge, and the theorem of work and energy"
    )
    trials: ClassVar[dict[str, BoxPush]] = {
        "stays": BoxPush(4.0, HALF, 0.5),
        "slides": BoxPush(6.0, HALF, 0.5),
        "tips": BoxPush(7.0, 2.0 * HALF, 1.0),
    }

    def scene(self, parameters: BoxPush) -> Scene:
        material = Material(friction=parameters.friction)
        size = (2.0 * HALF,) * 3
        body = box("box", size, mass=1.0, pose=Pose((0.0, 0.0, HALF)), material=material)
        return Scene("pushed_box", bodies=(ground(material=material), body))

    def measure(self, world: World, parameters: BoxPush) -> Sequence[Figure]:
        force = (parameters.force, 0.0, 0.0, 0.0, 0.0, 0.0)
        push = ExternalForce("box", force, point=(0.0, 0.0, parameters.height - HALF))
        if parameters.force * parameters.height > G * HALF:
            motion = record(world, PUSHED_BOX_DURATION, forces=[push])
            tilt, rates = tilts(motion.rotations("box")), motion.velocities("box")[:, 4]
            exact = tipping_speed_under_push(parameters.force, TILT)
            measured = rate_at(TILT, tilt, rates)
            return [Figure(f"angular velocity at {TILT} rad", measured, exact, "rad/s", exact)]
        world.run(PUSHED_BOX_SETTLING, forces=[push])
        motion = record(world, PUSHED_BOX_DURATION, forces=[push])
        exact = max(0.0, parameters.force - parameters.friction * G)
        measured = acceleration(motion.times, motion.velocities("box")[:, 0])
        return [Figure("acceleration", measured, exact, "m/s^2", parameters.force)]


def tipping_speed_under_push(force: float, tilt: float) -> float:
    """Return the angular velocity [rad/s] of a cube of 1 kg that a constant force at the middle of its top
    has tipped about an edge."""
    c, s = math.cos(tilt), math.sin(tilt)
    # From the edge, the point of the force is at (-b, 2 b) at the start, and the centre at (-b, b).
    x = HALF * (1.0 - c + 2.0 * s)
    y = HALF * (c + s - 1.0)
    return math.sqrt((force * x - G * y) / (4.0 / 3.0)) / HALF


RADIUS = 0.1
COEFFICIENT = 0.01
"""Torsional friction [m]: moment per normal force."""

SPIN = 5.0
"""Angular velocity at the start [rad/s]."""


class SpinDown(ContactCase):
    """A homogeneous ball with a vertical axis of rotation."""

    name: ClassVar[str] = "spin_down"
    title: ClassVar[str] = "Spin of a ball under torsional friction"
    law: ClassVar[str] = (
        "2/5 m r^2 dw/dt = -c m g, until w = 0. The ball has the mass m, the radius r and the angular "
        "velocity w about the vertical. c is the coefficient of torsional friction [m]."
    )
    source: ClassVar[str] = "Coulomb's law for the moment about the normal, and Euler's equation"

    def scene(self, parameters: None) -> Scene:
        material = Material(torsional_friction=COEFFICIENT)
        twist = (0.0, 0.0, 0.0, 0.0, 0.0, SPIN)
        ball = sphere("ball", RADIUS, mass=1.0, pose=Pose((0.0, 0.0, RADIUS)), twist=twist, material=material)
        return Scene("spin_down", bodies=(ground(material=material), ball))

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        exact = COEFFICIENT * G / (0.4 * RADIUS**2)
        stop = SPIN / exact
        world.run(0.2 * stop)
        spinning = record(world, 0.6 * stop)
        slowing = -acceleration(spinning.times, spinning.velocities("ball")[:, 5])
        world.run(0.3 * stop)
        left = float(world.state.bodies["ball"].twist[5])
        rests_on = ("torsional_friction",)
        return [
            Figure("angular deceleration", slowing, exact, "rad/s^2", exact, rests_on=rests_on),
            Figure("spin after the stop", left, 0.0, "rad/s", SPIN, rests_on=rests_on),
        ]


FAST_SLIDE_SPEED = 10.0
"""Speed at the start [m/s]."""

FAST_SLIDE_STARTING = 0.1
"""Time [s] after which the boxes slide steadily."""

FAST_SLIDE_DURATION = 0.4
"""Time [s] of the measurement, at the end of which the boxes still slide."""


class SlidingBox(NamedTuple):
    """A box that slides along an edge of length `width`, and its friction."""

    width: float
    """Length and width [m]."""
    height: float
    friction: float


class FastSlide(ContactCase):
    """A box that slides at 10 m/s, flat enough that friction cannot tip it."""

    name: ClassVar[str] = "fast_slide"
    title: ClassVar[str] = "A fast slide of a box that must not tip"
    law: ClassVar[str] = (
        "If mu h < b, the box slides without tilt, at any speed: dv/dt = -mu g. The box has the half width "
        "b, the half height h and the speed v. mu is the friction coefficient."
    )
    source: ClassVar[str] = (
        "Coulomb's law, and balance of moments about the centre: the normal force acts at the distance mu h "
        "in front of the centre"
    )
    trials: ClassVar[dict[str, SlidingBox]] = {
        "flat": SlidingBox(0.2, 0.1, 0.4),
        "cube": SlidingBox(0.2, 0.2, 0.4),
        "cube, friction 0.6": SlidingBox(0.2, 0.2, 0.6),
    }

    def scene(self, parameters: SlidingBox) -> Scene:
        material = Material(friction=parameters.friction)
        size = (parameters.width, parameters.width, parameters.height)
        slider = box(
            "box",
            size,
            mass=1.0,
            pose=Pose((0.0, 0.0, 0.5 * parameters.height)),
            twist=(FAST_SLIDE_SPEED, 0.0, 0.0, 0.0, 0.0, 0.0),
            material=material,
        )
        return Scene("fast_slide", bodies=(ground(material=material), slider))

    def measure(self, world: World, parameters: SlidingBox) -> Sequence[Figure]:
        start = record(world, FAST_SLIDE_STARTING)
        motion = record(world, FAST_SLIDE_DURATION)
        exact = parameters.friction * G
        slowing = -acceleration(motion.times, motion.velocities("box")[:, 0])
        upward = np.concatenate([each.rotations("box")[:, 2, 2] for each in (start, motion)])
        tilt = float(np.arccos(np.clip(np.min(upward), -1.0, 1.0)))
        return [
            Figure("deceleration", slowing, exact, "m/s^2", exact),
            Figure("largest tilt", tilt, 0.0, "rad", 1.0, 1e-2),
        ]


SPINNING_PLATE_FRICTION = 0.5
SPINNING_PLATE_SPIN = 10.0
"""Angular velocity at the start [rad/s]."""

PLATE_RADIUS, PLATE_HEIGHT = 0.2, 0.05
"""Radius of the disc, or half the edge of the square, and height of both [m]."""

SPINNING_PLATE_STARTING = 0.02
SPINNING_PLATE_DURATION = 0.08
"""Time [s] of the measurement, at the end of which the plates still spin."""


class Plate(NamedTuple):
    """A plate: whether it is round, and its polar radius of gyration, squared [m^2]."""

    round: bool
    gyration: float

    @property
    def farthest(self) -> float:
        """Distance [m] of the farthest point of its face from the axis."""
        return PLATE_RADIUS if self.round else math.sqrt(2.0) * PLATE_RADIUS


class SpinningPlate(ContactCase):
    """A flat box and a flat cylinder that spin on a plane about their vertical axis.

    Of rigid bodies, mechanics does not determine the pressure on a face, so that it bounds the deceleration
    only. The figure is the pressure that an engine implies.
    """

    name: ClassVar[str] = "spinning_plate"
    title: ClassVar[str] = "A flat body that spins on a plane: the pressure below it"
    law: ClassVar[str] = (
        "k^2 dw/dt = -mu g s. s is the mean distance of the pressure from the axis. For every distribution "
        "of the pressure, 0 < s <= d. For uniform pressure, s is 0.541 d for a square and 2/3 d for a disc. "
        "d is the distance of the farthest point of the plate from the axis. The plate has the angular "
        "velocity w and the radius of gyration k. mu is the friction coefficient."
    )
    source: ClassVar[str] = "Coulomb's law at every point of the face, and Euler's equation"
    trials: ClassVar[dict[str, Plate]] = {
        "square": Plate(False, 2.0 / 3.0 * PLATE_RADIUS**2),
        "disc": Plate(True, 0.5 * PLATE_RADIUS**2),
    }

    def scene(self, parameters: Plate) -> Scene:
        material = Material(friction=SPINNING_PLATE_FRICTION)
        edge = 2.0 * PLATE_RADIUS
        shape: Shape = (
            Cylinder(PLATE_RADIUS, PLATE_HEIGHT) if parameters.round else Box((edge, edge, PLATE_HEIGHT))
        )
        plate = replace(
            body_of(shape, "plate", (0.0, 0.0, 0.5 * PLATE_HEIGHT), 1.0),
            twist=(0.0, 0.0, 0.0, 0.0, 0.0, SPINNING_PLATE_SPIN),
            material=material,
        )
        return Scene("spinning_plate", bodies=(ground(material=material), plate))

    def measure(self, world: World, parameters: Plate) -> Sequence[Figure]:
        world.run(SPINNING_PLATE_STARTING)
        motion = record(world, SPINNING_PLATE_DURATION)
        slowing = -acceleration(motion.times, motion.velocities("plate")[:, 5])
        distance = slowing * parameters.gyration / (SPINNING_PLATE_FRICTION * G)
        what = "mean distance of the pressure from the axis, relative to the farthest point"
        return [Figure(what, distance / parameters.farthest, 0.0, "", 1.0, most=1.0)]
