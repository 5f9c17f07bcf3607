"""Parameters of a task with their distributions, and the values that episodes draw."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple
from zlib import crc32

import numpy as np

from dynx.envs.randomization.counter_random import Words, uniform_pairs
from dynx.envs.randomization.distribution import Distribution
from dynx.envs.randomization.randomization import Randomization
from dynx.errors import UnknownNameError, nearest, shown
from dynx.spatial.scalar import Floats


class Parameter(NamedTuple):
    """A parameter that episodes draw."""

    field: str
    """Field of `Randomization`."""
    part: str | None
    """Link, joint, body or entry that has it; None for all of them."""
    distribution: Distribution
    step: float = 0.0
    """Distance of the values to which it is rounded; 0 for none."""

    @property
    def name(self) -> str:
        """Name in `info`, such as ``mass_scale.pole``."""
        return self.field if self.part is None else f"{self.field}.{self.part}"


def parameters_of(
    randomization: Randomization,
    fields: Iterable[str],
    require: Callable[[str, str], str] = lambda _, part: part,
    delay_step: float = 0.0,
) -> tuple[Parameter, ...]:
    """Return the parameters of these fields; a delay is rounded to multiples of `delay_step`.

    ``require(field, part)`` returns the name of a part, or raises.
    """
    return tuple(
        Parameter(
            field,
            None if part is None else require(field, part),
            distribution,
            delay_step if field == "delay" else 0.0,
        )
        for field in fields
        for part, distribution in randomization.distributions(field).items()
    )


def require_name(kind: str, name: str, known: Sequence[str]) -> str:
    """Return the name. Raises UnknownNameError for one that is not known."""
    if name not in known:
        raise UnknownNameError(f"no {kind} {shown(name)}{nearest(name, known)}")
    return name


class Draws:
    """Values of parameters, one row for each environment."""

    def __init__(self, parameters: Sequence[Parameter]) -> None:
        self.parameters = tuple(parameters)
        self.names = tuple(each.name for each in parameters)
        # By the name, so that a value does not depend on what else is drawn.
        self._streams = np.array([crc32(name.encode()) for name in self.names], dtype=np.uint64)

    def values(self, seeds: Words, episodes: Words) -> Floats:
        """Return the values (n, k) in the episodes (n,) of environments with these seeds (n,)."""
        random = uniform_pairs(seeds, episodes, self._streams)
        values = np.empty(random.shape[:2])
        for column, each in enumerate(self.parameters):
            drawn = each.distribution.numbers(np.ascontiguousarray(random[:, column]))
            values[:, column] = np.round(drawn / each.step) * each.step if each.step else drawn
        return values
