"""Random numbers by counters, and the distributions of parameters."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynx.envs import Randomization
from dynx.envs.randomization.counter_random import (
    Purpose,
    consecutive_seeds,
    normal_numbers,
    philox,
    uniform_pairs,
)
from dynx.envs.randomization.distribution import read_distribution
from dynx.envs.randomization.draws import Draws, parameters_of


def words(*numbers: int) -> Any:
    return tuple(np.array([number], dtype=np.uint64) for number in numbers)


@pytest.mark.parametrize(
    ("counter", "key", "random"),
    [
        ((0, 0, 0, 0), (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
        ((2**32 - 1,) * 4, (2**32 - 1,) * 2, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
        (
            (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
            (0xA4093822, 0x299F31D0),
            (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
        ),
    ],
)
def test_random_words_are_the_published_ones(counter: Any, key: Any, random: Any) -> None:
    # Known answers of Random123, the library of the authors of Philox.
    assert tuple(int(each[0]) for each in philox(words(*counter), words(*key))) == random


def test_random_numbers_have_their_distributions() -> None:
    seeds, zero = consecutive_seeds(7, 20_000), np.zeros(20_000, dtype=np.uint64)
    uniform = uniform_pairs(seeds, zero, np.arange(3, dtype=np.uint64))
    assert uniform.min() >= 0.0
    assert uniform.max() < 1.0
    flat = uniform.reshape(len(seeds), -1)
    # Six standard errors: 1 / sqrt(12 n) of the mean, and 1 / sqrt(n) of a correlation.
    assert np.abs(flat.mean(axis=0) - 0.5).max() < 6.0 / np.sqrt(12.0 * len(seeds))
    assert np.abs(np.corrcoef(flat.T) - np.eye(6)).max() < 6.0 / np.sqrt(len(seeds))
    normal = normal_numbers(Purpose.ACTION, seeds, zero, zero, 5)
    assert normal.shape == (20_000, 5)
    assert np.abs(normal.mean(axis=0)).max() < 6.0 / np.sqrt(len(seeds))
    assert np.abs(normal.std(axis=0) - 1.0).max() < 6.0 / np.sqrt(2.0 * len(seeds))
    other = normal_numbers(Purpose.OBSERVATION, seeds, zero, zero, 5)
    assert np.abs(np.corrcoef(normal[:, 0], other[:, 0])[0, 1]) < 6.0 / np.sqrt(len(seeds))


@given(
    seed=st.integers(0, 2**70),
    count=st.integers(1, 9),
    first=st.integers(0, 8),
    episode=st.integers(0, 2**40),
    low=st.floats(0.1, 1.0),
    high=st.floats(1.0, 3.0),
)
@settings(max_examples=40, deadline=None)
def test_a_draw_depends_on_its_environment_alone(
    seed: int, count: int, first: int, episode: int, low: float, high: float
) -> None:
    given_ranges = Randomization(mass_scale={"a": (low, high)}, delay={"log_uniform": (low, high)})
    alone = Randomization(delay={"log_uniform": (low, high)})
    draws, fewer = (Draws(parameters_of(each, ("mass_scale", "delay"))) for each in (given_ranges, alone))
    seeds = consecutive_seeds(seed, first + count)
    episodes = np.full(first + count, episode, dtype=np.uint64)
    values = draws.values(seeds, episodes)
    part = draws.values(seeds[first:], episodes[first:])
    assert np.array_equal(values[first:], part)
    assert np.array_equal(values[:, 1:], fewer.values(seeds, episodes))
    assert (values >= low * (1.0 - 1e-15)).all()
    assert (values <= high * (1.0 + 1e-15)).all()


def test_a_normal_distribution_is_clamped() -> None:
    found = read_distribution("delay", {"normal": (1.0, 0.1)})
    numbers = found.numbers(np.random.default_rng(0).random((20_000, 2)))
    assert found.bounds == pytest.approx((0.7, 1.3))
    assert numbers.min() >= 0.7 - 1e-12
    assert numbers.max() <= 1.3 + 1e-12
    assert numbers.std() == pytest.approx(0.1, rel=0.03)
