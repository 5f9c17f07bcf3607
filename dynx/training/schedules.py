"""Values of hyperparameters that change during training, written as rl-baselines3-zoo writes them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from dynx.errors import ArgumentError, shown

_LINEAR, _DIVERGENCE = "lin_", "kl_"
SCHEDULED = ("learning_rate", "clip_range", "clip_range_vf")
"""Hyperparameters that stable-baselines3 takes as a function of the progress."""


@dataclass(frozen=True)
class Linear:
    """A value that falls linearly from `start` to zero while training goes from its start to its end."""

    start: float

    def __call__(self, progress_remaining: float) -> float:
        return progress_remaining * self.start


@dataclass(frozen=True)
class SteadyDivergence:
    """A learning rate that keeps the divergence of Kullback and Leibler of PPO's updates near `target`.

    Source: Rudin and others, Learning to walk in minutes using massively parallel deep reinforcement learning
    (2022): after each mini-batch the rate is divided by 1.5 if the divergence is above twice the target, and
    multiplied by it if it is below a half.
    """

    target: float
    """Divergence of the policy after an update from that of the rollouts."""

    def __call__(self, progress_remaining: float) -> float:
        """Return the rate at the start."""
        return START_RATE

    def next_rate(self, rate: float, divergence: float) -> float:
        """Return the rate after a mini-batch with a divergence."""
        if divergence > 2.0 * self.target:
            return max(rate / RATE_FACTOR, MIN_RATE)
        return min(rate * RATE_FACTOR, MAX_RATE) if divergence < 0.5 * self.target else rate


START_RATE, MIN_RATE, MAX_RATE, RATE_FACTOR = 1e-3, 1e-5, 1e-2, 1.5
"""Learning rate at the start of `SteadyDivergence`, its bounds, and the factor of a change."""


def schedule_of(name: str, value: Any) -> Any:
    """Return a hyperparameter's value, with ``lin_0.001`` as a `Linear` that falls from 0.001 to zero,
    and the learning rate ``kl_0.01`` as a `SteadyDivergence`.

    Raises ArgumentError for another word, and for a number that is not finite.
    """
    if isinstance(value, float) and not math.isfinite(value):
        raise ArgumentError(f"{name} is {value}, not a finite number")
    if not isinstance(value, str) or name not in SCHEDULED:
        return value
    kinds: dict[str, Callable[[float], Any]] = {_LINEAR: Linear}
    if name == "learning_rate":
        kinds[_DIVERGENCE] = SteadyDivergence
    try:
        prefix = next(each for each in kinds if value.startswith(each))
        number = float(value[len(prefix) :])
        if not math.isfinite(number) or (prefix == _DIVERGENCE and number <= 0.0):
            raise ValueError
    except (StopIteration, ValueError):
        adaptive = f", or {_DIVERGENCE}NUMBER, which follows the divergence" if len(kinds) > 1 else ""
        raise ArgumentError(
            f"{name} is a number, or {_LINEAR}NUMBER, which falls to zero until the end of training"
            f"{adaptive}; got {shown(value)}"
        ) from None
    return kinds[prefix](number)
