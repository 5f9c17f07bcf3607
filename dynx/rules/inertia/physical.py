"""Physical consistency of inertia tensors, the checks of engines, and the nearest consistent tensor.

The principal moments are sums of two of three non-negative second moments of mass, so none is negative
and none exceeds the sum of the other two (Wensing, Kim and Slotine 2018, section II). Engines check this
in float64, each in its own way; a body on the edge, such as a thin plate, passes in one and not in another.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from itertools import combinations
from typing import Literal

import numpy as np

from dynx.engines.pybullet.inertia_checks import CACHE_SIZE, bullet_reading, tree_may_reject
from dynx.model.elements import Inertial
from dynx.rules.inertia.central import CentralInertia
from dynx.spatial.extended import FLOAT64_EPS, longdouble
from dynx.spatial.scalar import Array

MIN_MOMENT = 1e-14
"""Smallest principal moment [kg m^2] that MuJoCo accepts, unless the whole tensor is zero."""

ACCEPTED_MOMENT = 1.5 * MIN_MOMENT
"""Principal moment [kg m^2] that MuJoCo accepts whatever its rounding."""

MIN_MASS = 1e-15
"""Smallest mass [kg] of a moving body that MuJoCo accepts (mjMINVAL)."""

ROUNDING = 16.0 * FLOAT64_EPS
"""Bound on the rounding of a tensor relative to its largest moment; `dynx.load` uses the same bound."""

_ROTATION_ROUNDING = 4.0 * FLOAT64_EPS
"""Relative rounding of the moments of a rotated tensor. MuJoCo refused tensors whose triangle inequality
held with a margin of 0 to 2 eps."""

_MARGIN = 16.0 * FLOAT64_EPS
"""Relative distance from the bound at which corrected moments are placed."""

Fault = Literal["negative", "triangle"]
"""Fault of principal moments: one is negative, or one exceeds the sum of the others."""


@lru_cache(maxsize=CACHE_SIZE)
def principal_moments(inertial: Inertial) -> Array:
    """Return the principal moments (3,), smallest first, in long double; the array must not be changed."""
    return CentralInertia.of(inertial).moments()


@lru_cache(maxsize=CACHE_SIZE)
def fault_beyond_rounding(inertial: Inertial) -> Fault | None:
    """Find the fault of an inertial, if it exceeds rounding; None also for a tensor too small to matter, and
    for one without mass."""
    return None if inertial.mass == 0.0 else tensor_fault(inertial)


def tensor_fault(inertial: Inertial) -> Fault | None:
    """Find the fault of a tensor whatever the mass, as `fault_beyond_rounding` does for a body."""
    if float(np.max(np.abs(inertial.tensor))) < MIN_MOMENT:
        return None
    small, middle, large = principal_moments(inertial)
    rounding = ROUNDING * max(abs(small), abs(large))
    if small < -rounding:
        return "negative"
    return "triangle" if small + middle < large - rounding else None


@lru_cache(maxsize=CACHE_SIZE)
def is_borderline(inertial: Inertial, *, root: bool, on_fixed_joint: bool) -> bool:
    """Check whether an engine may refuse the inertial because of rounding alone.

    `root` says that no joint carries the link, `on_fixed_joint` that a fixed one does.
    """
    size = float(np.max(np.abs(inertial.tensor)))
    if (
        inertial.mass == 0.0
        or (size < MIN_MOMENT and size > 0.0)
        or fault_beyond_rounding(inertial) is not None
    ):
        return False
    small, middle, large = principal_moments(inertial)
    too_small_for_mujoco = small < MIN_MOMENT and bullet_reading(inertial).moments.any()  # DX111
    rotated = any(inertial.origin.rpy) or bool(inertial.ixy or inertial.ixz or inertial.iyz)
    if (
        rotated
        and small + middle - large < _ROTATION_ROUNDING * large
        and size > 0.0
        and not too_small_for_mujoco
    ):
        return True
    if bullet_reading(inertial).zeroed:
        return True
    return not root and tree_may_reject(inertial, on_fixed_joint=on_fixed_joint)


def moment_increase(inertial: Inertial, floor: float = 0.0) -> float:
    """Return the amount [kg m^2] to add to all three moments so that no check fails by rounding.

    It is a few units in the last place of the largest moment about the link's origin, too little to show in
    the equations of motion, or more where a moment would be below `floor` [kg m^2].
    """
    body = CentralInertia.of(inertial)
    size = max(float(np.max(np.abs(body.tensor))), float(np.max(np.diagonal(body.about_origin()))))
    small, middle, large = (float(value) for value in principal_moments(inertial))
    added = max(0.0, _MARGIN * size - min(small + middle - large, small))
    return max(added, floor - small)


def with_raised_moments(inertial: Inertial, floor: float = 0.0) -> Inertial:
    """Return the inertial with all moments raised by `moment_increase`."""
    added = moment_increase(inertial, floor)
    return replace(inertial, ixx=inertial.ixx + added, iyy=inertial.iyy + added, izz=inertial.izz + added)


def nearest_moments(moments: Array) -> Array:
    """Find the physical principal moments (3,) nearest to these by least squares, in the same order.

    The moments of a body are G s with second moments of mass s >= 0 and G = [[0,1,1],[1,0,1],[1,1,0]]. In the
    least-squares solution over s >= 0 some s are zero. All eight sets of zeros are tried; y = G s is the
    solution if no column of G has a positive product with x - y (Karush, Kuhn and Tucker). The tensor with
    these moments is the nearest in the Frobenius norm.
    """
    wanted = np.asarray(moments, dtype=float)
    G = np.ones((3, 3)) - np.eye(3)
    best, least = np.zeros(3), float(np.max(G.T @ wanted))
    for count in (1, 2, 3):
        for free in combinations(range(3), count):
            columns = G[:, list(free)]
            s = np.linalg.solve(columns.T @ columns, columns.T @ wanted)
            nearest = columns @ np.maximum(s, 0.0)
            fault = max(float(np.max(-s)), float(np.max(G.T @ (wanted - nearest))))
            if fault < least:
                best, least = nearest, fault
    return longdouble(best)
