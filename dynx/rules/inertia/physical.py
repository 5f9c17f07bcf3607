"""Which inertia tensors a rigid body can have, how far engines look, and the nearest one that they take.

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

from dynx.engines.pybullet.inertia_checks import MANY, read_by_bullet, tree_may_refuse
from dynx.model.elements import Inertial
from dynx.rules.inertia.central import CentralInertia
from dynx.spatial.extended import FLOAT64_EPS, longdouble
from dynx.spatial.scalar import Array

SMALLEST_MOMENT = 1e-14
"""[kg m^2] MuJoCo takes no smaller principal moment, unless the whole tensor is zero."""

ENOUGH = 1.5 * SMALLEST_MOMENT
"""[kg m^2] What MuJoCo takes for a moment, with room for its rounding."""

SMALLEST_MASS = 1e-15
"""[kg] MuJoCo takes no moving body that is lighter, and takes a smaller moment for none (mjMINVAL)."""

ROUNDING = 16.0 * FLOAT64_EPS
"""What rounding can do to a tensor, as a share of its largest moment; `dynx.load` draws the same line."""

_EDGE = 4.0 * FLOAT64_EPS
"""Turning a tensor by an angle rounds its moments by about this; MuJoCo was seen to refuse at 0 to 2 eps."""

_MARGIN = 16.0 * FLOAT64_EPS
"""How far inside the edge a body is put."""

Fault = Literal["negative", "triangle"]
"""Of principal moments: one is negative, or exceeds the sum of the others."""


@lru_cache(maxsize=MANY)
def principal_moments(inertial: Inertial) -> Array:
    """The principal moments (3,), smallest first, in long double; not to be written into."""
    return CentralInertia.of(inertial).moments()


@lru_cache(maxsize=MANY)
def clear_fault(inertial: Inertial) -> Fault | None:
    """What no body can have, by more than rounding; None also for what is too small to matter."""
    size = float(np.max(np.abs(inertial.tensor)))
    if inertial.mass == 0.0 or size < SMALLEST_MOMENT:
        return None
    small, middle, large = principal_moments(inertial)
    rounding = ROUNDING * max(abs(small), abs(large))
    if small < -rounding:
        return "negative"
    return "triangle" if small + middle < large - rounding else None


@lru_cache(maxsize=MANY)
def on_the_edge(inertial: Inertial, *, root: bool, welded: bool) -> bool:
    """Whether a body that rounding alone makes doubtful is, or may be, refused by an engine.

    `root` says that no joint carries the link, `welded` that a fixed one does.
    """
    size = float(np.max(np.abs(inertial.tensor)))
    if inertial.mass == 0.0 or (size < SMALLEST_MOMENT and size > 0.0) or clear_fault(inertial) is not None:
        return False
    small, middle, large = principal_moments(inertial)
    if small < SMALLEST_MOMENT and read_by_bullet(inertial).moments.any():
        # MuJoCo takes offence at something else (DX111).
        return read_by_bullet(inertial).zeroed or (not root and tree_may_refuse(inertial, welded=welded))
    turned = any(inertial.origin.rpy) or bool(inertial.ixy or inertial.ixz or inertial.iyz)
    if turned and small + middle - large < _EDGE * large and size > 0.0:
        return True
    if read_by_bullet(inertial).zeroed:
        return True
    return not root and tree_may_refuse(inertial, welded=welded)


def lift_inside(inertial: Inertial, floor: float = 0.0) -> float:
    """What to add to all three moments, so that no check fails by rounding [kg m^2].

    A few units in the last place of the largest moment about the link's origin, which is below what the
    equations of motion can show; more where a moment would be below `floor`.
    """
    body = CentralInertia.of(inertial)
    size = max(float(np.max(np.abs(body.tensor))), float(np.max(np.diagonal(body.about_origin()))))
    small, middle, large = (float(value) for value in principal_moments(inertial))
    added = max(0.0, _MARGIN * size - min(small + middle - large, small))
    return max(added, floor - small)


def lifted(inertial: Inertial, floor: float = 0.0) -> Inertial:
    """The inertial with all moments raised to where no check fails by rounding, and to `floor` at least."""
    added = lift_inside(inertial, floor)
    return replace(inertial, ixx=inertial.ixx + added, iyy=inertial.iyy + added, izz=inertial.izz + added)


def nearest_moments(moments: Array) -> Array:
    """The physical principal moments (3,) nearest to these, in the least-squares sense, in the same order.

    Moments of a body are G s with second moments of mass s >= 0 and G = [[0,1,1],[1,0,1],[1,1,0]]. Of the
    least squares over s >= 0 some s are zero, and it is told by its optimality: y = G s is the answer if no
    column of G has a positive product with x - y (Karush, Kuhn and Tucker). All eight sets of zeros are
    tried. For the tensor it is the nearest in the Frobenius norm.
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
