"""The greatest distance that a frame can have from its chain's first axis, by the triangle inequality.

Points on the axes of two neighbouring joints keep their distance, but for the travel of prismatic joints
between them. So the sum of these distances bounds how far the last point gets from the first, at every
configuration. A target beyond it is out of reach.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from dynx.ik.problem import Problem, Requirement
from dynx.model.mechanism import joint_motion
from dynx.model.model import Model
from dynx.rbd.kinematics import ancestry
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotate

_RELATIVE_ROUNDING = 1e-9
"""Rounding of a distance relative to its magnitude, above that of forward kinematics."""

_MAX_PASSES = 60
"""Most passes of the search for points that give a small bound."""

_Slide = tuple[Floats, float, float]
"""Direction (3,) of a prismatic joint, and its least and greatest position [m]."""


@dataclass(frozen=True, eq=False)
class MaxReach:
    """The greatest distance [m] of a point of a frame from a fixed point (3,), and the name of that."""

    start: Floats
    name: str
    most: float

    def sentence(self, value: float) -> str:
        """State that a target this far [m] from the start is out of reach."""
        return f"it is {value:.6g} m from {self.name}; the chain reaches at most {self.most:.6g} m"


def proofs(problem: Problem, model: Model, unreached: NDArray[np.bool_]) -> NDArray[np.object_]:
    """Return a sentence (count,) for each target that is farther than the frame reaches; others have an empty
    one.

    Only those `unreached` (count,) are examined. A model with a floating base reaches everywhere.
    """
    found = np.full(problem.count, "", dtype=object)
    if model.floating or not unreached.any():
        return found
    at = np.flatnonzero(unreached)
    for requirement in problem.requirements:
        several = len(problem.requirements) > 1
        for index, sentence in _of_frame(model, requirement, problem.batch, at[found[at] == ""]).items():
            found[index] = f"{requirement.frame}: {sentence}" if several else sentence
    return found


def proof_of(model: Model, requirement: Requirement, number: int) -> str:
    """Return the sentence that proves target `number` of a requirement (n,) out of reach; empty without."""
    if model.floating:
        return ""
    at = np.array([number], dtype=np.intp)
    return _of_frame(model, requirement, requirement.targets.batch, at).get(number, "")


def _of_frame(
    model: Model, requirement: Requirement, batch: tuple[int, ...], at: NDArray[np.intp]
) -> dict[int, str]:
    """Return sentences by index, for the targets with the indices `at`."""
    positions, slack = requirement.targets.positions, _position_slack(requirement)
    if positions is None or not math.isfinite(slack):
        return {}
    point = (0.0, 0.0, 0.0) if requirement.point is None else tuple(requirement.point.tolist())
    reach = frame_reach(model, requirement.frame, point)
    wanted = np.broadcast_to(positions, (*batch, 3)).reshape(-1, 3)[at]
    distances = np.linalg.norm(wanted - reach.start, axis=-1)
    beyond = distances - reach.most > slack + _RELATIVE_ROUNDING * (1.0 + distances)
    return {int(at[k]): reach.sentence(float(distances[k])) for k in np.flatnonzero(beyond).tolist()}


def _position_slack(requirement: Requirement) -> float:
    """Return the greatest distance [m] from a target that is reached; infinite if an axis is free."""
    axes = requirement.axes
    if axes is None:
        return requirement.tolerances.position_tolerance
    if not all(axes.weights[:3]):
        return math.inf
    if axes.position_tolerances is None:
        return requirement.tolerances.position_tolerance
    return math.hypot(*axes.position_tolerances)


ZERO = np.zeros(())
"""Position of a joint."""


@lru_cache(maxsize=64)
def frame_reach(model: Model, frame: str, point: tuple[float, float, float]) -> MaxReach:
    """Return the reach of a point (3,) [m] of a frame, in its axes, of a model with a fixed base."""
    mechanism = model.mechanism
    placed = mechanism.frames[model.frame_index(frame)]
    R, p = np.eye(3), np.zeros(3)
    joints: list[str] = []
    axes: list[Floats] = []
    points: list[Floats] = []
    # Prismatic joints before each rotating one, and after the last.
    slides: list[list[_Slide]] = [[]]
    for index in reversed(ancestry(mechanism, placed.body)):
        body = mechanism.bodies[index]
        if body.ball:
            # The first of the three bodies of a ball joint stands for it: its point is the centre.
            continue
        axis = np.zeros(3) if body.ball == 0 else rotate(R @ body.R, body.axis)
        if body.revolute:
            joints.append(body.joint)
            axes.append(axis)
            points.append(p + rotate(R, body.p))
            slides.append([])
        else:
            slides[-1].append((axis, *_travel(model, body.joint)))
        R_joint, p_joint = joint_motion(body, np.array([0.0, 0.0, 0.0, 1.0]) if body.ball == 0 else ZERO)
        R, p = R @ R_joint, p + rotate(R, p_joint)
    end = p + rotate(R, placed.p) + R @ placed.R @ np.array(point)
    if not joints:
        return MaxReach(end, f"the point {_shown(end)} m", _length(np.zeros(3), slides[0]))
    chain = [*_points_of_least_length(np.array(axes), np.array(points), slides, end), end]
    most = sum(_length(chain[k + 1] - chain[k], slides[k + 1]) for k in range(len(joints)))
    name = f"the point {_shown(chain[0])} m" + ("" if slides[0] else f" on the axis of {joints[0]}")
    return MaxReach(chain[0], name, most + _length(np.zeros(3), slides[0]))


def _travel(model: Model, name: str) -> tuple[float, float]:
    """Return the position limits of a joint; of a mimic joint those that follow from its driver."""
    mimic = model.joint(name).mimic
    at = model.position_index(name if mimic is None else mimic.joint)
    low, high = float(model.lower[at]), float(model.upper[at])
    if mimic is None:
        return low, high
    if mimic.multiplier == 0.0:
        return mimic.offset, mimic.offset
    ends = sorted(mimic.multiplier * limit + mimic.offset for limit in (low, high))
    return ends[0], ends[1]


def _length(offset: Floats, slides: list[_Slide]) -> float:
    """Return the greatest length of ``offset + sum(t_j u_j)`` for directions u_j and travels t_j: it is
    convex, and so greatest at a corner."""
    if any(not (math.isfinite(low) and math.isfinite(high)) for _, low, high in slides):
        return math.inf
    corners = product(*([low * axis, high * axis] for axis, low, high in slides))
    return max(float(np.linalg.norm(offset + sum(corner, np.zeros(3)))) for corner in corners)


def _points_of_least_length(axes: Floats, points: Floats, slides: list[list[_Slide]], end: Floats) -> Floats:
    """Return points (n, 3) on the axes with the least sum of distances to one another and to `end` (3,).

    Any points give a valid bound; these give a small one (iteratively reweighted least squares).
    """
    n = len(axes)
    middle = [
        sum((axis * 0.5 * (low + high) for axis, low, high in each if math.isfinite(low + high)), np.zeros(3))
        for each in slides
    ]
    shift = np.zeros(n)
    for _ in range(_MAX_PASSES):
        chain = [*(points + shift[:, None] * axes), end]
        rows, right = [], []
        for k in range(n):
            gap = chain[k + 1] - chain[k] + middle[k + 1]
            scale = 1.0 / math.sqrt(float(np.linalg.norm(gap)) + 1e-9)
            A = np.zeros((3, n))
            A[:, k] = -axes[k]
            if k + 1 < n:
                A[:, k + 1] = axes[k + 1]
            rows.append(scale * A)
            right.append(-scale * gap)
        step = np.linalg.lstsq(np.concatenate(rows), np.concatenate(right), rcond=1e-9)[0]
        shift += step
        if np.abs(step).max() < 1e-9:
            break
    return np.asarray(points + shift[:, None] * axes)


def _shown(vector: Floats) -> str:
    return "(" + ", ".join(f"{0.0 if abs(x) < 1e-12 else x:.4g}" for x in vector.tolist()) + ")"
