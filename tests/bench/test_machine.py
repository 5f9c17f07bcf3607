"""The kernels that measure the machine execute the operations that are counted."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from dynx.bench.machine import (
    CHAIN_LENGTH,
    CHAINS,
    Cost,
    Peak,
    chains_program,
    cost_of,
    load,
    measure_peak,
    processor_description,
    roofline,
)
from dynx.simd.kernel import Kernel


def test_the_chains_are_pairs_of_a_product_and_a_sum() -> None:
    cost = cost_of(chains_program())
    assert cost.multiply_adds == CHAINS * CHAIN_LENGTH + CHAINS - 1
    assert cost.operations == 2 * CHAINS * CHAIN_LENGTH + CHAINS - 1


def test_the_chains_compute_the_expected_values() -> None:
    program = chains_program(chains=3, links=5)
    x, a, b = np.array([[1.0, -2.0, 0.5]]), 0.75, 0.25
    expected = x.copy()
    for _ in range(5):
        expected = expected * a + b
    inputs = [np.repeat(x, 16, axis=0), np.full((16, 1), a), np.full((16, 1), b)]
    out = np.zeros((16, 1))
    Kernel(program)(inputs, [out])
    np.testing.assert_allclose(out, np.sum(expected), rtol=1e-14)


@pytest.mark.parametrize("threads", [1, 2])
def test_a_peak_is_measured_on_any_number_of_threads(threads: int) -> None:
    peak = measure_peak(threads, repetitions=1, size=2**20)
    assert peak.threads == threads
    # A machine that runs this at all copies more than a byte and multiplies more than once in a microsecond.
    assert peak.copy_bandwidth > 1e6
    assert peak.multiply_adds > 1e6


def test_the_processor_is_described_in_one_line() -> None:
    assert "doubles in a vector" in processor_description()
    assert "\n" not in processor_description()


def test_the_load_is_known_where_the_system_reports_it() -> None:
    found = load()
    assert (found is None) == (sys.platform == "win32")
    assert found is None or found >= 0.0


PEAK = Peak(threads=1, copy_bandwidth=10e9, multiply_adds=20e9)


def test_shares_are_lower_bounds_over_the_measured_time() -> None:
    # At least 10 ns for the bytes and 25 ns for the operations; it takes 50.
    found = roofline(Cost(bytes=100, operations=900, multiply_adds=500), 50e-9, PEAK)
    assert found.memory_share == pytest.approx(0.2)
    assert found.arithmetic_share == pytest.approx(0.5)
    assert found.binds == "arithmetic"
    assert found.share == pytest.approx(0.5)


def test_a_kernel_that_only_copies_is_bound_by_memory() -> None:
    found = roofline(Cost(bytes=128, operations=0, multiply_adds=0), 16e-9, PEAK)
    assert found.binds == "memory"
    assert found.share == pytest.approx(0.8)
    assert found.arithmetic_share == 0.0


def test_within_the_caches_more_is_reached_than_memory_gives() -> None:
    assert roofline(Cost(100, 0, 0), 5e-9, PEAK).memory_share == pytest.approx(2.0)
