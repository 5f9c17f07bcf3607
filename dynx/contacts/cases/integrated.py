"""Motions that equations of motion determine, which are integrated: a rod that falls, and a tippe top."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.motion import G, rate_at, record, tilts
from dynx.model import Pose
from dynx.model.geometry import Capsule, Collision, Sphere
from dynx.spatial.scalar import Floats
from dynx.world import Material, Scene, SceneBody, World, ground

ROD_HALF, ROD_RADIUS = 0.5, 0.02
"""Distance [m] of the middle of the rod from the centres of its round ends, and radius of these."""

ROD_INERTIA = ROD_HALF**2 / 3.0
"""Moment of inertia about the middle, by the mass [m^2]: that of a thin rod."""

ROD_TILT = 0.3
"""Angle of the rod from the vertical at the start [rad]."""

ROD_ANGLES = (0.6, 0.9)
"""Angles [rad] at which its angular velocity is measured."""

ROD_DURATION = 0.8
"""Time [s] in which the rod exceeds the angles."""


class FallingRod(ContactCase):
    """A thin rod with round ends that falls with one end on the ground, which sticks or slides.

    Friction is below 4/3, from which on a thin rod that slides may have no solution or two (Painleve).
    """

    name: ClassVar[str] = "falling_rod"
    title: ClassVar[str] = "A rod that falls with one end on the ground"
    law: ClassVar[str] = (
        "If the lower end rolls without slipping, (k^2 + d^2 + s^2) w^2 = 2 g l (cos(a0) - cos(a)). If the "
        "lower end slides back, k^2 dw/dt = (d - mu s) N / m, and N / m = g - l (dw/dt sin(a) + w^2 "
        "cos(a)). The rod has the angle a from the vertical and the angular velocity w. It starts at rest "
        "at the angle a0. It has the mass m, the half length l, the radius r of its ends and the radius of "
        "gyration k. N is the normal force, d = l sin(a), and s = r + l cos(a). The friction coefficient mu "
        "is below 4/3. Painleve's paradox begins at 4/3."
    )
    source: ClassVar[str] = (
        "conservation of energy, Newton's and Euler's equations, and Coulomb's law; for the paradox: Genot "
        "and Brogliato, New results on Painleve paradoxes, European Journal of Mechanics A 18, 1999"
    )
    trials: ClassVar[dict[str, float]] = {"friction 0": 0.0, "friction 0.1": 0.1, "friction 1": 1.0}

    def scene(self, parameters: float) -> Scene:
        material = Material(friction=parameters)
        height = ROD_RADIUS + ROD_HALF * math.cos(ROD_TILT)
        across = ROD_INERTIA
        rod = SceneBody(
            "rod",
            (Collision(Capsule(ROD_RADIUS, 2.0 * ROD_HALF)),),
            Pose((0.0, 0.0, height), (0.0, ROD_TILT, 0.0)),
            1.0,
            center_of_mass=(0.0, 0.0, 0.0),
            inertia=((across, 0.0, 0.0), (0.0, across, 0.0), (0.0, 0.0, 0.5 * ROD_RADIUS**2)),
            material=material,
        )
        return Scene("falling_rod", bodies=(ground(material=material), rod))

    def measure(self, world: World, parameters: float) -> Sequence[Figure]:
        motion = record(world, ROD_DURATION)
        tilt, rates = tilts(motion.rotations("rod")), motion.velocities("rod")[:, 4]
        return [
            Figure(f"angular velocity at {angle} rad", rate_at(angle, tilt, rates), exact, "rad/s", exact)
            for angle, exact in ((angle, rod_rate(parameters, angle)) for angle in ROD_ANGLES)
        ]


def rod_slides(friction: float) -> bool:
    """Check whether the lower end of the rod slides back from the start on."""
    d, s = ROD_HALF * math.sin(ROD_TILT), ROD_RADIUS + ROD_HALF * math.cos(ROD_TILT)
    # At rest and without slip, friction and normal force give the acceleration of a rotation about the end.
    alpha = G * d / (ROD_INERTIA + d * d + s * s)
    return friction * (G - d * alpha) < s * alpha


def rod_rate(friction: float, angle: float) -> float:
    """Return the angular velocity [rad/s] of the rod where it has fallen to an angle [rad]."""
    if not rod_slides(friction):
        d, s = ROD_HALF * math.sin(angle), ROD_RADIUS + ROD_HALF * math.cos(angle)
        fallen = 2.0 * G * ROD_HALF * (math.cos(ROD_TILT) - math.cos(angle))
        return math.sqrt(fallen / (ROD_INERTIA + d * d + s * s))
    from scipy.integrate import solve_ivp

    def growth(a: float, squared: Floats) -> Floats:
        """Return the derivative of w^2 with respect to the angle, 2 dw/dt."""
        return 2.0 * rod_acceleration(friction, a, squared)

    found = solve_ivp(growth, (ROD_TILT, angle), np.zeros(1), method="DOP853", rtol=1e-10, atol=1e-12)
    return math.sqrt(float(found.y[0, -1]))


def rod_acceleration(friction: float, angle: float, squared: Floats) -> Floats:
    """Return the angular accelerations of a rod that slides back, at squared angular velocities (n,)."""
    d, s = ROD_HALF * math.sin(angle), ROD_RADIUS + ROD_HALF * math.cos(angle)
    # The end slides back, so that friction on it points ahead and its moment opposes the fall.
    lever = (d - friction * s) / ROD_INERTIA
    normal = (G - ROD_HALF * math.cos(angle) * squared) / (1.0 + d * lever)
    return np.asarray(normal * lever)


TOP_RADIUS = 0.3
"""Radius of the top [m]."""

TOP_OFFSET = 0.09
"""Distance [m] of its centre of mass from its centre, below it at the start."""

TOP_INERTIA = 0.4 * TOP_RADIUS**2
"""Moments of inertia about the centre of mass, by the mass [m^2]; all are equal."""

TOP_FRICTION = 0.6
TOP_SPIN, TOP_TILT = 30.0, 0.2
"""Angular velocity about the vertical at the start [rad/s], and tilt of the axis [rad]; the centre of mass
rests."""

TOP_DURATION = 0.8
"""Time [s] of the measurement, in which the top slides and turns over by more than a radian."""


class TippeTop(ContactCase):
    """A ball with its centre of mass below its centre, which spins fast: friction turns it over."""

    name: ClassVar[str] = "tippe_top"
    title: ClassVar[str] = "A tippe top"
    law: ClassVar[str] = (
        "m dv/dt = N n - mu N u / |u| - m g n. I dw/dt = c x (N n - mu N u / |u|). The normal force N keeps "
        "the centre of the ball at the same height. dynx integrates these equations over a time in which "
        "the ball slides. The ball has the mass m and three equal moments of inertia I. The vector v is the "
        "velocity of the centre of mass, and w is the angular velocity. The vector c leads from the centre "
        "of mass to the contact. The vector u is the slip velocity of the contact. The unit vector n points "
        "upwards. mu is the friction coefficient, and the sign x is the cross product."
    )
    source: ClassVar[str] = (
        "Newton's and Euler's equations with Coulomb's law of friction (Cohen, The tippe top revisited, "
        "American Journal of Physics 45, 1977)"
    )

    def scene(self, parameters: None) -> Scene:
        material = Material(friction=TOP_FRICTION)
        pose = Pose((0.0, 0.0, TOP_RADIUS), (0.0, TOP_TILT, 0.0))
        _, spin, velocity = top_at_start()
        moment = TOP_INERTIA
        top = SceneBody(
            "top",
            (Collision(Sphere(TOP_RADIUS)),),
            pose,
            1.0,
            center_of_mass=(0.0, 0.0, -TOP_OFFSET),
            inertia=((moment, 0.0, 0.0), (0.0, moment, 0.0), (0.0, 0.0, moment)),
            twist=(*velocity.tolist(), *spin.tolist()),
            material=material,
        )
        return Scene("tippe_top", bodies=(ground(material=material), top))

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        world.run(TOP_DURATION)
        T, twist = world.state.bodies["top"]
        tilt = math.acos(max(-1.0, min(1.0, float(T[2, 2]))))
        tilt_exact, spin_exact = top_at(world.time)
        return [
            Figure("tilt of the axis", tilt, tilt_exact, "rad", math.pi),
            Figure("angular velocity about the vertical", float(twist[5]), spin_exact, "rad/s", TOP_SPIN),
        ]


def top_at_start() -> tuple[Floats, Floats, Floats]:
    """Return the axis of the top, its angular velocity and the velocity of its centre (3,) at the start."""
    axis = np.array([math.sin(TOP_TILT), 0.0, math.cos(TOP_TILT)])
    spin = np.array([0.0, 0.0, TOP_SPIN])
    return axis, spin, np.cross(spin, TOP_OFFSET * axis)


def top_at(time: float) -> tuple[float, float]:
    """Return the tilt of the axis of the top [rad] and its angular velocity about the vertical [rad/s]."""
    from scipy.integrate import solve_ivp

    axis, spin, velocity = top_at_start()
    start = np.concatenate([axis, spin, velocity[:2]])
    found = solve_ivp(top_rates, (0.0, time), start, method="DOP853", rtol=1e-9, atol=1e-10)
    state = found.y[:, -1]
    return math.acos(state[2] / float(np.linalg.norm(state[:3]))), float(state[5])


def top_rates(_: float, state: Floats) -> Floats:
    """Return the derivative of axis (3,), angular velocity (3,) and horizontal velocity (2,) of the centre of
    the ball."""
    axis, omega, across = state[:3], state[3:6], state[6:]
    # From the centre of mass: the centre of the ball, and the point of contact.
    center = TOP_OFFSET * axis
    lever = center - np.array([0.0, 0.0, TOP_RADIUS])
    slip = np.array([*across, 0.0]) + np.cross(omega, [0.0, 0.0, -TOP_RADIUS])
    slip[2] = 0.0
    # Of a unit of normal force: the force, and the angular acceleration.
    force = np.array([0.0, 0.0, 1.0]) - TOP_FRICTION * slip / max(float(np.linalg.norm(slip)), 1e-9)
    turning = np.cross(lever, force) / TOP_INERTIA
    # The acceleration of the centre of the ball, less that of the centre of mass; its height stays.
    whirling = np.cross(omega, np.cross(omega, center))
    normal = (G - whirling[2]) / (1.0 + float(np.cross(turning, center)[2]))
    alpha = normal * turning
    moving = normal * force[:2] + np.cross(alpha, center)[:2] + whirling[:2]
    return np.concatenate([np.cross(omega, axis), alpha, moving])
