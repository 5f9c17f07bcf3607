"""Random numbers by counters: each depends on a seed and on where it is used, and on nothing drawn before.

So a rollout has the same noise alone, in any batch and in any partition of it, on any processor and thread;
and an environment has the same numbers alone and among any number of others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.spatial.scalar import Floats

BLOCK_STEPS = 64
"""Number of steps, or of episodes, whose numbers are drawn from one state of the generator."""


class Purpose(IntEnum):
    """Use of random numbers; each has numbers of its own."""

    MEASUREMENT = 0
    CONTROLLER = 1
    PARAMETERS = 2
    OBSERVATION = 3
    ACTION = 4
    SENSOR = 5
    PUSH = 6
    PUSH_SPEED = 7


class Streams:
    """Random numbers of some seeds, by NumPy's Philox4x64 (Salmon et al., Parallel random numbers: as easy as
    1, 2, 3, 2011).

    The generator's key is the seed and the `lane`: the number of a rollout, of an episode, or of a parameter,
    below 2^64. Its counter is the purpose of the numbers and the number of the `block`.
    """

    def __init__(self, *seeds: int) -> None:
        self._seeds = [np.random.SeedSequence(seed).generate_state(1, np.uint64)[0] for seed in seeds]
        self._bits: Any = np.random.Philox(0)
        generator = np.random.Generator(self._bits)
        self._normal, self._uniform = generator.standard_normal, generator.random
        # The setter copies these arrays, so one dictionary can be reused for all states.
        # In float64, which NumPy makes of a uint64 and an int, large lanes would be rounded.
        self._key = np.zeros(2, dtype=np.uint64)
        self._counter = np.zeros(4, dtype=np.uint64)
        self._state: dict[str, Any] = {
            **self._bits.state,
            "state": {"counter": self._counter, "key": self._key},
            "buffer": np.zeros(4, dtype=np.uint64),
            "buffer_pos": 4,
        }

    def normal(self, purpose: Purpose, lane: int, block: int, out: Floats, row: int = 0) -> None:
        """Fill `out` (steps, ...) with standard normal numbers of the seed number `row`."""
        self._set(purpose, lane, block, row)
        self._normal(out=out)

    def uniform(self, purpose: Purpose, lane: int, block: int, out: Floats, row: int = 0) -> None:
        """Fill `out` (steps, ...) with numbers uniform in [0, 1) of the seed number `row`."""
        self._set(purpose, lane, block, row)
        self._uniform(out=out)

    def _set(self, purpose: Purpose, lane: int, block: int, row: int) -> None:
        self._key[0] = self._seeds[row]
        self._key[1] = lane
        self._counter[2:] = purpose, block
        self._bits.state = self._state


class StepNumbers:
    """Numbers of some environments in the steps of their episodes, drawn a block of steps at a time."""

    def __init__(self, count: int, size: int, draw: Callable[[Streams, int, int, int, Floats], None]) -> None:
        """``draw(streams, row, episode, block, out)`` fills `out` (BLOCK_STEPS, size) for a block of steps of
        an episode in environment `row`, one of `count`."""
        self._draw = draw
        self._drawn = np.zeros((count, BLOCK_STEPS, size))
        self._blocks = np.full((count, 2), -1)

    def forget(self) -> None:
        """Draw anew, after the seeds have changed."""
        self._blocks[:] = -1

    def at(
        self,
        streams: Streams,
        rows: NDArray[np.intp],
        episodes: NDArray[np.int64],
        steps: NDArray[np.int64],
    ) -> Floats:
        """Return the numbers (n, size) of environments `rows` (n,), in `steps` (n,) of their `episodes`."""
        blocks = np.column_stack([episodes, steps // BLOCK_STEPS])
        for k in np.flatnonzero((self._blocks[rows] != blocks).any(axis=1)).tolist():
            row = int(rows[k])
            episode, block = blocks[k].tolist()
            self._draw(streams, row, episode, block, self._drawn[row])
        self._blocks[rows] = blocks
        return np.asarray(self._drawn[rows, steps % BLOCK_STEPS])


def step_normals(purpose: Purpose, count: int, size: int) -> StepNumbers:
    """Return standard normal numbers for a purpose."""

    def draw(streams: Streams, row: int, episode: int, block: int, out: Floats) -> None:
        streams.normal(purpose, episode, block, out, row)

    return StepNumbers(count, size, draw)


def stream_normals(seed: int, purpose: Purpose, lane: int, shape: Sequence[int]) -> Floats:
    """Return the normal numbers (steps, ...) of one lane from its first step on."""
    streams, drawn = Streams(seed), np.empty(tuple(shape))
    for first in range(0, len(drawn), BLOCK_STEPS):
        streams.normal(purpose, lane, first // BLOCK_STEPS, drawn[first : first + BLOCK_STEPS])
    return drawn
