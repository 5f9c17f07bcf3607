"""Stand still with a quadruped from a disturbed start."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.envs.task import Episode
from dynx.envs.tasks.quadruped import DOG, SPEED_WIDTH, STAND_HEIGHT, Quadruped, vertical_axis, with_floor


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
        self.require_disturbance(self.disturbance)

    def start(self, episode: Episode, disturbance: float | None = None) -> None:
        """Start near the posture, at random in proportion to `disturbance`, by default that of the task."""
        self.start_near_posture(episode, self.disturbance if disturbance is None else disturbance)

    def reward(self, episode: Episode, action: Any) -> float:
        """Return the reward for standing, less the costs of the motion."""
        q, v = episode.world.state.robots[DOG]
        upright = vertical_axis(q)[2]
        high = float(np.exp(-((q[2] - STAND_HEIGHT) ** 2) / 0.01))
        still = float(np.exp(-(v[:6] @ v[:6]) / SPEED_WIDTH))
        return max(upright * high * (0.5 + 0.5 * still) - self.costs(episode), 0.0)

    def reward_terms(self, episode: Episode, action: Any) -> Mapping[str, float]:
        """Return the terms of the posture and the costs, and what makes a negative sum zero."""
        q, v = episode.world.state.robots[DOG]
        posture = float(vertical_axis(q)[2] * np.exp(-((q[2] - STAND_HEIGHT) ** 2) / 0.01))
        still = float(np.exp(-(v[:6] @ v[:6]) / SPEED_WIDTH))
        return with_floor(
            {
                "upright and high": 0.5 * posture,
                "at rest": 0.5 * posture * still,
                "power and jerks": -self.costs(episode),
            }
        )
