"""Bounds on how far two robots that are the same to a tolerance are apart, over all states within limits.

With the longest path r from the root along the links, axes that are off by an angle e_R and by a distance
e_p in all move a point by at most ``d = e_p + 2 r e_R``. Sliding axes differ by at most an angle e_a, mimic
multipliers by e_c in all; c is the largest sum of these, and L = max(2 r, 1).

A column of a Jacobian is at most L c (linear) and c (angular), and differs by at most d_v and d_w, with
``d_v = c (e_p + e_a) + L d_w`` and ``d_w = c e_R + e_c``. Entries of the mass matrix are sums over bodies of
``J' I J``. At unit velocity and acceleration of n coordinates, accelerations are at most L (s + 2 s^2) plus
gravity, with ``s = c sqrt(n)`` (triangle inequality in all). The bounds are far from tight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dynx.model.mechanism import ROOT
from dynx.same.decimals import rounded
from dynx.same.fit import Fit
from dynx.same.skeleton import Skeleton, float_inertia
from dynx.spatial.inertia import RigidInertia


@dataclass(frozen=True)
class Bounds:
    """Largest differences over all positions within limits, with |v| <= 1 and |a| <= 1.

    `position` [m] is that of any point of a body within the reach of the robot, `rotation` [rad] of any body,
    `mass_matrix` of an entry, `torque` of an entry of inverse dynamics [N m or N]. They are infinite where a
    difference grows without limit with the position of a joint without limits.
    """

    position: float
    rotation: float
    mass_matrix: float
    torque: float


def bounds(found: Fit, unseen: frozenset[int]) -> Bounds:
    """Return the bounds of a fit of robots that are the same; the differences of inertias of the bodies
    `unseen` have no effect."""
    ours = found.ours
    travels = _travels(ours)
    r = _longest_path(ours, travels)
    e_R = e_p = e_a = e_c = 0.0
    for each in found.bodies:
        if each.ours == ROOT:
            continue
        kind = ours.kinds[each.ours]
        # An arc is at most pi / 2 times its sine, and half a turn doubles the angle between two axes.
        tilt = math.pi * each.axis
        mimic = ours.joints[each.ours].mimic
        driver = each.ours if mimic is None else ours.number[mimic.joint]
        coupled = _product(each.scale, travels[driver]) + each.offset
        if kind == "prismatic":
            e_p += _product(tilt, travels[each.ours]) + coupled
            e_a = max(e_a, tilt)
        else:
            e_R += tilt + coupled
            e_p += 2.0 * each.line + tilt * each.frame_shift
        e_R += each.turn
        e_p += each.shift
        e_c += each.scale
    coupling = ours.mechanism.coupling
    c = 1.0 if coupling is None else float(np.max(np.sum(np.abs(coupling.matrix()), axis=0), initial=1.0))
    L = max(2.0 * r, 1.0)
    d = e_p + _product(e_R, 2.0 * r)
    d_w = c * e_R + e_c
    d_v = c * (e_p + e_a) + _product(d_w, L)
    by_inertia = by_motion = 0.0
    for each in found.bodies:
        mass, moment, tensor = _magnitudes(ours.inertias[each.ours])
        if each.inertia is not None:
            off = _magnitudes(float_inertia(each.inertia))
            mass, moment, tensor = mass + off[0], moment + off[1], tensor + off[2]
            if each.ours not in unseen:
                by_inertia += c**2 * (_product(off[0], L, L) + 2.0 * _product(off[1], L) + off[2])
        by_motion += 2.0 * c * (_product(mass, d_v, L) + _product(moment, d_v))
        by_motion += 2.0 * c * (_product(moment, d_w, L) + _product(tensor, d_w))
    s = c * math.sqrt(ours.model.nv)
    gravity = float(np.linalg.norm(rounded(ours.mechanism.gravity)))
    # A term of a torque has three factors that differ, a term of the mass matrix two.
    torque = (s + 2.0 * s**2 + gravity / L) / c * (by_inertia + 1.5 * by_motion)
    return Bounds(d, e_R, by_inertia + by_motion, torque)


def _travels(ours: Skeleton) -> list[float]:
    """Return the largest distance of the position of each joint from 0 [rad or m], that of a mimic joint
    by the limits of its driver."""
    own = [max(abs(joint.limits.lower), abs(joint.limits.upper)) for joint in ours.joints]
    return [
        travel
        if joint.mimic is None
        else _product(abs(joint.mimic.multiplier), own[ours.number[joint.mimic.joint]])
        + abs(joint.mimic.offset)
        for joint, travel in zip(ours.joints, own, strict=True)
    ]


def _longest_path(ours: Skeleton, travels: list[float]) -> float:
    """Return the length [m] of the longest path along the links from the root to a joint or a link, with
    prismatic joints at the end of their range."""
    path = {ROOT: 0.0}
    for number, body in enumerate(ours.bodies):
        slide = travels[number] if ours.kinds[number] == "prismatic" else 0.0
        path[number] = path[body.parent] + float(np.linalg.norm(ours.placements[number][:3, 3])) + slide
    return max(path[frame.body] + float(np.linalg.norm(rounded(frame.p))) for frame in ours.frames)


def _magnitudes(inertia: RigidInertia) -> tuple[float, float, float]:
    """Return those of mass [kg], first moment [kg m] and rotational inertia [kg m^2]."""
    return (
        abs(float(inertia.mass)),
        float(np.linalg.norm(inertia.first_moment)),
        float(np.linalg.norm(inertia.rotational_inertia)),
    )


def _product(*factors: float) -> float:
    """Return the product; 0 times an infinite travel is 0, because nothing differs or nothing moves."""
    return 0.0 if 0.0 in factors else math.prod(factors)
