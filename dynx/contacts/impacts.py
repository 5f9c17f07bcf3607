"""Closed forms of impacts, and the error of several repetitions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

CONTACT_DELAYS = tuple(0.8e-3 * k for k in range(5))
"""Delays [s] of bodies that touch at different moments, evenly spaced within steps of 4, 2 and 1 ms."""


def farthest(measured: Iterable[float], exact: float) -> float:
    """Return that one of several values which is farthest from the exact value."""
    return max(measured, key=lambda value: abs(value - exact))


def rms_deviation(measured: Sequence[float], exact: float) -> float:
    """Return the root mean square of the errors of several values."""
    return math.sqrt(sum((value - exact) ** 2 for value in measured) / len(measured))


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

    @property
    def slips(self) -> bool:
        """True if the ball still slips when it leaves the ground."""
        return self.friction * (1.0 + self.restitution) * self.fall < self.sticking_impulse

    @property
    def sticking_impulse(self) -> float:
        """Impulse of friction per mass that ends the slip [m/s]: 2/7 of the slip, for the moment of inertia
        2/5 m r^2 of a homogeneous ball."""
        return 2.0 / 7.0 * abs(self.speed + self.backspin)


def after_bounce(throw: Throw) -> tuple[float, float]:
    """Return the speed along the ground and the backspin [m/s] of a homogeneous ball after an impact.

    The normal impulse per mass is (1 + e) times the speed of the fall. Friction opposes the slip of the
    lowest point, in proportion to it, until the slip is zero.
    """
    impulse = min(throw.friction * (1.0 + throw.restitution) * throw.fall, throw.sticking_impulse)
    impulse = math.copysign(impulse, throw.speed + throw.backspin)
    return throw.speed - impulse, throw.backspin - 2.5 * impulse
