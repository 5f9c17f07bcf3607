"""`Variation`: the parameters and the noise of some environments, with one row for each of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.envs.library import Space, spaces
from dynx.envs.randomization import Draws, Parameter, Randomization, parameters_of
from dynx.errors import ArgumentError, UnsupportedFeatureError
from dynx.spatial.scalar import Floats
from dynx.steppers.random import BLOCK_STEPS, Purpose, StepNumbers, Streams


class Variation:
    """Drawn values and noise of `count` environments.

    Environment k has the seed of the first plus k. Its values depend on that seed, the number of the episode
    since the seed was set, and the name of the parameter; its noise also on the step of the episode.
    """

    def __init__(
        self,
        randomization: Randomization,
        motion: Sequence[Parameter],
        observation_space: Space[Any],
        action_space: Space[Any],
        count: int = 1,
    ) -> None:
        """`motion` are the parameters other than noise. Raises UnsupportedFeatureError and ArgumentError for
        noise that the spaces cannot have."""
        on_observations = noise_parameters(randomization, "observation_noise", observation_space)
        on_actions = noise_parameters(randomization, "action_noise", action_space)
        first, second = len(motion), len(motion) + len(on_observations)
        self._draws = Draws((*motion, *on_observations, *on_actions))
        self.observation_noise = make_noise(
            Purpose.OBSERVATION, observation_space, on_observations, first, count
        )
        self.action_noise = make_noise(Purpose.ACTION, action_space, on_actions, second, count)
        self.motion_size = len(motion)
        self.values: Floats = np.zeros((count, len(self._draws.names)))
        """Values (count, k) of the present episodes; the first `motion_size` are those of the motion."""
        self._streams = Streams(*[0] * count)
        self._episodes = np.full(count, -1)
        self._steps = np.zeros(count, dtype=np.int64)
        self._everywhere = np.arange(count)
        self._ahead: Floats = np.zeros((count, BLOCK_STEPS, len(self._draws.names)))

    def seed(self, seed: int | None, rng: np.random.Generator) -> None:
        """Set the seeds of the environments, from `rng` where its seed is unknown (None or below 0); the next
        episode of each is its first."""
        known = int(rng.integers(2**63)) if seed is None or seed < 0 else seed
        self._streams = Streams(*(known + k for k in range(len(self.values))))
        self._episodes[:] = -1
        for noise in (self.observation_noise, self.action_noise):
            if noise is not None:
                noise.numbers.forget()

    def start(self, rows: NDArray[np.intp] | None = None) -> None:
        """Draw the values of the next episodes of some environments, by default of all."""
        chosen = self._everywhere if rows is None else rows
        self._episodes[chosen] += 1
        self._steps[chosen] = 0
        place = self._episodes[chosen] % BLOCK_STEPS
        for row in chosen[place == 0].tolist():
            block = int(self._episodes[row]) // BLOCK_STEPS
            self._ahead[row] = self._draws.values(self._streams, row, block)
        self.values[chosen] = self._ahead[chosen, place]

    def restart(self) -> None:
        """Count the steps of all episodes from 0 again."""
        self._steps[:] = 0

    def count_step(self) -> None:
        """Note that a step was taken."""
        self._steps += 1

    def noisy_observations(self, observations: Floats, rows: NDArray[np.intp] | None = None) -> Floats:
        """Return observations (n, size) with the noise of the present steps of some environments."""
        noise = self.observation_noise
        if noise is None:
            return observations
        return noise.added(observations, self._numbers(noise, self._everywhere if rows is None else rows))

    def noise_on_actions(self) -> Floats:
        """Return the noise (count, size) of the actions of the next steps; no entries without any."""
        if self.action_noise is None:
            return np.zeros((len(self.values), 0))
        return self._numbers(self.action_noise, self._everywhere)

    def _numbers(self, noise: SpaceNoise, rows: NDArray[np.intp]) -> Floats:
        drawn = noise.numbers.at(self._streams, rows, self._episodes[rows], self._steps[rows])
        return noise.scaled(drawn, self.values[rows])

    def by_name(self, rows: NDArray[np.intp] | None = None) -> dict[str, Floats]:
        """Return the values of some environments (n,) by the names of the parameters."""
        found = self.values if rows is None else self.values[rows]
        return {name: found[:, k].copy() for k, name in enumerate(self._draws.names)}


class SpaceNoise:
    """Noise on the entries of a `Box` space, by parameters in some columns of the drawn values."""

    def __init__(
        self, purpose: Purpose, space: spaces.Box, parameters: Sequence[Parameter], first: int, count: int
    ) -> None:
        size = int(np.prod(space.shape))
        self._columns = {
            None if each.part is None else int(each.part): first + k for k, each in enumerate(parameters)
        }
        self.numbers = StepNumbers(purpose, count, size)
        """Standard normal numbers of `count` environments."""
        self._low, self._high = (each.ravel().astype(np.float64) for each in (space.low, space.high))

    def scaled(self, noise: Floats, values: Floats) -> Floats:
        """Return the noise (n, size) from standard normal numbers and the drawn values (n, k)."""
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
    purpose: Purpose, space: Space[Any], parameters: Sequence[Parameter], first: int, count: int
) -> SpaceNoise | None:
    """Return the noise of `count` environments with these parameters, whose columns begin at `first`; None
    without any."""
    if not parameters or not isinstance(space, spaces.Box):
        return None
    return SpaceNoise(purpose, space, parameters, first, count)
