"""Whole batches, few samples and one: the compiled backend beside its peers, in one run.

``pytest benchmarks/test_batches.py`` times five quantities of three robots; every answer is checked
against the backend `reference` first. Peers that answer one sample at a call may be timed at fewer
samples than the batch has; ``ns`` in the extra information is that of one sample. `dynx bench` prints
the same with repetitions of all ways in turn, and how near a kernel comes to the machine's limits.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.compiling_peer import CompilingPeer
from benchmarks.peers import (
    FRAMES,
    HAVE_THREADS,
    ONLY_BATCHES,
    TAKE_SECONDS,
    WAYS,
    batch_of,
    checked_call,
    tree_of_joints,
    way_of,
)
from dynx.agreement.tolerances import BAR
from dynx.backends import backend
from dynx.bench.cases import Work
from dynx.errors import EngineLimitError, NotInstalledError
from dynx.model import Model
from dynx.model.loading import load
from dynx.spatial.scalar import Floats

UNTIMED_ROBOT = "ur5"
BATCH, BATCH_UNTIMED = 65536, 256
FEW = 8
REPETITIONS = 20
REPETITIONS_OF_SECONDS = 5
"""Of what takes seconds each time."""

COMPILED_ROBOTS: dict[str, Callable[[], Model]] = {
    "ur5": lambda: load("ur5"),
    "talos_reduced": lambda: load("talos_reduced"),
    "tree of 100 joints": lambda: tree_of_joints(100),
}
"""Robots for which compiling is timed, from the model to the first answer."""

CASES = [(quantity, way) for way, quantities in WAYS.items() for quantity in quantities]
THREADED = [case for case in CASES if case[1] in HAVE_THREADS]


@pytest.mark.parametrize(("quantity", "way"), CASES)
@pytest.mark.parametrize("robot", FRAMES)
def test_batch(benchmark: BenchmarkFixture, robot: str, quantity: str, way: str) -> None:
    _time(benchmark, robot, Work(quantity, BATCH_UNTIMED if benchmark.disabled else BATCH), way)


@pytest.mark.parametrize(("quantity", "way"), THREADED)
@pytest.mark.parametrize("robot", FRAMES)
def test_batch_on_two_threads(benchmark: BenchmarkFixture, robot: str, quantity: str, way: str) -> None:
    _time(benchmark, robot, Work(quantity, BATCH_UNTIMED if benchmark.disabled else BATCH, threads=2), way)


@pytest.mark.parametrize(("quantity", "way"), [case for case in CASES if case[1] not in TAKE_SECONDS])
@pytest.mark.parametrize("robot", FRAMES)
def test_few_samples(benchmark: BenchmarkFixture, robot: str, quantity: str, way: str) -> None:
    _time(benchmark, robot, Work(quantity, FEW), way)


@pytest.mark.parametrize(("quantity", "way"), [case for case in CASES if case[1] not in ONLY_BATCHES])
@pytest.mark.parametrize("robot", FRAMES)
def test_one_sample(benchmark: BenchmarkFixture, robot: str, quantity: str, way: str) -> None:
    _time(benchmark, robot, Work(quantity, 1), way)


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


def _time(benchmark: BenchmarkFixture, robot: str, work: Work, name: str) -> None:
    _skip_untimed(benchmark, robot)
    try:
        way = way_of(robot, name, work.threads)
    except (NotInstalledError, EngineLimitError) as reason:
        pytest.skip(str(reason))
    if not way.does(work):
        pytest.skip(f"{name} does not do this for this robot")
    benchmark.group = f"{work.quantity}, {robot}, batch {work.batch}, threads {work.threads}"
    ready, samples = checked_call(way, work, batch_of(robot, work.batch))
    rounds = REPETITIONS_OF_SECONDS if name in TAKE_SECONDS else REPETITIONS
    _repeat(benchmark, ready.call, rounds=rounds, iterations=max(1, 1000 // samples))
    if isinstance(way, CompilingPeer):
        benchmark.extra_info.update(compile_seconds=way.compile_seconds)
    if benchmark.stats is not None:
        benchmark.extra_info.update(
            samples=samples, ns=1e9 * float(benchmark.stats.stats.median) / samples, version=way.version
        )


def _repeat(
    benchmark: BenchmarkFixture, call: Callable[..., Any], rounds: int = REPETITIONS, **options: Any
) -> None:
    repeat: Any = benchmark.pedantic
    repeat(call, rounds=rounds, **options)


def _skip_untimed(benchmark: BenchmarkFixture, robot: str) -> None:
    if benchmark.disabled and robot != UNTIMED_ROBOT:
        pytest.skip(f"nothing is timed, and {UNTIMED_ROBOT} shows that it runs")
