"""Collisions: rebounds from the ground, central collisions, momentum, and pairs of materials."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations_with_replacement, pairwise
from typing import ClassVar, NamedTuple

import numpy as np

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.motion import (
    CONTACT_DELAYS,
    G,
    RecordedMotion,
    Throw,
    after_bounce,
    ball_name,
    balls_above,
    farthest,
    record,
    rms_deviation,
    speeds_after_collision,
)
from dynx.model import Pose
from dynx.model.geometry import Box, Capsule, Collision, Cylinder, Shape, Sphere
from dynx.spatial.scalar import Floats
from dynx.world import Material, Scene, SceneBody, World, WorldState, box, ground, sphere

REBOUND_RADIUS = 0.1
REBOUND_HEIGHTS = tuple(0.5 + 0.01 * k for k in range(5))
"""Heights of fall [m], so that the balls touch the ground at different moments within a step."""


class Rebound(ContactCase):
    """Balls dropped from about half a metre, on ground of the same restitution."""

    name: ClassVar[str] = "rebound"
    title: ClassVar[str] = "Height of a rebound"
    law: ClassVar[str] = (
        "h' / h = e^2. The ball falls from the height h and rebounds to the height h'. e is the restitution."
    )
    source: ClassVar[str] = "Newton's law of restitution and the conservation of energy in flight"
    trials: ClassVar[dict[str, float]] = {f"restitution {e:g}": e for e in (0.0, 0.5, 0.8, 1.0)}

    def scene(self, parameters: float) -> Scene:
        material = Material(restitution=parameters)
        balls = balls_above(REBOUND_RADIUS, REBOUND_HEIGHTS, material)
        return Scene("rebound", bodies=(ground(material=material), *balls))

    def measure(self, world: World, parameters: float) -> Sequence[Figure]:
        fall = math.sqrt(2.0 * max(REBOUND_HEIGHTS) / G)
        # The highest ball reaches the top, and the lowest does not touch the ground again.
        motion = record(world, fall * (1.0 + 1.4 * parameters) + 0.05)
        ratios = [rebound_height(motion, ball_name(k)) / height for k, height in enumerate(REBOUND_HEIGHTS)]
        exact = parameters**2
        return [Figure("height", farthest(ratios, exact), exact, "", 1.0, rests_on=("restitution",))]


def rebound_height(motion: RecordedMotion, ball: str) -> float:
    """Return the largest height of a ball above the ground after it was lowest first [m]."""
    height = motion.positions(ball)[:, 2] - REBOUND_RADIUS
    rises = np.flatnonzero(np.diff(height) >= 0.0)
    lowest = int(rises[0]) if rises.size else len(height) - 1
    return max(0.0, float(np.max(height[lowest:])))


def linear_momentum(scene: Scene, state: WorldState) -> Floats:
    """Return the momentum (3,) of all bodies that move [kg m/s]."""
    total: Floats = np.zeros(3)
    for mass, _, velocity, _, _ in _moving_bodies(scene, state):
        total += mass * velocity
    return total


def angular_momentum(scene: Scene, state: WorldState) -> Floats:
    """Return the angular momentum (3,) of all bodies that move about their common centre of mass
    [kg m^2/s]."""
    total, center, momentum, mass = np.zeros(3), np.zeros(3), np.zeros(3), 0.0
    for m, position, velocity, spin, inertia in _moving_bodies(scene, state):
        total += m * np.cross(position, velocity) + inertia @ spin
        center += m * position
        momentum += m * velocity
        mass += m
    about: Floats = total - np.cross(center, momentum) / mass
    return about


def kinetic_energy(scene: Scene, state: WorldState) -> float:
    """Return the kinetic energy of all bodies that move, in the frame of their common centre of mass [J]."""
    total, momentum, mass = 0.0, np.zeros(3), 0.0
    for m, _, velocity, spin, inertia in _moving_bodies(scene, state):
        total += 0.5 * m * float(velocity @ velocity) + 0.5 * float(spin @ inertia @ spin)
        momentum += m * velocity
        mass += m
    return total - 0.5 * float(momentum @ momentum) / mass


def _moving_bodies(scene: Scene, state: WorldState) -> Iterator[tuple[float, Floats, Floats, Floats, Floats]]:
    """Yield mass, centre of mass, its velocity, angular velocity and inertia about it, in world axes."""
    for body in scene.bodies:
        if body.fixed:
            continue
        inertial = body.inertial
        T, twist = state.bodies[body.name]
        R, lever = T[:3, :3], T[:3, :3] @ np.array(inertial.origin.xyz)
        tensor = inertial.tensor
        yield (
            inertial.mass,
            T[:3, 3] + lever,
            twist[:3] + np.cross(twist[3:], lever),
            twist[3:],
            R @ tensor @ R.T,
        )


FREE_MOMENTUM_DURATION = 0.5

BODIES: tuple[tuple[str, Shape, float, tuple[float, float, float], tuple[float, ...]], ...] = (
    ("box", Box((0.2, 0.3, 0.2)), 2.0, (-0.4, 0.02, 0.0), (1.5, 0.0, 0.0, 0.0, 1.0, 2.0)),
    ("ball", Sphere(0.12), 1.0, (0.4, -0.03, 0.04), (-1.5, 0.1, 0.0, 3.0, 0.0, 0.0)),
    ("capsule", Capsule(0.08, 0.2), 1.0, (0.03, 0.45, 0.0), (0.0, -2.0, 0.1, 0.0, 0.0, 1.0)),
    ("cylinder", Cylinder(0.1, 0.2), 3.0, (0.02, -0.5, -0.05), (0.2, 1.0, 0.0, 1.0, 0.0, 0.0)),
)
"""Name, shape, mass [kg], position [m] and twist of each body."""


class FreeMomentum(ContactCase):
    """Four rotating bodies that collide with one another, with friction, and with nothing else."""

    name: ClassVar[str] = "free_momentum"
    title: ClassVar[str] = "Momentum of bodies that collide in free fall"
    law: ClassVar[str] = (
        "p(t) = p(0) + M g t, and L(t) = L(0). The kinetic energy relative to the centre of mass does not "
        "grow. The bodies together have the mass M and the momentum p. L is their angular momentum about "
        "their common centre of mass. The vector g is gravity."
    )
    source: ClassVar[str] = "conservation of momentum and angular momentum (Newton's third law)"

    def scene(self, parameters: None) -> Scene:
        material = Material(friction=0.5)
        bodies = tuple(
            SceneBody(name, (Collision(shape),), Pose(position), mass, twist=twist, material=material)
            for name, shape, mass, position, twist in BODIES
        )
        return Scene("falling bodies", bodies=bodies)

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        scene, begin = world.scene, world.state
        gravity = np.array(scene.gravity)
        motion = record(world, FREE_MOMENTUM_DURATION)
        total = sum(body.inertial.mass for body in scene.bodies)
        changes, turns, energies = [], [], []
        p0, L0, E0 = (
            linear_momentum(scene, begin),
            angular_momentum(scene, begin),
            kinetic_energy(scene, begin),
        )
        for state in motion.states:
            fallen = total * gravity * state.time
            changes.append(float(np.linalg.norm(linear_momentum(scene, state) - p0 - fallen)))
            turns.append(float(np.linalg.norm(angular_momentum(scene, state) - L0)))
            energies.append(kinetic_energy(scene, state) - E0)
        momenta: float = sum(mass * float(np.linalg.norm(twist[:3])) for _, _, mass, _, twist in BODIES)
        return [
            Figure("largest change of momentum", max(changes), 0.0, "kg m/s", momenta, 1e-6),
            Figure("largest change of angular momentum", max(turns), 0.0, "kg m^2/s", 0.5 * momenta),
            Figure("largest gain of energy", max(energies), 0.0, "J", E0),
        ]


COLLISION_RADIUS = 0.05
COLLISION_SPEED = 1.0
"""Speed of the moving ball [m/s]; the other is at rest, and its mass is 1 kg."""

GAPS = tuple(0.1 + delay * COLLISION_SPEED for delay in CONTACT_DELAYS)
"""Distances [m] between the surfaces at the start."""

COLLISION_DURATION = 0.25
"""Time [s] by which every pair has collided and separated."""

MASSES = {"equal masses": 1.0, "a third of the mass": 1.0 / 3.0, "thrice the mass": 3.0}
"""Masses of the moving ball [kg]."""


class CentralCollision(ContactCase):
    """Balls that meet balls at rest, without gravity and friction."""

    name: ClassVar[str] = "collision"
    title: ClassVar[str] = "Central collision of two balls"
    law: ClassVar[str] = (
        "v2' - v1' = e (v1 - v2), and m1 v1' + m2 v2' = m1 v1 + m2 v2. The balls have the masses m1 and m2. "
        "Their speeds are v1 and v2 before the impact, and v1' and v2' after it. e is the restitution."
    )
    source: ClassVar[str] = (
        "Beer and Johnston, Vector Mechanics for Engineers: Dynamics, 9th ed., direct central impact, "
        "eqs. 13.37 and 13.43"
    )
    trials: ClassVar[dict[str, float]] = {"inelastic": 0.0, "restitution 0.5": 0.5, "elastic": 1.0}

    def scene(self, parameters: float) -> Scene:
        material = Material(friction=0.0, restitution=parameters)
        bodies = []
        for row, mass in enumerate(MASSES.values()):
            for column, gap in enumerate(GAPS):
                at = 0.5 * column, 0.5 * row
                moving, resting = _names(row, column)
                pose = Pose((-gap - 2.0 * COLLISION_RADIUS, *at))
                twist = (COLLISION_SPEED, 0.0, 0.0, 0.0, 0.0, 0.0)
                bodies.append(
                    sphere(moving, COLLISION_RADIUS, mass=mass, pose=pose, twist=twist, material=material)
                )
                bodies.append(
                    sphere(resting, COLLISION_RADIUS, mass=1.0, pose=Pose((0.0, *at)), material=material)
                )
        return Scene("collision", bodies=tuple(bodies), gravity=(0.0, 0.0, 0.0))

    def measure(self, world: World, parameters: float) -> Sequence[Figure]:
        world.run(COLLISION_DURATION)
        bodies = world.state.bodies
        figures, momenta = [], []
        for row, (name, mass) in enumerate(MASSES.items()):
            pairs = [
                tuple(float(bodies[ball].twist[0]) for ball in _names(row, column))
                for column in range(len(GAPS))
            ]
            momenta += [(mass * v1 + v2) / (mass * COLLISION_SPEED) for v1, v2 in pairs]
            v1, v2 = speeds_after_collision(mass, 1.0, COLLISION_SPEED, 0.0, parameters)
            for ball, exact, found in (
                ("moving", v1, [pair[0] for pair in pairs]),
                ("hit", v2, [pair[1] for pair in pairs]),
            ):
                figures.append(
                    Figure(
                        f"speed of the {ball} ball, {name}",
                        farthest(found, exact),
                        exact,
                        "m/s",
                        COLLISION_SPEED,
                        rests_on=("restitution",),
                    )
                )
        return [
            *figures,
            Figure("momentum, relative to that before", farthest(momenta, 1.0), 1.0, "", 1.0, 1e-9),
        ]


def _names(row: int, column: int) -> tuple[str, str]:
    return f"moving {row}.{column}", f"hit {row}.{column}"


NEWTONS_CRADLE_RADIUS = 0.05
NEWTONS_CRADLE_SPEED = 1.0
"""Speed of the first ball [m/s]."""

BALLS = 5
GAP = 0.06
"""Distance between the surfaces of neighbours [m].

