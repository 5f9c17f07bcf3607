"""`Model.integrate` and `Model.difference` beside Pinocchio's: ``pytest benchmarks/test_configurations.py``.

``us`` and ``pinocchio_us`` in the extra information are the least times of one call, in the same run.
"""

from __future__ import annotations

import time
from functools import partial
from typing import Any

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

import dynx
from dynx.bench.timing import interleaved
from dynx.engines.pinocchio.engine_model import engine_model

pin = pytest.importorskip("pinocchio")
ROUNDS = 300


@pytest.mark.parametrize("function", ["integrate", "difference"])
@pytest.mark.parametrize("robot", ["ur5", "xarm7", "anymal", "talos"])
def test_one_configuration(benchmark: BenchmarkFixture, robot: str, function: str) -> None:
    model = dynx.load(robot, base="floating" if robot in ("anymal", "talos") else "fixed")
    engine, _ = engine_model(model)
    rng = np.random.default_rng(0)
    q = model.random(rng)
    end = model.integrate(q, rng.uniform(-1.0, 1.0, model.nv))
    other = end if function == "difference" else model.difference(q, end)
    call = partial(getattr(model, function), q, other)
    pinocchio = partial(getattr(pin, function), engine, q, other)
    np.testing.assert_allclose(call(), pinocchio(), rtol=0.0, atol=64 * np.finfo(float).eps)
    rounds = 1 if benchmark.disabled else ROUNDS
    times = interleaved([call, pinocchio], rounds, time.perf_counter, calls_per_timing=200)
    own, theirs = (1e6 * each.least for each in times)
    repeat: Any = benchmark.pedantic
    repeat(call, rounds=rounds)
    benchmark.extra_info.update(us=own, pinocchio_us=theirs)
