"""One closed loop and batches of rollouts, each beside its peers: ``pytest benchmarks/test_simulation.py``.

Every answer is checked before it is timed. ``us`` and ``ns`` in the extra information are those of one step.
``python -m benchmarks.simulation`` does the same with repetitions of all in turn, and prints one table.
"""

from __future__ import annotations

from typing import Any

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.closed_loops import LOOPS, closed_loop
from benchmarks.rollout_batches import BATCHES, FULL, QUICK, rollout_batch
from benchmarks.simulator import Simulator, assert_right
from dynx.control import ComputedTorque
from dynx.errors import NotInstalledError
from dynx.sim import Scenario, Simulation

REPETITIONS, REPETITIONS_OF_BATCHES = 20, 5
THREADS = (1, 2)


@pytest.mark.parametrize("name", LOOPS)
def test_closed_loop(benchmark: BenchmarkFixture, name: str) -> None:
    size = QUICK if benchmark.disabled else FULL
    try:
        loop = closed_loop(name, size.task)
    except NotInstalledError as reason:
        pytest.skip(str(reason))
    benchmark.group = "closed loop, UR5"
    _time(benchmark, loop, REPETITIONS)


@pytest.mark.parametrize("threads", THREADS)
@pytest.mark.parametrize("name", BATCHES)
def test_batch_of_rollouts(benchmark: BenchmarkFixture, name: str, threads: int) -> None:
    try:
        batch = rollout_batch(name, QUICK if benchmark.disabled else FULL, threads)
    except NotInstalledError as reason:
        pytest.skip(str(reason))
    benchmark.group = f"rollouts, UR5, threads {threads}"
    _time(benchmark, batch, REPETITIONS_OF_BATCHES)


@pytest.mark.parametrize("plant", ["pinocchio", "pybullet"])
def test_steps_of_the_caller(benchmark: BenchmarkFixture, plant: str) -> None:
    """One `Simulation.step` at a time, beside `test_closed_loop`: at most 5 us more than there."""
    task = (QUICK if benchmark.disabled else FULL).task
    controller = ComputedTorque(task.model, kp=400, kd=40)
    try:
        simulation = Simulation(Scenario(task.model, controller, task.motion, plant=plant))
    except NotInstalledError as reason:
        pytest.skip(str(reason))
    benchmark.group = "closed loop, UR5"
    with simulation:
        assert simulation.n_steps is not None
        repeat: Any = benchmark.pedantic
        repeat(simulation.step, rounds=simulation.n_steps)
    if benchmark.stats is not None:
        benchmark.extra_info.update(us=1e6 * float(benchmark.stats.stats.median))


def _time(benchmark: BenchmarkFixture, simulator: Simulator, rounds: int) -> None:
    try:
        assert_right(simulator)
        repeat: Any = benchmark.pedantic
        repeat(simulator.call, rounds=rounds)
    finally:
        simulator.close()
    if benchmark.stats is not None:
        seconds = float(benchmark.stats.stats.median) / simulator.steps
        benchmark.extra_info.update(steps=simulator.steps, us=1e6 * seconds, ns=1e9 * seconds)
