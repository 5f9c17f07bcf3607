"""Bounds on how far two robots that are the same to a tolerance are apart, over all states within limits.

With l twice the reach, n coordinates and c the largest sum of mimic multipliers: an axis that is off by an
angle e_R in all and by a distance e_p in all moves a point by at most ``d = e_p + l e_R``, and changes a
column of a Jacobian by as much per unit of velocity. Entries of the mass matrix are sums over bodies of
``J' I J``, accelerations at unit velocity and acceleration are at most ``l (sqrt(n) + 2 n)`` plus gravity
(triangle inequality in both). The bounds are far from tight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dynx.model.elements import Limits
from dynx.model.mechanism import ROOT
from dynx.same.decimals import rounded
from dynx.same.fit import Fit
from dynx.same.skeleton import float_inertia


@dataclass(frozen=True)
class Bounds:
    """Largest differences over all positions within limits, with |v| <= 1 and |a| <= 1.

    `position` [m] and `rotation` [rad] are those of any link, `mass_matrix` of an entry, `torque` of an entry
    of inverse dynamics [N m or N]. They are infinite where a joint without limits slides along another axis.
    """

    position: float
    rotation: float
    mass_matrix: float
    torque: float


def bounds(found: Fit, unseen: frozenset[int]) -> Bounds:
    """Return the bounds of a fit of robots that are the same; the differences of inertias of the bodies
    `unseen` have no effect."""
    ours = found.ours
    reach = 2.0 * ours.reach
    shift = angle = 0.0
    for each in found.bodies:
        if each.ours == ROOT:
            continue
        kind = ours.kinds[each.ours]
        off, travel = 2.0 * each.axis, _travel(ours.joints[each.ours].limits)
        coupled = _product(each.scale, travel) + each.offset
        if kind == "ball":
            shift += each.line
        elif kind == "revolute":
            angle += off + coupled
            shift += 2.0 * each.line + off * reach
        else:
            shift += _product(off, travel) + coupled
        angle += each.turn
        shift += each.shift
    coupling = ours.mechanism.coupling
    c = 1.0 if coupling is None else float(np.max(np.sum(np.abs(coupling.matrix()), axis=0), initial=1.0))
    moved = shift + reach * angle
    column = max(reach, 1.0) * c
    masses = sum(abs(float(inertia.mass)) for inertia in ours.inertias.values())
    moments = sum(
        3.0 * float(np.max(np.abs(inertia.rotational_inertia))) for inertia in ours.inertias.values()
    )
    changed = 0.0
    for each in found.bodies:
        if each.ours in unseen or each.inertia is None:
            continue
        difference = float_inertia(each.inertia)
        changed += (
            abs(float(difference.mass)) * column**2
            + 2.0 * float(np.linalg.norm(difference.first_moment)) * column * c
            + 3.0 * float(np.max(np.abs(difference.rotational_inertia))) * c**2
        )
    by_motion = 2.0 * c * (masses * column * moved + moments * c * angle)
    n = max(ours.model.nv, 1)
    gravity = float(np.linalg.norm(rounded(ours.mechanism.gravity)))
    accelerations = math.sqrt(n) + 2.0 * n + gravity / max(reach, 1e-300)
    return Bounds(
        moved, angle, changed + by_motion, accelerations * max(reach, 1.0) * 2.0 * (changed + by_motion)
    )


def _travel(limits: Limits) -> float:
    """Return the largest distance of a position from 0 [rad or m]."""
    return max(abs(limits.lower), abs(limits.upper))


def _product(error: float, travel: float) -> float:
    return 0.0 if error == 0.0 else error * travel
