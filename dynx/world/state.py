"""State of a world: coordinates of each robot, pose and twist of each body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dynx.spatial.scalar import Floats


class RobotState(NamedTuple):
    """Configuration q (nq,) and velocity v (nv,) of a robot, in the coordinates of its model."""

    q: Floats
    v: Floats


class BodyState(NamedTuple):
    """Pose and twist of a body of the scene."""

    T_world_body: Floats
    """Pose of the body frame in the world (4, 4)."""
    twist: Floats
    """Linear velocity of the origin of the body frame [m/s], then angular velocity [rad/s] (6,), in world
    axes."""


@dataclass(frozen=True, eq=False)
class WorldState:
    """Time [s], and the state of every robot and body by name."""

    time: float
    robots: Mapping[str, RobotState]
    bodies: Mapping[str, BodyState]


def is_finite(parts: Sequence[Floats]) -> bool:
    """Check whether all numbers of a state are finite."""
    return all(np.isfinite(part).all() for part in parts)
