"""Forces of the lander's engines and of the wind, as generalised forces on x, z and the angle.

Gymnasium applies impulses of one step at points of the body; here each is a force during that step, which
changes the velocity equally. Points and moments are relative to the lander's origin, about which its angle
turns; moments are positive counterclockwise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from dynx.envs.tasks.lunar_lander.craft import CENTER, SCALE

MAIN_POWER, SIDE_POWER = 13.0, 0.6
"""Impulse [N s] of an engine for each metre from the centre to the nozzle."""
MAIN_NOZZLE = 4.0 / SCALE
"""Distance of the main engine's nozzle below the origin [m]."""
SIDE_AWAY, SIDE_HEIGHT, SIDE_SHIFT = 12.0 / SCALE, 14.0 / SCALE, 17.0 / SCALE
"""Place of the nozzles of the side engines [m]. Gymnasium has both 14 and 17, so that the place in the body
depends on the angle."""

Planar = tuple[float, float, float]
"""Force along x and z [N], moment about the origin of the lander [N m]."""


NO_FORCE: Planar = (0.0, 0.0, 0.0)


def added(*forces: Planar) -> Planar:
    """Return the sum of forces and moments."""
    fx, fz, moment = map(sum, zip(*forces, strict=True))
    return fx, fz, moment


def main_thrust(angle: float, power: float, dispersion: Sequence[float], dt: float) -> Planar:
    """Return the force of the main engine with a power from 0.5 to 1; `dispersion` (2,) moves its nozzle
    [m]."""
    sine, cosine = math.sin(angle), math.cos(angle)
    down, aside = MAIN_NOZZLE + 2.0 * dispersion[0], dispersion[1]
    scale = MAIN_POWER * power / dt
    # The force points from the nozzle to the origin, so that it has no moment about it.
    return -scale * (sine * down - cosine * aside), scale * (cosine * down + sine * aside), 0.0


def side_thrust(angle: float, power: float, dispersion: Sequence[float], dt: float) -> Planar:
    """Return the force of a side engine: of the left one (power from -1 to -0.5), or the right one."""
    sine, cosine = math.sin(angle), math.cos(angle)
    aside = 3.0 * dispersion[1] + math.copysign(SIDE_AWAY, power)
    ox, oz = sine * dispersion[0] - cosine * aside, -cosine * dispersion[0] - sine * aside
    x, z = ox - sine * SIDE_SHIFT, oz + cosine * SIDE_HEIGHT
    scale = SIDE_POWER * abs(power) / dt
    fx, fz = -scale * ox, -scale * oz
    return fx, fz, x * fz - z * fx


def force_at_center(angle: float, fx: float, fz: float) -> Planar:
    """Return a force on the centre of mass of the body."""
    return fx, fz, -CENTER * (math.sin(angle) * fz + math.cos(angle) * fx)


def gust(index: int, power: float) -> float:
    """Return the wind [N] or its moment [N m] in a step: tanh of two sines that never repeat together."""
    return math.tanh(math.sin(0.02 * index) + math.sin(math.pi * 0.01 * index)) * power
