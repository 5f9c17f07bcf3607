"""Scales of the inertial parameters of a body, by which a difference is divided."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dynx.spatial.inertia import RigidInertia
from dynx.spatial.so3 import skew


class Whole(NamedTuple):
    """Mass [kg] and reach [m] of a whole robot: the scales of a body that has none of its own."""

    mass: float
    length: float


POINT = 1e-12
"""Ratio of the central moment of a body to mass times distance squared below which it is a point mass."""


def inertia_ratio(difference: RigidInertia, inertia: RigidInertia, whole: Whole) -> float:
    """Return the largest difference of a parameter, relative to the scale of the body's inertia.

    Mass is divided by the mass m; first moment by m times the larger of the distance of the centre of mass
    from the origin and the radius of gyration; the tensor, about the centre of mass, by the largest moment
    there. A body without mass has the scales of the whole robot.
    """
    dm = float(difference.mass)
    dh = np.asarray(difference.first_moment, dtype=float)
    dI = np.asarray(difference.rotational_inertia, dtype=float)
    if dm == 0.0 and not dh.any() and not dI.any():
        return 0.0
    mass = float(inertia.mass)
    tensor = np.asarray(inertia.rotational_inertia, dtype=float)
    if mass == 0.0:
        moment = float(np.max(np.abs(tensor)))
        length = whole.length
        return max(
            _ratio(abs(dm), whole.mass),
            _ratio(float(np.max(np.abs(dh))), whole.mass * length),
            _ratio(float(np.max(np.abs(dI))), moment or whole.mass * length**2),
        )
    c = np.asarray(inertia.first_moment, dtype=float) / mass
    C, central = skew(c), _central_moment(inertia)
    mass, size = abs(mass), extent(inertia, whole)
    # About the centre of mass: r = r' + c.
    dh_central = dh - dm * c
    D = skew(dh)
    dI_central = dI + C @ D + D @ C - dm * (C @ C)
    moment = central if central > POINT * mass * size**2 else mass * size**2
    return max(
        abs(dm) / mass,
        float(np.linalg.norm(dh_central)) / (mass * size),
        float(np.max(np.abs(dI_central))) / moment,
    )


def extent(inertia: RigidInertia, whole: Whole) -> float:
    """Return the larger of the distance [m] of a body's centre of mass from the origin and its radius of
    gyration; the reach of the robot where both are 0. The body has mass."""
    mass = float(inertia.mass)
    distance = float(np.linalg.norm(np.asarray(inertia.first_moment, dtype=float) / mass))
    return max(distance, float(np.sqrt(_central_moment(inertia) / abs(mass)))) or whole.length


def _central_moment(inertia: RigidInertia) -> float:
    H = skew(np.asarray(inertia.first_moment, dtype=float))
    tensor = np.asarray(inertia.rotational_inertia, dtype=float)
    return float(np.max(np.abs(tensor + H @ H / float(inertia.mass))))


def _ratio(part: float, size: float) -> float:
    if part == 0.0:
        return 0.0
    return part / size if size > 0.0 else float("inf")
