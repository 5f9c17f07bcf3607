"""Benchmark cases, and their samples."""

from __future__ import annotations

import numpy as np
import pytest

import dynx
from dynx.backends.quantities import QUANTITIES
from dynx.bench.cases import (
    MAX_POSITION,
    BenchmarkCase,
    draw_batch,
    require_memory,
)
from dynx.errors import ArgumentError, UnknownNameError
from dynx.model.tree import Base
from dynx.reference.backend import ReferenceBackend


def test_an_unknown_quantity_is_refused_with_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="'inverse_dynamic'; did you mean 'inverse_dynamics'"):
        BenchmarkCase("inverse_dynamic", 8)


@pytest.mark.parametrize(("batch", "threads", "clue"), [(0, 1, "batch is 0"), (1, -1, "threads is -1")])
def test_counts_start_at_one(batch: int, threads: int, clue: str) -> None:
    with pytest.raises(ArgumentError, match=clue):
        BenchmarkCase("jacobian", batch, threads)


def test_samples_are_those_of_the_seed_within_reach_and_row_major() -> None:
    model = dynx.load("panda").with_base("floating")
    first, again = (draw_batch(model, "panda_hand", 100, seed) for seed in (3, 3))
    assert np.array_equal(first.q, again.q)
    assert not np.array_equal(first.q, draw_batch(model, "panda_hand", 100, 4).q)
    assert np.max(np.abs(first.q[:, 7:])) <= MAX_POSITION
    np.testing.assert_allclose(np.linalg.norm(first.q[:, 3:7], axis=-1), 1.0, rtol=1e-15)
    assert all(array.flags.c_contiguous for array in (first.q, first.v, first.a, first.tau))
    assert len(first.first(7)) == 7
    assert np.array_equal(first.take([5, 2]).tau, first.tau[[5, 2]])


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_shapes_are_those_of_a_backend(quantity: str, base: Base) -> None:
    model = dynx.load("double_pendulum", base=base)
    batch = draw_batch(model, model.frame_names[-1], 3)
    frame = [batch.frame] if QUANTITIES[quantity].of_frame else []
    result = getattr(ReferenceBackend(model), quantity)(*batch.arguments(quantity), *frame)
    assert result.shape == (3, *QUANTITIES[quantity].shape_of(model))


def test_a_batch_that_does_not_fit_is_refused_with_its_size(monkeypatch: pytest.MonkeyPatch) -> None:
    model = dynx.load("double_pendulum")
    monkeypatch.setattr("dynx.simd.machine.memory_size", lambda: 1e6)
    require_memory(model, BenchmarkCase("inverse_dynamics", 1000))
    with pytest.raises(ArgumentError, match=r"10000 samples .* need about 0\.00096 GB; .* 0\.001 GB"):
        require_memory(model, BenchmarkCase("inverse_dynamics", 10000))
