"""Values of hyperparameters that change during training, written as rl-baselines3-zoo writes them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from dynx.errors import ArgumentError, shown

_LINEAR = "lin_"
SCHEDULED = ("learning_rate", "clip_range", "clip_range_vf")
"""Hyperparameters that stable-baselines3 takes as a function of the progress."""


@dataclass(frozen=True)
class Linear:
    """A value that falls linearly from `start` to zero while training goes from its start to its end."""

    start: float

    def __call__(self, progress_remaining: float) -> float:
        return progress_remaining * self.start


def schedule_of(name: str, value: Any) -> Any:
    """Return a hyperparameter's value, with ``lin_0.001`` as a `Linear` that falls from 0.001 to zero.

    Raises ArgumentError for another word, and for a number that is not finite.
    """
    if isinstance(value, float) and not math.isfinite(value):
        raise ArgumentError(f"{name} is {value}, not a finite number")
    if not isinstance(value, str) or name not in SCHEDULED:
        return value
    try:
        if not value.startswith(_LINEAR):
            raise ValueError
        start = float(value[len(_LINEAR) :])
        if not math.isfinite(start):
            raise ValueError
    except ValueError:
        raise ArgumentError(
            f"{name} is a number, or {_LINEAR}NUMBER, which falls to zero until the end of training; got "
            f"{shown(value)}"
        ) from None
    return Linear(start)
