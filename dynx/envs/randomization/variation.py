"""`Variation`: the parameters and the noise of some environments, with one row for each of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.envs.library import Space
from dynx.envs.randomization.counter_random import Purpose, Words, consecutive_seeds
from dynx.envs.randomization.draws import Draws, Parameter
from dynx.envs.randomization.noise import make_noise, noise_parameters
from dynx.envs.randomization.randomization import Randomization
from dynx.spatial.scalar import Floats

EPISODES_AHEAD = 16
"""Number of episodes of an environment whose values are drawn at once, which takes little longer than one."""

BEFORE_THE_FIRST = np.uint64(2**64 - 1)
"""Number of the episode before the first, 0: the numbers wrap."""


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
        self.observation_noise = make_noise(Purpose.OBSERVATION, observation_space, on_observations, first)
        self.action_noise = make_noise(Purpose.ACTION, action_space, on_actions, second)
        self.motion_size = len(motion)
        self.values: Floats = np.zeros((count, len(self._draws.names)))
        """Values (count, k) of the present episodes; the first `motion_size` are those of the motion."""
        self._seeds: Words = np.zeros(count, dtype=np.uint64)
        self._episodes: Words = np.zeros(count, dtype=np.uint64)
        self._steps: Words = np.zeros(count, dtype=np.uint64)
        self._everywhere = np.arange(count)
        self._first: Words = np.zeros(count, dtype=np.uint64)
        self._ahead: Floats = np.zeros((count, EPISODES_AHEAD, len(self._draws.names)))

    def seed(self, seed: int | None, rng: np.random.Generator) -> None:
        """Set the seeds of the environments, from `rng` where its seed is unknown (None or below 0); the next
        episode of each is its first."""
        known = int(rng.integers(2**63)) if seed is None or seed < 0 else seed
        self._seeds = consecutive_seeds(known, len(self.values))
        # The episode that starts next has the next number, 0.
        self._episodes[:] = BEFORE_THE_FIRST
        self._first[:] = BEFORE_THE_FIRST - np.uint64(EPISODES_AHEAD)

    def start(self, rows: NDArray[np.intp] | None = None) -> None:
        """Draw the values of the next episodes of some environments, by default of all."""
        chosen = self._everywhere if rows is None else rows
        if len(chosen):
            self._episodes[chosen] += np.uint64(1)
            self._steps[chosen] = 0
            if (self._episodes[chosen] - self._first[chosen] >= EPISODES_AHEAD).any():
                # Others that will soon need it are drawn with them.
                self._draw_ahead(np.flatnonzero(self._episodes - self._first >= EPISODES_AHEAD // 2))
            place = (self._episodes[chosen] - self._first[chosen]).astype(np.intp)
            self.values[chosen] = self._ahead[chosen, place]

    def _draw_ahead(self, rows: NDArray[np.intp]) -> None:
        """Draw the values of the present and the next episodes of some environments."""
        self._first[rows] = self._episodes[rows]
        seeds = np.repeat(self._seeds[rows], EPISODES_AHEAD)
        episodes = np.repeat(self._episodes[rows], EPISODES_AHEAD)
        episodes += np.tile(np.arange(EPISODES_AHEAD, dtype=np.uint64), len(rows))
        drawn = self._draws.values(seeds, episodes)
        self._ahead[rows] = drawn.reshape(len(rows), EPISODES_AHEAD, -1)

    def restart(self) -> None:
        """Count the steps of all episodes from 0 again."""
        self._steps[:] = 0

    def count_step(self) -> None:
        """Note that a step was taken."""
        self._steps += np.uint64(1)

    def noisy_observations(self, observations: Floats, rows: NDArray[np.intp] | None = None) -> Floats:
        """Return observations (n, size) with the noise of the present steps of some environments."""
        noise = self.observation_noise
        if noise is None:
            return observations
        chosen = self._everywhere if rows is None else rows
        return noise.added(
            observations,
            noise.numbers(
                self.values[chosen], self._seeds[chosen], self._episodes[chosen], self._steps[chosen]
            ),
        )

    def noise_on_actions(self) -> Floats:
        """Return the noise (count, size) of the actions of the next steps; no entries without any."""
        if self.action_noise is None:
            return np.zeros((len(self.values), 0))
        return self.action_noise.numbers(self.values, self._seeds, self._episodes, self._steps)

    def by_name(self, rows: NDArray[np.intp] | None = None) -> dict[str, Floats]:
        """Return the values of some environments (n,) by the names of the parameters."""
        found = self.values if rows is None else self.values[rows]
        return {name: found[:, k].copy() for k, name in enumerate(self._draws.names)}
