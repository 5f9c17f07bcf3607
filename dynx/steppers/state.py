"""State of a world: coordinates of each robot, pose and twist of each body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import hypot, isfinite
from typing import Any, NamedTuple, TypeVar

import numpy as np

from dynx.errors import UnknownNameError, nearest, shown
from dynx.model.numbers import DIVERGENCE_SPEED
from dynx.spatial.scalar import Floats

Part = TypeVar("Part")


def same_numbers(ours: tuple[Any, ...], theirs: object) -> bool:
    """Check whether two states of one kind have equal numbers; tuples would raise on arrays."""
    return type(ours) is type(theirs) and all(map(np.array_equal, ours, theirs))


class RobotState(NamedTuple):
    """Configuration q (nq,) and velocity v (nv,) of a robot, in the coordinates of its model."""

    q: Floats
    v: Floats

    def __eq__(self, other: object) -> bool:
        return same_numbers(self, other)

    def __ne__(self, other: object) -> bool:
        return not same_numbers(self, other)


class BodyState(NamedTuple):
    """Pose and twist of a body of the scene."""

    T_world_body: Floats
    """Pose of the body frame in the world (4, 4)."""
    twist: Floats
    """Linear velocity of the origin of the body frame [m/s], then angular velocity [rad/s] (6,), in world
    axes."""

    @property
    def position(self) -> Floats:
        """Origin (3,) of the body frame in the world [m]."""
        return self.T_world_body[:3, 3]

    def __eq__(self, other: object) -> bool:
        return same_numbers(self, other)

    def __ne__(self, other: object) -> bool:
        return not same_numbers(self, other)


class PartStates(dict[str, Part]):
    """States by name; an unknown name raises UnknownNameError, with the nearest."""

    def __missing__(self, name: object) -> Part:
        raise UnknownNameError(f"the world has no state of {shown(name)}{nearest(name, self)}")


@dataclass(frozen=True)
class WorldState:
    """Time [s], the state of every robot and body by name, and the torques that led there."""

    time: float
    robots: Mapping[str, RobotState]
    bodies: Mapping[str, BodyState]
    torques: Mapping[str, Floats] = field(default_factory=PartStates, compare=False)
    """Torque (nv,) [N m or N] of every robot in the last step of the engine: the given torque plus the torque
    of the motors. Zero if no step was taken since the state was set, and NaN for joints whose torque only a
    motor inside the engine knows. No later step depends on it, so that it is neither set nor compared."""


def has_diverged(position: Floats, velocity: Floats) -> bool:
    """Check whether a number of a state is not finite, or its velocity too large to be meaningful."""
    if not hypot(*velocity.tolist()) < DIVERGENCE_SPEED:
        return True
    # A finite sum has finite entries; of few numbers, Python's is the fastest.
    return not isfinite(sum(position.ravel().tolist())) and not np.isfinite(position).all()
