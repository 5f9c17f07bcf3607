"""Rigid transforms that may map a whole floating robot at its zero positions onto another one, or what is
below a ball joint.

Where no body determines its frame alone, as in a robot of slides and links without mass, the joint axes and
the centres of mass of all bodies together do. Directions of axes have no sign, slides no place.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from dynx.model.mechanism import ROOT
from dynx.same.scales import Whole
from dynx.same.skeleton import Skeleton
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import cross, rotation_about, skew

PARALLEL = 1e-12
"""Sine of an angle [rad] below which two directions are parallel. Of a turn about directions that are nearly
parallel, even what rounding leaves of it moves none of them."""

APART = 1e-5
"""Share of the robot's reach below which two places count as one."""

ISOLATED = 1e-4
"""Relative difference of a principal moment from the others from which on its axis is a direction."""


@dataclass
class _Features:
    """Axes and places of a robot at its zero positions, in the frame of its first body, with the same keys in
    both robots: joint axes and principal axes, which have no sign; directions with a sign; and places, each
    with the projection (3, 3) onto the shifts that it determines."""

    axes: dict[object, Floats] = field(default_factory=dict)
    principal: dict[object, Floats] = field(default_factory=dict)
    ways: dict[object, Floats] = field(default_factory=dict)
    places: dict[object, tuple[Floats, Floats]] = field(default_factory=dict)


def arrangements(ours: Skeleton, theirs: Skeleton, pairs: list[tuple[int, int]]) -> Iterator[Floats]:
    """Yield poses (4, 4) of the frame of the first body of `theirs` in that of `ours` from all bodies.

    `pairs` are the bodies that may be counterparts, parents first: the roots and others, or the bodies of two
    ball joints and others below them. Of ball joints among the others only the centre counts. Inertia that
    may belong to the parent of a joint may be split otherwise in `theirs`; the bodies' own inertias are
    tried second.
    """
    for grouped in (True, False):
        first = _features(ours, [a for a, _ in pairs], grouped)
        second = _features(theirs, [b for _, b in pairs], grouped)
        for R in _rotations(first, second):
            D = homogeneous(R, _shift(first, second, R))
            yield _refined(first, second, D, ours.reach) if _is_near(first, second, D, ours.reach) else D


def _features(skeleton: Skeleton, order: list[int], grouped: bool) -> _Features:
    found, poses = _Features(), _zero_poses(skeleton, order)
    inertias: Mapping[int, RigidInertia] = skeleton.grouped if grouped else skeleton.inertias
    for key, body in enumerate(order):
        T, inertia = poses[body], inertias[body]
        kind = None if body == ROOT else skeleton.kinds[body]
        if kind == "ball":
            found.places[key, "centre"] = T[:3, 3], np.eye(3)
            if key == 0:
                _add_way(found, key, inertia.first_moment, skeleton.whole.mass * skeleton.reach)
                about_center = RigidInertia(np.zeros(()), np.zeros(3), inertia.rotational_inertia)
                for number, axis in _principal_axes(about_center, skeleton.whole):
                    found.principal[key, number] = axis
            continue
        if kind is not None and key > 0:
            axis = found.axes[key] = T[:3, :3] @ skeleton.axes[body]
            if kind == "revolute":
                found.places[key, "line"] = T[:3, 3], np.eye(3) - np.outer(axis, axis)
        mass = float(inertia.mass)
        if grouped and kind == "revolute":
            # The parent may have the mass, and what of the first moment is along the axis.
            off = T[:3, :3] @ inertia.first_moment
            _add_way(found, key, off - axis * (axis @ off), skeleton.whole.mass * skeleton.reach)
        elif mass > 0.0:
            found.places[key, "centre"] = T[:3, :3] @ (inertia.first_moment / mass) + T[:3, 3], np.eye(3)
        if kind is None or not grouped:
            for number, axis in _principal_axes(inertia, skeleton.whole):
                found.principal[key, number] = T[:3, :3] @ axis
    _add_offsets(found, skeleton.reach)
    return found


def _principal_axes(inertia: RigidInertia, whole: Whole) -> Iterator[tuple[int, Floats]]:
    """Yield the principal axes (3,) that no other one can be exchanged for, numbered by their moments; none
    of a tensor that is rounding beside the whole robot."""
    mass, H = float(inertia.mass), skew(inertia.first_moment)
    moments, axes = np.linalg.eigh(inertia.rotational_inertia + (H @ H / mass if mass else 0.0))
    scale = float(np.max(np.abs(moments)))
    if scale <= PARALLEL * whole.mass * whole.length**2:
        return
    for number in range(3):
        others = np.delete(moments, number)
        if float(np.min(np.abs(others - moments[number]))) > ISOLATED * scale:
            yield number, axes[:, number]


def _zero_poses(skeleton: Skeleton, order: list[int]) -> dict[int, Floats]:
    """Return the poses (4, 4) of bodies, parents first, in the frame of the first one."""
    poses = {order[0]: np.eye(4)}
    for number in order[1:]:
        poses[number] = poses[skeleton.bodies[number].parent] @ skeleton.placements[number]
    return poses


