"""Overhead of one call through dynx over the same call of Pinocchio's own binding, on UR5.

``pytest benchmarks/test_call_overhead.py`` times raw, checked and unchecked calls of every method in one run
and prints what dynx adds. The engine's model is read by Pinocchio's own parser.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.conftest import Record
from benchmarks.engine_calls import Call, Sample, of_pinocchio, through_dynx
from dynx.agreement.tolerances import BAR
from dynx.backends import backend
from dynx.backends.quantities import QUANTITIES
from dynx.model.loading import load

IMPLEMENTATIONS = ("raw", "checked", "unchecked")
CALLS = (*QUANTITIES, "all frames")


@cache
def calls() -> dict[str, dict[str, Call]]:
    """Calls to time, by implementation and quantity, all at one sample."""
    model = load("ur5")
    sample = Sample(model)
    engine = pin.buildModelFromUrdf(model.source)
    links = [link.name for link in model.links]
    return {
        "raw": of_pinocchio(engine, list(model.frame_names), links, sample),
        "checked": through_dynx(backend("pinocchio", model), sample),
        "unchecked": through_dynx(backend("pinocchio", model, validate=False), sample),
    }


@pytest.mark.parametrize("quantity", CALLS)
@pytest.mark.parametrize("implementation", IMPLEMENTATIONS)
@pytest.mark.benchmark(max_time=0.5, warmup=True)
def test_call_overhead(
    benchmark: BenchmarkFixture, record: Record, quantity: str, implementation: str
) -> None:
    benchmark.group = f"{quantity}, UR5, one call"
    call, raw = calls()[implementation][quantity], calls()["raw"][quantity]
    expected = raw()
    # The second call is on the path that a loop takes.
    for _ in range(2):
        np.testing.assert_allclose(call(), expected, rtol=0.0, atol=BAR * np.max(np.abs(expected)))
    benchmark(call)
    record(quantity, implementation, benchmark)
