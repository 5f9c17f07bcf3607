"""Closed forms of impacts, and the one of several repetitions that is farthest from them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

SPREAD = 0.8e-3
"""Difference [m] between the distances at which bodies start that touch one after the other.

At 1 m/s bodies that start at five distances touch at evenly spaced moments within steps of 4, 2 and 1 ms.
"""


def farthest(measured: Iterable[float], exact: float) -> float:
    """Return the number of several that is farthest from the exact one."""
    return max(measured, key=lambda value: abs(value - exact))


def speeds_after_collision(
    m1: float, m2: float, v1: float, v2: float, restitution: float
) -> tuple[float, float]:
    """Return the speeds of two bodies after a central impact: momentum is conserved, and the bodies separate
    at the speed of their approach times the restitution."""
    center = (m1 * v1 + m2 * v2) / (m1 + m2)
    impulse = restitution * (v1 - v2) * m1 * m2 / (m1 + m2)
    return center - impulse / m1, center + impulse / m2


class Throw(NamedTuple):
    """A ball that meets the ground, with the coefficients of the impact."""

    speed: float
    """Speed along the ground [m/s]."""
    backspin: float
    """Speed at which backspin moves the lowest point of the surface forward, relative to the centre [m/s]."""
    fall: float
    """Speed towards the ground [m/s]."""
    friction: float
    restitution: float


def after_bounce(throw: Throw) -> tuple[float, float]:
    """Return the speed along the ground and the backspin [m/s] of a homogeneous ball after an impact.

    The normal impulse per mass is (1 + e) times the speed of the fall. Friction opposes the slip of the
    lowest point in proportion to it until the slip is zero, which takes 2/7 of the slip for the moment of
    inertia 2/5 m r^2.
    """
    slip = throw.speed + throw.backspin
    grip = 2.0 / 7.0 * abs(slip)
    impulse = min(throw.friction * (1.0 + throw.restitution) * throw.fall, grip)
    impulse = impulse if slip > 0.0 else -impulse
    return throw.speed - impulse, throw.backspin - 2.5 * impulse