def _add_offsets(found: _Features, reach: float) -> None:
    """Add the directions from the first centre of mass, or else the first line, to all other places: only
    what both places determine of them."""
    keys = sorted(found.places, key=lambda key: str(key[1]) if isinstance(key, tuple) else "")
    if not keys:
        return
    start, known = found.places[keys[0]]
    for key in keys[1:]:
        place, determined = found.places[key]
        if float(np.max(np.abs(known @ determined - determined @ known))) <= PARALLEL:
            _add_way(found, ("offset", key), known @ determined @ (place - start), reach)


def _add_way(found: _Features, key: object, way: Floats, scale: float) -> None:
    length = float(np.linalg.norm(way))
    if length > APART * scale:
        found.ways[key] = way / length


def _rotations(first: _Features, second: _Features) -> Iterator[Floats]:
    """Yield the rotations that map two directions of the second robot onto those of the first: joint axes are
    the first, so that they keep their signs if they can."""
    directions = [
        (mine[key], other[key], signs)
        for mine, other, signs in (
            (first.axes, second.axes, (1.0, -1.0)),
            (first.ways, second.ways, (1.0,)),
            (first.principal, second.principal, (1.0, -1.0)),
        )
        for key in mine
        if key in other
    ]
    if not directions:
        yield np.eye(3)
        return
    u, x, u_signs = directions[0]
    sines = [
        min(float(np.linalg.norm(cross(u, v))), float(np.linalg.norm(cross(x, y)))) for v, y, _ in directions
    ]
    best = int(np.argmax(sines))
    if sines[best] <= PARALLEL:
        for sign in u_signs:
            yield _axes(u, _across(u)) @ _axes(sign * x, _across(x)).T
        return
    v, y, v_signs = directions[best]
    for one, other in product(u_signs, v_signs):
        yield _axes(u, v) @ _axes(one * x, other * y).T


def _across(u: Floats) -> Floats:
    return np.asarray(np.eye(3)[int(np.argmin(np.abs(u)))])


def _axes(u: Floats, v: Floats) -> Floats:
    """Return the rotation (3, 3) whose first axis is u, and whose third is normal to u and v."""
    normal = cross(u, v)
    normal = normal / np.linalg.norm(normal)
    return np.stack([u, cross(normal, u), normal], axis=1)


def _shift(first: _Features, second: _Features, R: Floats) -> Floats:
    """Return the smallest shift (3,) by which the turned places of the second robot are nearest to those of
    the first."""
    rows, wanted = [np.zeros((1, 3))], [np.zeros(1)]
    for key, (place, determined) in first.places.items():
        if key in second.places:
            rows.append(determined)
            wanted.append(determined @ (place - R @ second.places[key][0]))
    return np.asarray(np.linalg.lstsq(np.concatenate(rows), np.concatenate(wanted), rcond=PARALLEL)[0])


NEAR = 1e-3
"""Misfit of places, relative to the robot's reach, up to which a frame is refined."""

REFINEMENTS = 3
"""Number of Newton steps; the misfit is squared by each."""


def _is_near(first: _Features, second: _Features, D: Floats, reach: float) -> bool:
    """Check whether a frame fits, but for what nearly parallel axes leave open in it."""
    misfit, _ = _system(first, second, D, reach)
    return bool(np.max(np.abs(misfit), initial=0.0) <= NEAR)


def _refined(first: _Features, second: _Features, D: Floats, reach: float) -> Floats:
    """Return the frame near to D (4, 4) in which axes and places of both robots fit best: a direction that
    follows from nearly parallel axes has few digits, and the places of the axes have the others."""
    for _ in range(REFINEMENTS):
        misfit, slopes = _system(first, second, D, reach)
        step = np.linalg.lstsq(slopes, -misfit, rcond=PARALLEL)[0]
        turn = float(np.linalg.norm(step[:3]))
        R = rotation_about(step[:3] / turn, np.asarray(turn)) if turn > 0.0 else np.eye(3)
        D = homogeneous(R @ D[:3, :3], D[:3, 3] + reach * step[3:])
    return D


def _system(first: _Features, second: _Features, D: Floats, reach: float) -> tuple[Floats, Floats]:
    """Return the misfits (m,) of axes and places, and their derivatives (m, 6) by a turn of the second robot
    [rad] and by a shift per reach."""
    misfits, slopes = [np.zeros(1)], [np.zeros((1, 6))]
    R, p = D[:3, :3], D[:3, 3]
    for key, axis in first.axes.items():
        if key in second.axes:
            other = R @ second.axes[key]
            misfits.append(cross(axis, other))
            slopes.append(
                np.hstack([float(axis @ other) * np.eye(3) - np.outer(other, axis), np.zeros((3, 3))])
            )
    for key, (place, determined) in first.places.items():
        if key in second.places:
            turned = R @ second.places[key][0]
            misfits.append(determined @ (turned + p - place) / reach)
            slopes.append(np.hstack([-determined @ skew(turned) / reach, determined]))
    return np.concatenate(misfits), np.concatenate(slopes)
