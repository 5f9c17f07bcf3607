"""Random numbers by counters: each depends on a seed and on where it is used, and on nothing drawn before.

So an environment has the same numbers alone, among any number of others, and in any partition of them. The
generator is Philox4x32 with ten rounds (Salmon, Moraes, Dror and Shaw, Parallel random numbers: as easy as
1, 2, 3, 2011), for many seeds at once.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from dynx.spatial.scalar import Floats

Words = NDArray[np.uint64]
"""Words of 32 bits, kept in 64 so that their products fit."""

MULTIPLIERS = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
KEY_STEPS = np.uint64(0x9E3779B9), np.uint64(0xBB67AE85)
ROUNDS = 10
NUMBERS_AT_ONCE = 16384
"""Number of blocks of words that are computed together: few enough for the cache of a processor."""

_LOW, _SHIFT = np.uint64(0xFFFFFFFF), np.uint64(32)


class Purpose(IntEnum):
    """Use of random numbers; each has numbers of its own."""

    PARAMETERS = 0
    OBSERVATION = 1
    ACTION = 2


def philox(counter: tuple[Words, Words, Words, Words], key: tuple[Words, Words]) -> tuple[Words, ...]:
    """Return four random words for each counter of four words and key of two; arrays broadcast."""
    first, second, third, fourth = counter
    low_key, high_key = key
    for _ in range(ROUNDS):
        one, two = MULTIPLIERS[0] * first, MULTIPLIERS[1] * third
        first, second, third, fourth = (
            (two >> _SHIFT) ^ second ^ low_key,
            two & _LOW,
            (one >> _SHIFT) ^ fourth ^ high_key,
            one & _LOW,
        )
        low_key, high_key = (low_key + KEY_STEPS[0]) & _LOW, (high_key + KEY_STEPS[1]) & _LOW
    return first, second, third, fourth


def seed_word(seed: int) -> int:
    """Return a seed below 2^64, itself if it is, or a hash of a larger one."""
    return seed if seed < 2**64 else int(np.random.SeedSequence(seed).generate_state(1, np.uint64)[0])


def consecutive_seeds(seed: int, count: int) -> Words:
    """Return the seeds of `count` environments: ``seed``, ``seed + 1``, ..., modulo 2^64."""
    return np.asarray(np.uint64(seed_word(seed)) + np.arange(count, dtype=np.uint64))


def uniform_pairs(seeds: Words, episodes: Words, streams: Words) -> Floats:
    """Return two numbers uniform in [0, 1) for each seed (n,) with its episode (n,) and each of the `streams`
    (k,) for parameters: (n, k, 2)."""
    words = _words(Purpose.PARAMETERS, seeds, episodes, np.zeros_like(seeds), streams)
    return np.stack([_uniform(words[0], words[1]), _uniform(words[2], words[3])], axis=-1)


def normal_numbers(purpose: Purpose, seeds: Words, episodes: Words, steps: Words, count: int) -> Floats:
    """Return `count` standard normal numbers for each seed (n,) in a step (n,) of its episode (n,):
    (n, count), by the transform of Box and Muller."""
    blocks = np.arange(-(-count // 4), dtype=np.uint64)
    words = _words(purpose, seeds, episodes, steps, blocks)
    found = np.empty((len(seeds), len(blocks), 4))
    for k in (0, 2):
        radius = np.sqrt(-2.0 * np.log((words[k] + 1.0) * 2.0**-32))
        angle = words[k + 1] * (2.0 * np.pi * 2.0**-32)
        found[:, :, k], found[:, :, k + 1] = radius * np.cos(angle), radius * np.sin(angle)
    return found.reshape(len(seeds), -1)[:, :count]


def _words(purpose: Purpose, seeds: Words, episodes: Words, steps: Words, streams: Words) -> Words:
    """Return four words (4, n, k) for each seed and stream."""
    found = np.empty((4, len(seeds), len(streams)), dtype=np.uint64)
    count = max(1, NUMBERS_AT_ONCE // max(1, len(streams)))
    for first in range(0, len(seeds), count):
        rows = slice(first, first + count)
        shape = found[0, rows].shape

        def column(words: Words, rows: slice = rows, shape: tuple[int, ...] = shape) -> Words:
            return np.ascontiguousarray(np.broadcast_to(words[rows, None] & _LOW, shape))

        stream = np.ascontiguousarray(np.broadcast_to(streams, shape))
        use = np.full(shape, purpose, dtype=np.uint64)
        counter = stream, use, column(episodes), column(steps)
        found[:, rows] = philox(counter, (column(seeds), column(seeds >> _SHIFT)))
    return found


def _uniform(high: Words, low: Words) -> Floats:
    """Return numbers of 53 bits in [0, 1)."""
    return np.asarray(((high >> np.uint64(5)) * 2.0**26 + (low >> np.uint64(6))) * 2.0**-53)
