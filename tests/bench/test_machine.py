"""The kernels that measure the machine execute the operations that are counted."""

from __future__ import annotations

import numpy as np
import pytest

from dynx.bench.machine import (
    CHAIN_LENGTH,
    CHAINS,
    chains_program,
    cost_of,
    measure_peak,
    processor_description,
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
