"""Poses of floating bases and rotations of ball joints in the named configurations of two robots."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dynx.model import Model
from dynx.same.skeleton import Skeleton
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous, inverse
from dynx.spatial.so3 import rotation_from_quat

ROTATION_ENTRIES = 4.0
"""Difference of an entry of a rotation that counts, relative to the tolerance of an angle [rad]."""


def base_pose(q: Floats) -> Floats:
    """Return the pose (4, 4) of a floating base in the world at a configuration (nq,)."""
    return homogeneous(rotation_from_quat(q[3:7]), q[:3])


def ball_rotation(model: Model, q: Floats, joint: str) -> Floats:
    """Return the rotation (3, 3) of a ball joint at a configuration (nq,)."""
    first = model.position_index(joint)
    return rotation_from_quat(q[first : first + 4])


def rotations_differ(R: Floats, S: Floats, tolerance: float) -> bool:
    """Check whether two rotations (3, 3) differ by more than `tolerance` [rad]."""
    return bool(np.abs(R - S).max() > ROTATION_ENTRIES * tolerance)


def poses_differ(T: Floats, S: Floats, tolerance: float, reach: float) -> bool:
    """Check whether two poses (4, 4) differ by more than `tolerance` of 1 rad, or of `reach` [m] and the
    distance from the origin."""
    size = reach + float(np.abs(T[:3, 3]).max())
    moved = bool(np.abs(T - S)[:3, 3].max() > tolerance * size)
    return moved or rotations_differ(T[:3, :3], S[:3, :3], tolerance)


class StatedPoses:
    """Floating bases and ball joints in the configurations that two robots name alike.

    They say how the frame of a floating base, or of a body on a ball joint, is turned, which follows from no
    other frame.
    """

    def __init__(self, ours: Skeleton, theirs: Skeleton) -> None:
        self._ours, self._theirs = ours, theirs
        other = theirs.model.configurations
        self._pairs = [(q, other[name]) for name, q in ours.model.configurations.items() if name in other]
        self._turns: dict[tuple[int, int], list[tuple[Floats, Floats]]] = {}

    def frames_of_base(self) -> Iterator[Floats]:
        """Yield the poses (4, 4) of the frame of the second floating base in that of the first."""
        for q, other in self._pairs:
            yield inverse(base_pose(q)) @ base_pose(other)

    def count_misplaced_bases(self, D: Floats, tolerance: float) -> int:
        """Count the configurations in which a floating base whose frame has the pose D (4, 4) in that of the
        first one is elsewhere."""
        reach, back = max(self._ours.reach, 1.0), inverse(D)
        return sum(
            poses_differ(base_pose(q), base_pose(other) @ back, tolerance, reach) for q, other in self._pairs
        )

    def turns_of_ball(self, a: int, b: int, before: Floats) -> Iterator[Floats]:
        """Yield the rotations (3, 3) of the frame of body b in that of body a with which the ball joints of
        both are turned alike in a configuration; for `before` see `dynx.same.fit.BodyFit`."""
        for R, S in self._rotations(a, b):
            yield R.T @ before @ S

    def count_turned_balls(self, a: int, b: int, before: Floats, D: Floats, tolerance: float) -> int:
        """Count the configurations in which the ball joints of bodies a and b are turned otherwise; for
        `before` and D, both (3, 3), see `dynx.same.fit.BodyFit`."""
        return sum(rotations_differ(R, before @ S @ D.T, tolerance) for R, S in self._rotations(a, b))

    def _rotations(self, a: int, b: int) -> list[tuple[Floats, Floats]]:
        """Return the rotations (3, 3) of two ball joints in each configuration."""
        known = self._turns.get((a, b))
        if known is None:
            mine, joint = self._ours.joints[a].name, self._theirs.joints[b].name
            known = self._turns[a, b] = [
                (ball_rotation(self._ours.model, q, mine), ball_rotation(self._theirs.model, other, joint))
                for q, other in self._pairs
            ]
        return known