Of balls that touch all at once, momentum and energy alone do not determine the speeds after the impact; with
gaps the balls collide two at a time. The gaps are longer than the way of a ball during a contact of a few
hundredths of a second, so that contacts that are springs are separate as well.
"""

ROWS = len(CONTACT_DELAYS)
NEWTONS_CRADLE_DURATION = 0.5
"""Time [s] by which the last ball has been hit and has left its neighbour."""


class NewtonsCradle(ContactCase):
    """Rows of five balls in free flight, of which the first moves, with restitution 1."""

    name: ClassVar[str] = "newtons_cradle"
    title: ClassVar[str] = "Newton's cradle"
    law: ClassVar[str] = (
        "v5' = v1, and v1' = v2' = v3' = v4' = 0. Two equal masses that collide exchange their speeds. v1 "
        "is the speed of the first ball at the start. v1' to v5' are the speeds of the five balls at the "
        "end."
    )
    source: ClassVar[str] = (
        "conservation of momentum and energy in each collision; one collision follows after the other"
    )

    def scene(self, parameters: None) -> Scene:
        material = Material(friction=0.0, restitution=1.0)
        bodies = []
        for row in range(ROWS):
            for k in range(BALLS):
                x = k * (2.0 * NEWTONS_CRADLE_RADIUS + GAP) - (
                    CONTACT_DELAYS[row] * NEWTONS_CRADLE_SPEED if k == 0 else 0.0
                )
                twist = (NEWTONS_CRADLE_SPEED if k == 0 else 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
                pose = Pose((x, 0.5 * row, 0.0))
                bodies.append(
                    sphere(
                        _name(row, k),
                        NEWTONS_CRADLE_RADIUS,
                        mass=1.0,
                        pose=pose,
                        twist=twist,
                        material=material,
                    )
                )
        return Scene("newtons_cradle", bodies=tuple(bodies), gravity=(0.0, 0.0, 0.0))

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        world.run(NEWTONS_CRADLE_DURATION)
        speeds = [
            [float(world.state.bodies[_name(row, k)].twist[0]) for k in range(BALLS)] for row in range(ROWS)
        ]
        last = farthest([row[-1] for row in speeds], NEWTONS_CRADLE_SPEED)
        others = farthest([speed for row in speeds for speed in row[:-1]], 0.0)
        rests_on = ("restitution",)
        return [
            Figure(
                "speed of the last ball",
                last,
                NEWTONS_CRADLE_SPEED,
                "m/s",
                NEWTONS_CRADLE_SPEED,
                rests_on=rests_on,
            ),
            Figure(
                "largest speed of the others", others, 0.0, "m/s", NEWTONS_CRADLE_SPEED, rests_on=rests_on
            ),
        ]


def _name(row: int, ball: int) -> str:
    return f"ball {row}.{ball + 1}"


SPINNING_BALL_RADIUS = 0.1
TIME = 0.1
"""Time [s] at which the first ball meets the ground."""

SPINNING_BALL_DURATION = 0.25


class SpinningBall(ContactCase):
    """Homogeneous balls with backspin, which meet the ground at an angle, without gravity."""

    name: ClassVar[str] = "spinning_ball"
    title: ClassVar[str] = "Impact of a spinning ball"
    law: ClassVar[str] = (
        "u' = e u, v' = v - J, and w' r = w r - 5/2 J. J = min(mu (u + u'), 2/7 (v + w r)) is the impulse "
        "of friction, divided by the mass. Before the impact, the ball has the speed v along the ground, "
        "the speed u downwards and the backspin w. After it, the ball has the speed v' along the ground, "
        "the speed u' upwards and the backspin w'. r is the radius, mu is the friction coefficient, and e "
        "is the restitution."
    )
    source: ClassVar[str] = (
        "Coulomb's law for the impulses of rigid bodies (Brody, That's how the ball bounces, The Physics "
        "Teacher 22, 1984)"
    )
    trials: ClassVar[dict[str, Throw]] = {
        "slides": Throw(2.0, 1.0, 1.0, 0.2, 0.0),
        "grips": Throw(1.0, 0.5, 1.0, 1.0, 0.0),
        "slides and rebounds": Throw(2.0, 1.0, 1.0, 0.2, 0.5),
        "comes back": Throw(1.0, 3.0, 2.0, 1.0, 0.5),
    }

    def scene(self, parameters: Throw) -> Scene:
        material = Material(friction=parameters.friction, restitution=parameters.restitution)
        twist = (
            parameters.speed,
            0.0,
            -parameters.fall,
            0.0,
            -parameters.backspin / SPINNING_BALL_RADIUS,
            0.0,
        )
        heights = [parameters.fall * (TIME + moment) for moment in CONTACT_DELAYS]
        balls = balls_above(SPINNING_BALL_RADIUS, heights, material, spacing=(0.0, 0.5), twist=twist)
        # Without gravity a ball that does not rebound stays on the ground without a force.
        return Scene("spinning_ball", bodies=(ground(material=material), *balls), gravity=(0.0, 0.0, 0.0))

    def measure(self, world: World, parameters: Throw) -> Sequence[Figure]:
        world.run(SPINNING_BALL_DURATION)
        twists = [world.state.bodies[ball_name(k)].twist.tolist() for k in range(len(CONTACT_DELAYS))]
        rests_on = ("restitution",) if parameters.restitution else ()
        rebound = parameters.restitution * parameters.fall
        speed, backspin = after_bounce(parameters)
        figures = [
            Figure(
                "speed of the rebound",
                farthest([twist[2] for twist in twists], rebound),
                rebound,
                "m/s",
                parameters.fall,
                rests_on=rests_on,
            )
        ]
        if parameters.slips:
            # The normal impulse is that of the rebound found, which has a figure of its own.
            ratios = [(parameters.speed - twist[0]) / (parameters.fall + twist[2]) for twist in twists]
            found = farthest(ratios, parameters.friction)
            figures.append(
                Figure(
                    "impulse of friction, relative to the normal impulse", found, parameters.friction, "", 1.0
                )
            )
        else:
            found = farthest([twist[0] for twist in twists], speed)
            figures.append(Figure("speed along the ground", found, speed, "m/s", parameters.speed))
        # Friction acts at the ground, so that it leaves the angular momentum about a point there.
        momentum = backspin - 2.5 * speed
        found = farthest([-twist[4] * SPINNING_BALL_RADIUS - 2.5 * twist[0] for twist in twists], momentum)
        scale = parameters.backspin + 2.5 * parameters.speed
        figures.append(Figure("angular momentum about the ground, by 2/5 m r", found, momentum, "m/s", scale))
        return figures


OBLIQUE_RADII = (2.5, 5.0)
"""Radii [m] of the moving ball and of the one at rest: the way along the surfaces during a contact is short
beside them, so that the line of the centres hardly turns in contacts that are springs."""

OBLIQUE_MASSES = (1.0, 2.0)
"""Masses [kg]."""

OBLIQUE_APPROACH = 1.0
"""Speed of the approach along the line of the centres [m/s]."""

OBLIQUE_GAPS = tuple(0.1 + delay * OBLIQUE_APPROACH for delay in CONTACT_DELAYS)
"""Distances [m] along that line between the surfaces at the start."""

OBLIQUE_DURATION = 0.25
"""Time [s] by which every pair has collided and separated."""


class Graze(NamedTuple):
    """Speed across the line of the centres of two balls that meet, and their friction."""

    slip: float
    """Slip of the surfaces at the touch [m/s]."""
    friction: float


class ObliqueImpact(ContactCase):
    """A ball that hits another off its centre, without gravity, with restitution 1 and friction."""

    name: ClassVar[str] = "oblique_impact"
    title: ClassVar[str] = "Oblique elastic impact of two balls with friction"
    law: ClassVar[str] = (
        "P = (1 + e) m u is the impulse along the line of the centres. J = min(mu P, 2/7 m s) is the "
        "impulse of friction, across this line. For each ball i, m_i v_i' = m_i v_i +- P +- J, and 2/5 m_i "
        "r_i^2 w_i' = -r_i J. P and J each have opposite signs for the two balls. Ball i has the mass m_i "
        "and the radius r_i. Its velocity is v_i before the impact and v_i' after it. It has no spin before "
        "the impact, and the angular velocity w_i' after it. m = m1 m2 / (m1 + m2). The balls approach at "
        "the speed u. At first their surfaces slide on each other at the speed s. If 7 mu (1 + e) u < 2 s, "
        "the surfaces slide during the whole impact. Otherwise they stick at its end. mu is the friction "
        "coefficient, and e is the restitution."
    )
    source: ClassVar[str] = (
        "Coulomb's law for the impulses of rigid bodies, and Newton's law of restitution. The laws of "
        "Poisson and Stronge give the same result here, because friction does not change the normal speed "
        "of two balls (Stronge, Impact Mechanics, 2000, ch. 3 and 4)"
    )
    trials: ClassVar[dict[str, Graze]] = {"slides": Graze(2.0, 0.1), "sticks": Graze(1.0, 0.5)}

    def scene(self, parameters: Graze) -> Scene:
        material = Material(friction=parameters.friction, restitution=1.0)
        twist = (OBLIQUE_APPROACH, parameters.slip, 0.0, 0.0, 0.0, 0.0)
        bodies = []
        for row, gap in enumerate(OBLIQUE_GAPS):
            z = 15.0 * row
            start = (-gap - sum(OBLIQUE_RADII), -gap / OBLIQUE_APPROACH * parameters.slip, z)
            for name, radius, mass, at, motion in zip(
                _names(row, 0),
                OBLIQUE_RADII,
                OBLIQUE_MASSES,
                (start, (0.0, 0.0, z)),
                (twist, (0.0,) * 6),
                strict=True,
            ):
                bodies.append(sphere(name, radius, mass=mass, pose=Pose(at), twist=motion, material=material))
        return Scene("oblique_impact", bodies=tuple(bodies), gravity=(0.0, 0.0, 0.0))

    def measure(self, world: World, parameters: Graze) -> Sequence[Figure]:
        world.run(OBLIQUE_DURATION)
        bodies = world.state.bodies
        twists = [[bodies[name].twist for name in _names(row, 0)] for row in range(len(OBLIQUE_GAPS))]
        slip = parameters.slip
        separation = farthest([float(hit[0] - moving[0]) for moving, hit in twists], OBLIQUE_APPROACH)
        figures = [
            Figure(
                "speed of the separation",
                separation,
                OBLIQUE_APPROACH,
                "m/s",
                OBLIQUE_APPROACH,
                rests_on=("restitution",),
            )
        ]
        if slides_to_the_end(parameters):
            # The normal impulse is that of the separation found, which has a figure of its own.
            ratios = [float(hit[1] / hit[0]) for _, hit in twists]
            found = farthest(ratios, parameters.friction)
            what = "impulse of friction, relative to the normal impulse"
            figures.append(Figure(what, found, parameters.friction, "", 1.0))
        else:
            found = farthest([slip_of(moving, hit) for moving, hit in twists], 0.0)
            figures.append(Figure("slip after the impact", found, 0.0, "m/s", slip))
        # The impulse acts at the touch, so that it leaves the angular momentum of each ball about that.
        turning = [moving[1] - 0.4 * OBLIQUE_RADII[0] * moving[5] for moving, _ in twists]
        turned = [hit[1] + 0.4 * OBLIQUE_RADII[1] * hit[5] for _, hit in twists]
        across = [OBLIQUE_MASSES[0] * moving[1] + OBLIQUE_MASSES[1] * hit[1] for moving, hit in twists]
        what = "angular momentum about the touch, by m r, of the"
        return [
            *figures,
            Figure(f"{what} moving ball", farthest(map(float, turning), slip), slip, "m/s", slip),
            Figure(f"{what} hit ball", farthest(map(float, turned), 0.0), 0.0, "m/s", slip),
            Figure(
                "momentum across the line of the centres",
                farthest(map(float, across), OBLIQUE_MASSES[0] * slip),
                OBLIQUE_MASSES[0] * slip,
                "kg m/s",
                OBLIQUE_MASSES[0] * slip,
                1e-9,
            ),
        ]


def slides_to_the_end(graze: Graze) -> bool:
    """Check whether two balls of restitution 1 still slide on one another when they separate."""
    return 7.0 * graze.friction * 2.0 * OBLIQUE_APPROACH < 2.0 * graze.slip


def slip_of(moving: Floats, hit: Floats) -> float:
    """Return the slip [m/s] of the surfaces of two balls with these twists (6,) where they touch: the line of
    the centres is x, and the slip is along y."""
    return float(moving[1] + OBLIQUE_RADII[0] * moving[5] - hit[1] + OBLIQUE_RADII[1] * hit[5])


BOUNCING_BALL_RADIUS = 0.05
RESTITUTION = 0.5
BOUNCING_BALL_HEIGHTS = tuple(0.5 * G * (0.25 + 0.4e-3 * k) ** 2 for k in range(10))
"""Heights of fall [m], so that the balls touch the ground at different moments within a step."""

REBOUNDS = 3

MIN_HEIGHT = 0.007
"""Height relative to that of the fall below which a ball is not counted as flying."""


class BouncingBall(ContactCase):
    """Balls of restitution 0.5 that fall from about 0.3 m and bounce until they rest."""

    name: ClassVar[str] = "bouncing_ball"
    title: ClassVar[str] = "Sequence of rebounds of a ball"
    law: ClassVar[str] = (
        "Rebound n has the height h_n = e^(2n) h, and the flight of this rebound lasts 2 e^n t. The first "
        "fall has the height h and lasts t. e is the restitution."
    )
    source: ClassVar[str] = "Newton's law of restitution and conservation of energy in flight"

    def scene(self, parameters: None) -> Scene:
        material = Material(restitution=RESTITUTION)
        balls = balls_above(BOUNCING_BALL_RADIUS, BOUNCING_BALL_HEIGHTS, material)
        return Scene("bouncing_ball", bodies=(ground(material=material), *balls))

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        motion = record(world, impact_time(REBOUNDS + 1) * fall_time(max(BOUNCING_BALL_HEIGHTS)))
        tops: list[list[float]] = [[] for _ in range(REBOUNDS)]
        for k, fall in enumerate(BOUNCING_BALL_HEIGHTS):
            heights = (motion.positions(ball_name(k))[:, 2] - BOUNCING_BALL_RADIUS) / fall
            reached = rebound_heights(heights, motion.velocities(ball_name(k))[:, 2])
            for n, found in enumerate(tops):
                found.append(reached[n] if n < len(reached) else 0.0)
        figures = []
        for n, found in enumerate(tops, 1):
            exact = RESTITUTION ** (2 * n)
            # The RMS error of ten balls falls smoothly with the step, where that of a single one jumps.
            measured = exact + rms_deviation(found, exact)
            what = f"height of rebound {n}, relative to the fall"
            figures.append(Figure(what, measured, exact, "", exact, rests_on=("restitution",)))
        return figures


def fall_time(height: float) -> float:
    """Return the time of a fall from rest [s]."""
    return math.sqrt(2.0 * height / G)


def impact_time(n: int) -> float:
    """Return the time of the n-th impact, in units of the time of the fall."""
    return 1.0 + sum(2.0 * RESTITUTION**k for k in range(1, n))


def rebound_heights(heights: Floats, speeds: Floats) -> list[float]:
    """Return the largest height of each flight after an impact, of heights (n,) and upward speeds (n,).

    A flight begins where a ball that falls has begun to rise: an impact may be over within a step, so that no
    height is that of the ground.
    """
    rises = speeds > 0.0
    starts = (np.flatnonzero(~rises[:-1] & rises[1:]) + 1).tolist()
    tops = [float(heights[a:b].max()) for a, b in pairwise([*starts, len(heights)])]
    return [top for top in tops if top > MIN_HEIGHT]


RESTITUTION_PAIRS_RADIUS = 0.05
RESTITUTION_PAIRS_SPEED = 1.0
"""Speed of the balls towards the slab [m/s]."""

RESTITUTION_PAIRS_HEIGHTS = tuple(0.1 + delay * RESTITUTION_PAIRS_SPEED for delay in CONTACT_DELAYS)
"""Heights of the lowest points at the start [m]."""

RESTITUTION_PAIRS_DURATION = 0.25
"""Time [s] by which every ball has met the slab."""


class RestitutionPair(NamedTuple):
    """Restitution of the slab and of the balls."""

    slab: float
    ball: float


class RestitutionPairs(ContactCase):
    """Balls that meet a slab of another material, without gravity, for pairs of four materials."""

    name: ClassVar[str] = "restitution_pairs"
    title: ClassVar[str] = "Restitution of two materials"
    law: ClassVar[str] = (
        "v' = -sqrt(e_a e_b) v. The two materials have the restitutions e_a and e_b. The ball has the "
        "velocity v before the impact and v' after it."
    )
    source: ClassVar[str] = (
        "Newton's law of restitution; for two materials dynx takes the geometric mean of their restitutions"
    )
    trials: ClassVar[dict[str, RestitutionPair]] = {
        f"{a:g} and {b:g}": RestitutionPair(a, b)
        for a, b in combinations_with_replacement((0.0, 0.25, 0.5, 1.0), 2)
    }

    def scene(self, parameters: RestitutionPair) -> Scene:
        slab = Material(friction=0.0, restitution=parameters.slab)
        ball = Material(friction=0.0, restitution=parameters.ball)
        twist = (0.0, 0.0, -RESTITUTION_PAIRS_SPEED, 0.0, 0.0, 0.0)
        balls = balls_above(
            RESTITUTION_PAIRS_RADIUS, RESTITUTION_PAIRS_HEIGHTS, ball, spacing=(0.2, 0.0), twist=twist
        )
        ground = box("slab", (2.0, 1.0, 0.2), pose=Pose((0.4, 0.0, -0.1)), material=slab)
        return Scene("restitution_pairs", bodies=(ground, *balls), gravity=(0.0, 0.0, 0.0))

    def measure(self, world: World, parameters: RestitutionPair) -> Sequence[Figure]:
        world.run(RESTITUTION_PAIRS_DURATION)
        speeds = [
            float(world.state.bodies[ball_name(k)].twist[2]) / RESTITUTION_PAIRS_SPEED
            for k in range(len(RESTITUTION_PAIRS_HEIGHTS))
        ]
        exact = math.sqrt(parameters.slab * parameters.ball)
        rests_on = ("restitution",) if exact else ()
        return [Figure("restitution", farthest(speeds, exact), exact, "", 1.0, rests_on=rests_on)]
