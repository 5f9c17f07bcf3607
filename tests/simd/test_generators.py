"""Generators of many seeds: the numbers of NumPy's default generator, bit for bit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.simd.generators import Generators

SEEDS = st.integers(0, 2**130) | st.integers(0, 2**33) | st.sampled_from([0, 2**32, 2**64 - 1, 2**128 - 1])


def generators(count: int, size: int, seeds: Sequence[int]) -> tuple[Generators, np.ndarray]:
    rows = np.zeros((count, size))
    made = Generators(rows)
    made.seed(seeds, np.arange(count))
    return made, rows


@given(st.lists(SEEDS, min_size=1, max_size=9), st.integers(1, 7), st.data())
def test_each_row_has_the_numbers_of_its_seed_whatever_others_are_filled(
    seeds: list[int], size: int, data: st.DataObject
) -> None:
    made, rows = generators(len(seeds), size, seeds)
    single = [np.random.default_rng(seed) for seed in seeds]
    wanted = np.zeros((len(seeds), size))
    for _ in range(3):
        chosen = data.draw(st.lists(st.sampled_from(range(len(seeds))), unique=True))
        made.fill(np.array(chosen, dtype=np.intp))
        for row in chosen:
            wanted[row] = single[row].random(size)
        assert np.array_equal(rows, wanted)


def test_a_row_that_is_seeded_again_starts_again_and_the_others_go_on() -> None:
    made, rows = generators(3, 4, [5, 6, 7])
    every = np.arange(3)
    made.fill(every)
    made.seed([9, 8, 5], np.array([2]))
    made.fill(every)
    assert np.array_equal(rows[2], np.random.default_rng(5).random(4))
    assert np.array_equal(rows[0], np.random.default_rng(5).random(8)[4:])


def test_rows_are_filled_in_place_in_a_wider_array() -> None:
    whole = np.full((4, 8), 7.0)
    made = Generators(whole[:, 2:5])
    made.seed(range(4), np.arange(4))
    made.fill(np.array([1, 3]))
    assert np.array_equal(whole[3, 2:5], np.random.default_rng(3).random(3))
    untouched = np.delete(whole, [2, 3, 4], axis=1)
    assert (untouched == 7.0).all()
    assert (whole[[0, 2]] == 7.0).all()


@pytest.mark.parametrize(("count", "size"), [(0, 3), (3, 0)])
def test_no_rows_and_rows_without_numbers(count: int, size: int) -> None:
    made, rows = generators(count, size, range(count))
    made.fill(np.arange(count))
    assert rows.shape == (count, size)


def test_a_mean_and_a_variance_of_neighbouring_seeds() -> None:
    n = 20_000
    made, rows = generators(n, 2, range(n))
    made.fill(np.arange(n))
    error = 4.0 / np.sqrt(12.0 * rows.size)
    assert abs(rows.mean() - 0.5) < error
    assert abs(np.corrcoef(rows[:-1, 0], rows[1:, 0])[0, 1]) < 4.0 / np.sqrt(n)
