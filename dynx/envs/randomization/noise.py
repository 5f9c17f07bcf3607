"""Gaussian noise on observations and actions, whose standard deviations are drawn with the parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from dynx.envs.library import Space, spaces
from dynx.envs.randomization.counter_random import Purpose, Words, normal_numbers
from dynx.envs.randomization.draws import Parameter, parameters_of
from dynx.envs.randomization.randomization import Randomization
from dynx.errors import ArgumentError, UnsupportedFeatureError
from dynx.spatial.scalar import Floats

NOISES = (("observation_noise", Purpose.OBSERVATION), ("action_noise", Purpose.ACTION))


class Noise:
    """Noise on the entries of a `Box` space, by parameters in some columns of the drawn values."""

    def __init__(
        self, purpose: Purpose, space: spaces.Box, parameters: Sequence[Parameter], first: int
    ) -> None:
        self._purpose = purpose
        self._size = int(np.prod(space.shape))
        self._columns = {
            None if each.part is None else int(each.part): first + k for k, each in enumerate(parameters)
        }
        self._low, self._high = (each.ravel().astype(np.float64) for each in (space.low, space.high))

    def numbers(self, values: Floats, seeds: Words, episodes: Words, steps: Words) -> Floats:
        """Return the noise (n, size) of environments with these drawn values (n, k), in these steps (n,) of
        their episodes."""
        noise = normal_numbers(self._purpose, seeds, episodes, steps, self._size)
        if None in self._columns:
            return noise * values[:, self._columns[None], None]
        deviations = np.zeros_like(noise)
        for entry, column in self._columns.items():
            deviations[:, entry] = values[:, column]
        return noise * deviations

    def added(self, numbers: Floats, noise: Floats) -> Floats:
        """Return numbers (n, size) with noise, clamped to the space."""
        return np.asarray(np.clip(numbers + noise, self._low, self._high))


def noise_parameters(randomization: Randomization, name: str, space: Space[Any]) -> tuple[Parameter, ...]:
    """Return the parameters of the noise on a space: of observations or of actions.

    Raises UnsupportedFeatureError for choices, ArgumentError for an entry that the space does not have.
    """
    size = int(np.prod(space.shape)) if isinstance(space, spaces.Box) else 0

    def require(_: str, part: str) -> str:
        if not part.isdecimal() or int(part) >= size:
            raise ArgumentError(
                f"{name} names entry {part}; wanted the number of an entry from 0 to {size - 1}"
            )
        return str(int(part))

    if randomization.distributions(name) and not isinstance(space, spaces.Box):
        raise UnsupportedFeatureError(f"{name} needs a Box space of numbers; that of this task is {space}")
    return parameters_of(randomization, (name,), require)


def make_noise(
    purpose: Purpose, space: Space[Any], parameters: Sequence[Parameter], first: int
) -> Noise | None:
    """Return the noise with these parameters, whose columns begin at `first`; None without any."""
    return Noise(purpose, space, parameters, first) if parameters and isinstance(space, spaces.Box) else None
