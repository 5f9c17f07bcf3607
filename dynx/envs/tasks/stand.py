"""Stand still with a quadruped from a disturbed start."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.envs.ground_task import GroundState
from dynx.envs.task import State
from dynx.envs.tasks.quadruped import SPEED_WIDTH, STAND_HEIGHT, Quadruped, vertical_axis, with_floor
from dynx.spatial.scalar import Array


@dataclass(frozen=True)
class Stand(Quadruped):
    """Stand still from a disturbed start.

    Action and observation are those of `Quadruped`. Reward: up to 1 for a trunk that is upright, high and at
    rest, less the power of the motors and changes of the action, but not below 0.
    ``reset(options={"disturbance": 0.0})`` starts at rest in the posture.
    """

    disturbance: float = 3.0
    """Size of the disturbance at the start. From 1 the posture recovers by itself, without a policy."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.require_disturbance(self.disturbance)

    def initial_state(self, random: Array, disturbance: float | None = None) -> State:
        """Return a state near the posture, at random in proportion to `disturbance`, by default that of the
        task."""
        return self.near_posture(random, self.disturbance if disturbance is None else disturbance)

    def terms(self, before: GroundState, action: Array, after: GroundState) -> Mapping[str, Any]:
        """Return the terms of the posture and the costs, and what makes a negative sum zero."""
        q, v, _ = after
        posture = vertical_axis(q)[2] * np.exp(-((q[2] - STAND_HEIGHT) ** 2) / 0.01)
        still = np.exp(-np.sum(v[:6] * v[:6]) / SPEED_WIDTH)
        return with_floor(
            {
                "upright and high": 0.5 * posture,
                "at rest": 0.5 * posture * still,
                "power and jerks": -self.costs(after),
            }
        )
