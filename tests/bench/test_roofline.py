"""Roofline bounds of kernels on invented machines."""

from __future__ import annotations

import pytest

from dynx.bench.machine import Cost, Peak, roofline

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
