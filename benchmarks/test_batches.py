"""Whole batches, few samples and one: the compiled backend beside its peers, in one run.

``pytest benchmarks/test_batches.py`` times five quantities of three robots; every result is checked
against the backend `reference` first. Peers that compute one sample at a call may be timed at fewer
samples than the batch has; ``ns`` in the extra information is that of one sample. `dynx bench` prints
the same with repetitions of all implementations in turn, and how near a kernel comes to the machine's limits.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.libraries.compiling_peer import CompilingPeer
from benchmarks.peers import (
    FRAMES,
    HAVE_THREADS,
    ONLY_BATCHES,
    SUPPORTED,
    TAKE_SECONDS,
    batch_of,
    checked_call,
    implementation_of,
    tree_of_joints,
)
from dynx.agreement.tolerances import BAR
from dynx.backends import backend
from dynx.bench.cases import BenchmarkCase
from dynx.errors import EngineLimitError, NotInstalledError
from dynx.model import Model
from dynx.model.loading import load
from dynx.spatial.scalar import Floats

UNTIMED_ROBOT = "ur5"
BATCH, BATCH_UNTIMED = 65536, 256
FEW = 8
REPETITIONS = 20
REPETITIONS_OF_SECONDS = 5
"""Number of repetitions of a call that takes seconds."""

COMPILED_ROBOTS: dict[str, Callable[[], Model]] = {
    "ur5": lambda: load("ur5"),
    "talos_reduced": lambda: load("talos_reduced"),
    "tree of 100 joints": lambda: tree_of_joints(100),
}
"""Robots for which compiling is timed, from the model to the first result."""

CASES = [
    (quantity, implementation) for implementation, quantities in SUPPORTED.items() for quantity in quantities
]
THREADED = [case for case in CASES if case[1] in HAVE_THREADS]


@pytest.mark.parametrize(("quantity", "implementation"), CASES)
@pytest.mark.parametrize("robot", FRAMES)
def test_batch(benchmark: BenchmarkFixture, robot: str, quantity: str, implementation: str) -> None:
    _time(
        benchmark,
        robot,
        BenchmarkCase(quantity, BATCH_UNTIMED if benchmark.disabled else BATCH),
        implementation,
    )


@pytest.mark.parametrize(("quantity", "implementation"), THREADED)
@pytest.mark.parametrize("robot", FRAMES)
def test_batch_on_two_threads(
    benchmark: BenchmarkFixture, robot: str, quantity: str, implementation: str
) -> None:
    _time(
        benchmark,
        robot,
        BenchmarkCase(quantity, BATCH_UNTIMED if benchmark.disabled else BATCH, threads=2),
        implementation,
    )


@pytest.mark.parametrize(
    ("quantity", "implementation"), [case for case in CASES if case[1] not in TAKE_SECONDS]
)
@pytest.mark.parametrize("robot", FRAMES)
def test_few_samples(benchmark: BenchmarkFixture, robot: str, quantity: str, implementation: str) -> None:
    _time(benchmark, robot, BenchmarkCase(quantity, FEW), implementation)


@pytest.mark.parametrize(
    ("quantity", "implementation"), [case for case in CASES if case[1] not in ONLY_BATCHES]
)
@pytest.mark.parametrize("robot", FRAMES)
def test_one_sample(benchmark: BenchmarkFixture, robot: str, quantity: str, implementation: str) -> None:
    _time(benchmark, robot, BenchmarkCase(quantity, 1), implementation)


@pytest.mark.parametrize("cache", ["cold", "warm"])
@pytest.mark.parametrize("robot", COMPILED_ROBOTS)
def test_compiling(
    benchmark: BenchmarkFixture, robot: str, cache: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _skip_untimed(benchmark, robot)
    benchmark.group = f"compiling inverse dynamics, {robot}"
    folders = count()

    def setup() -> tuple[tuple[Model], dict[str, Any]]:
        monkeypatch.setenv("DYNX_CACHE_DIR", str(tmp_path / str(next(folders) if cache == "cold" else 0)))
        return (COMPILED_ROBOTS[robot](),), {}

    def compile_and_call(model: Model) -> Floats:
        with backend("compiled", model) as engine:
            zero = np.zeros(model.nv)
            return engine.inverse_dynamics(zero, zero, zero)

    (model,), _ = setup()
    with backend("reference", model) as reference:
        expected = reference.gravity_torque(np.zeros(model.nq))
    scale = np.max(np.abs(expected))
    np.testing.assert_allclose(compile_and_call(model), expected, rtol=0.0, atol=BAR * scale)
    rounds = REPETITIONS if robot in FRAMES else REPETITIONS_OF_SECONDS
    _repeat(benchmark, compile_and_call, rounds=rounds, setup=setup)


def _time(benchmark: BenchmarkFixture, robot: str, case: BenchmarkCase, name: str) -> None:
    _skip_untimed(benchmark, robot)
    try:
        implementation = implementation_of(robot, name, case.threads)
    except (NotInstalledError, EngineLimitError) as reason:
        pytest.skip(str(reason))
    if not implementation.supports(case):
        pytest.skip(f"{name} does not do this for this robot")
    benchmark.group = f"{case.quantity}, {robot}, batch {case.batch}, threads {case.threads}"
    ready, samples = checked_call(implementation, case, batch_of(robot, case.batch))
    rounds = REPETITIONS_OF_SECONDS if name in TAKE_SECONDS else REPETITIONS
    _repeat(benchmark, ready.call, rounds=rounds, iterations=max(1, 1000 // samples))
    if isinstance(implementation, CompilingPeer):
        benchmark.extra_info.update(compile_seconds=implementation.compile_seconds)
    if benchmark.stats is not None:
        benchmark.extra_info.update(
            samples=samples,
            ns=1e9 * float(benchmark.stats.stats.median) / samples,
            version=implementation.version,
        )


def _repeat(
    benchmark: BenchmarkFixture, call: Callable[..., Any], rounds: int = REPETITIONS, **options: Any
) -> None:
    repeat: Any = benchmark.pedantic
    repeat(call, rounds=rounds, **options)


def _skip_untimed(benchmark: BenchmarkFixture, robot: str) -> None:
    if benchmark.disabled and robot != UNTIMED_ROBOT:
        pytest.skip(f"nothing is timed, and {UNTIMED_ROBOT} shows that it runs")
