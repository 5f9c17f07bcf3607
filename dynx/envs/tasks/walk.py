"""Walk with a quadruped at a velocity that each episode draws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from dynx.envs.ground_task import GroundState
from dynx.envs.task import State, component_names
from dynx.envs.tasks.quadruped import POSTURE, SPEED_WIDTH, Quadruped, vertical_axis, with_floor
from dynx.errors import ArgumentError, shown
from dynx.model.numbers import MAX_MAGNITUDE, is_real
from dynx.spatial.scalar import Array, Floats

WANTED = slice(2 * len(POSTURE), None)
"""Entries of the memory with the wanted velocity."""


@dataclass(frozen=True)
class Walk(Quadruped):
    """Walk with a velocity that each episode draws.

    Action and observation are those of `Quadruped`; the observation ends with the wanted velocity:
    forward and to the left [m/s], and the yaw rate [rad/s], in the axes of the trunk. Reward:
    exp(-error^2 / 0.25) of the velocity, half of that of the yaw rate, less vertical motion, roll and pitch
    rates, a leaning trunk, motor power and changes of the action, but not below 0. ``reset(options={
    "velocity": (0.5, 0.0, 0.0)})`` sets the velocity.
    """

    max_speed: float = 0.6
    """Largest wanted velocity forward [m/s]; to the side a half of it."""
    max_yaw_rate: float = 0.6
    """Largest wanted yaw rate [rad/s]."""

    observation_size: ClassVar[int] = 48
    random_size = 37

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("max_speed", "max_yaw_rate"):
            number = getattr(self, name)
            if not is_real(number) or not 0.0 <= number < MAX_MAGNITUDE:
                raise ArgumentError(f"{name} is {shown(number)}; wanted a number of at least 0")

    def initial_state(
        self, random: Array, disturbance: float = 0.2, velocity: tuple[float, float, float] | None = None
    ) -> State:
        """Return a state near the posture, with the wanted velocity, which is drawn unless it is given."""
        first = self.near_posture(random, disturbance)
        largest = np.array([self.max_speed, 0.5 * self.max_speed, self.max_yaw_rate])
        wanted = (2.0 * random[-3:] - 1.0) * largest if velocity is None else checked_velocity(velocity)
        return first._replace(memory=np.concatenate([first.memory, wanted]))

    @property
    def observation_names(self) -> tuple[str, ...]:
        """Names of the entries of the observation."""
        return (*super().observation_names, *component_names("wanted velocity", ("x", "y", "yaw")))

    def observe(self, state: GroundState) -> Array:
        """Return the observation of `Quadruped`, and the wanted velocity."""
        return np.concatenate([super().observe(state), state.memory[WANTED]])

    def terms(self, before: GroundState, action: Array, after: GroundState) -> Mapping[str, Any]:
        """Return the terms of the velocity and the costs, and what makes a negative sum zero.

        Were rewards negative, a policy that does not walk yet would earn more by falling, which ends them.
        """
        q, v, memory = after
        wanted = memory[WANTED]
        leaning_x, leaning_y, _ = vertical_axis(q)
        error, turning = v[:2] - wanted[:2], v[5] - wanted[2]
        return with_floor(
            {
                "speed": np.exp(-np.sum(error * error) / SPEED_WIDTH),
                "yaw rate": 0.5 * np.exp(-(turning**2) / SPEED_WIDTH),
                "bouncing": -2.0 * v[2] ** 2,
                "rolling and pitching": -0.05 * np.sum(v[3:5] * v[3:5]),
                "leaning": -0.5 * (leaning_x**2 + leaning_y**2),
                "power and jerks": -self.costs(after),
            }
        )

    def describe(self, state: GroundState) -> dict[str, Any]:
        """Return the wanted ``velocity`` (3,)."""
        return {"velocity": np.array(state.memory[WANTED], dtype=np.float64)}


def checked_velocity(velocity: Any) -> Floats:
    """Return a wanted velocity (3,). Raises ArgumentError for anything but three finite numbers."""
    try:
        array = np.array(velocity, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.zeros(0)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise ArgumentError(
            f"velocity is {shown(velocity)}; wanted forward, left [m/s] and yaw rate [rad/s], three numbers"
        )
    return array
