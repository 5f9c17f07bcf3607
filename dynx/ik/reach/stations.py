"""A chain as stations: points on the axes of its rotating joints, with what lies between them.

A point on the axis of a joint is fixed in both links of the joint. So the distance of points on neighbouring
axes is constant, whichever points are chosen; prismatic joints between them change it within their travel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.ik.reach.intervals import Interval
from dynx.model import Model
from dynx.model.mechanism import joint_motion
from dynx.rbd.kinematics import ancestry
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotate

Slide = tuple[Floats, Interval]


@dataclass(frozen=True, eq=False)
class Stations:
    """The n rotating joints of a chain from the world to a frame, with all joints at zero, in world axes."""

    joints: tuple[str, ...]
    axes: Floats
    """Unit directions (n, 3)."""
    points: Floats
    """A point on each axis (n, 3) [m]."""
    turns: tuple[Interval, ...]
    """Position limits [rad]."""
    slides: tuple[tuple[Slide, ...], ...]
    """Directions and travels [m] of the prismatic joints before each rotating joint, and after the last."""
    R_zero: Floats
    """Rotation of the frame (3, 3)."""
    p_zero: Floats
    """Position of its origin (3,) [m]."""


def stations_to(model: Model, frame: str) -> Stations:
    """Return the chain from the world to a frame of a model with a fixed base."""
    mechanism = model.mechanism
    placed = mechanism.frames[model.frame_index(frame)]
    R, p = np.eye(3), np.zeros(3)
    joints: list[str] = []
    axes: list[Floats] = []
    points: list[Floats] = []
    turns: list[Interval] = []
    slides: list[list[Slide]] = [[]]
    for index in reversed(ancestry(mechanism, placed.body)):
        body = mechanism.bodies[index]
        origin, axis = p + rotate(R, body.p), rotate(R @ body.R, body.axis)
        limits = _joint_range(model, body.joint)
        if body.revolute:
            joints.append(body.joint)
            axes.append(axis)
            points.append(origin)
            turns.append(limits)
            slides.append([])
        else:
            slides[-1].append((axis, limits))
        R_joint, p_joint = joint_motion(body, np.asarray(0.0))
        R, p = R @ R_joint, p + rotate(R, p_joint)
    return Stations(
        tuple(joints),
        np.array(axes).reshape(-1, 3),
        np.array(points).reshape(-1, 3),
        tuple(turns),
        tuple(tuple(each) for each in slides),
        R @ placed.R,
        p + rotate(R, placed.p),
    )


def _joint_range(model: Model, name: str) -> Interval:
    """Return the position limits of a joint; of a mimic joint those that follow from its driver."""
    joint = model.joint(name)
    follows: Any = joint.mimic
    at = model.joint_names.index(name if follows is None else follows.joint) + (7 if model.floating else 0)
    low, high = float(model.lower[at]), float(model.upper[at])
    if follows is None:
        return Interval(low, high)
    if follows.multiplier == 0.0:
        return Interval(follows.offset, follows.offset)
    ends = sorted(follows.multiplier * limit + follows.offset for limit in (low, high))
    return Interval(ends[0], ends[1])


def points_of_least_length(stations: Stations, end: Floats | None) -> Floats:
    """Return points (n, 3) on the axes with the least sum of distances, to `end` (3,) as well if it is given.

    Any points give a valid bound; these give a small one (iteratively reweighted least squares).
    """
    n = len(stations.joints)
    middle = [
        sum((t * 0.5 * (i.low + i.high) for t, i in each if math.isfinite(i.low + i.high)), np.zeros(3))
        for each in stations.slides
    ]
    shift = np.zeros(n)
    fixed = [] if end is None else [end]
    for _ in range(60):
        points = [*(stations.points + shift[:, None] * stations.axes), *fixed]
        rows, right = [], []
        for k in range(len(points) - 1):
            gap = points[k + 1] - points[k] + middle[k + 1]
            scale = 1.0 / math.sqrt(float(np.linalg.norm(gap)) + 1e-9)
            A = np.zeros((3, n))
            A[:, k] = -stations.axes[k]
            if k + 1 < n:
                A[:, k + 1] = stations.axes[k + 1]
            rows.append(scale * A)
            right.append(-scale * gap)
        if not rows:
            break
        step = np.linalg.lstsq(np.concatenate(rows), np.concatenate(right), rcond=1e-9)[0]
        shift += step
        if np.abs(step).max() < 1e-9:
            break
    return np.asarray(stations.points + shift[:, None] * stations.axes)
