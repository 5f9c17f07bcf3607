"""Distributions from which an episode draws a parameter, given as data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.model.numbers import MAX_MAGNITUDE, is_real
from dynx.spatial.scalar import Floats

Range = float | Sequence[float] | Mapping[str, Sequence[float]]
"""One number; ``(low, high)`` for uniform numbers between them; ``{"log_uniform": (low, high)}``, or
``{"normal": (mean, deviation)}``, whose numbers are clamped at three deviations."""

UNIFORM, LOG_UNIFORM, NORMAL = "uniform", "log_uniform", "normal"
KINDS = (UNIFORM, LOG_UNIFORM, NORMAL)

ANY, NOT_NEGATIVE, POSITIVE = "of any sign", "of at least 0", "above 0"
"""Numbers that a parameter can have."""

MAX_DEVIATIONS = 3.0
"""Distance from the mean, in deviations, at which normal numbers are clamped."""


@dataclass(frozen=True)
class Distribution:
    """A distribution of one of the `KINDS` with its two numbers."""

    kind: str
    first: float
    second: float

    @property
    def bounds(self) -> tuple[float, float]:
        """Least and greatest number that can be drawn."""
        if self.kind == NORMAL:
            reach = MAX_DEVIATIONS * self.second
            return self.first - reach, self.first + reach
        return self.first, self.second

    def numbers(self, random: Floats) -> Floats:
        """Return numbers (...) from pairs (..., 2) that are uniform in [0, 1)."""
        first, second = random[..., 0], random[..., 1]
        if self.kind == NORMAL:
            standard = np.sqrt(-2.0 * np.log1p(-first)) * np.cos(2.0 * np.pi * second)
            return np.asarray(self.first + self.second * np.clip(standard, -MAX_DEVIATIONS, MAX_DEVIATIONS))
        if self.kind == LOG_UNIFORM:
            return np.asarray(self.first * (self.second / self.first) ** first)
        return self.first + (self.second - self.first) * first


def is_distribution(given: object) -> bool:
    """Check whether a value is meant as a distribution, and not as one for each of several names."""
    return not isinstance(given, Mapping) or (len(given) == 1 and next(iter(given)) in KINDS)


def read_distribution(name: str, given: Any, valid: str = NOT_NEGATIVE) -> Distribution:
    """Return the distribution that a user gave, whose numbers are `valid`: `ANY`, `NOT_NEGATIVE`, `POSITIVE`.

    Raises ArgumentError, which names the parameter, for anything else.
    """
    kind, pair = UNIFORM, (given, given) if is_real(given) else given
    if isinstance(given, Mapping):
        if len(given) != 1:
            raise ArgumentError(
                f"{name} is {shown(given)}; wanted one of {', '.join(KINDS)} with two numbers"
            )
        ((kind, pair),) = given.items()
        if kind not in KINDS:
            raise UnknownNameError(f"{name} has no distribution {shown(kind)}{nearest(str(kind), KINDS)}")
    if (
        not isinstance(pair, Sequence | np.ndarray)
        or isinstance(pair, str)
        or len(pair) != 2
        or not all(is_real(x) and abs(x) < MAX_MAGNITUDE for x in pair)
    ):
        raise ArgumentError(
            f"{name} is {shown(given)}; wanted a number, (low, high), or {{'log_uniform': (low, high)}} or "
            "{'normal': (mean, deviation)}"
        )
    found = Distribution(kind, float(pair[0]), float(pair[1]))
    low, high = found.bounds
    if low > high:
        fault = "a deviation below 0" if kind == NORMAL else "a lower bound above the upper one"
        raise ArgumentError(f"{name} is {shown(given)}, with {fault}")
    if kind == LOG_UNIFORM:
        valid = POSITIVE
    if (valid != ANY and low < 0.0) or (valid == POSITIVE and low == 0.0):
        raise ArgumentError(f"{name} is {shown(given)}, which reaches {low:g}; wanted numbers {valid}")
    return found
