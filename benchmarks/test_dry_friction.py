"""A step with dry friction beside one without: ``pytest benchmarks/test_dry_friction.py``.

The target is at most twice the time. ``us`` and ``ns`` in the extra information are those of one step.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

import dynx
from benchmarks.rollout_batches import FULL, QUICK
from dynx.control import ComputedTorque
from dynx.errors import NotInstalledError
from dynx.sim import Scenario, Simulation, simulate_batch

ROUNDS, STEPS = 20, 300
FRICTION = {"without": 0.0, "with": 0.5}
"""Dry friction of every joint [N m]."""


@pytest.mark.parametrize("friction", FRICTION)
@pytest.mark.parametrize("plant", ["pinocchio", "compiled", "pybullet"])
@pytest.mark.parametrize("robot", ["ur5", "talos"])
def test_step(benchmark: BenchmarkFixture, robot: str, plant: str, friction: str) -> None:
    try:
        model = dynx.load(robot)
        controller = ComputedTorque(model, kp=100, kd=20, backend="compiled")
        goal = model.clip(model.neutral() + 0.1)
        scenario = Scenario(
            model, controller, goal, q0=model.clip(model.neutral()), plant=plant, friction=FRICTION[friction]
        )
        simulation = Simulation(scenario)
    except NotInstalledError as reason:
        pytest.skip(str(reason))
    benchmark.group = f"{robot} on {plant}"
    steps = 10 if benchmark.disabled else STEPS
    repeat: Any = benchmark.pedantic

    def advance() -> None:
        simulation.run(until=simulation.time + steps * 1e-3)

    with simulation:
        repeat(advance, rounds=1 if benchmark.disabled else ROUNDS)
        assert simulation.rollout.scenario == scenario
        assert np.isfinite(simulation.rollout.q).all()
    if benchmark.stats is not None:
        benchmark.extra_info.update(us=1e6 * float(benchmark.stats.stats.min) / steps)


@pytest.mark.parametrize("friction", FRICTION)
def test_batch(benchmark: BenchmarkFixture, friction: str) -> None:
    task, rollouts = (QUICK if benchmark.disabled else FULL).task, 16 if benchmark.disabled else 1024
    controller = ComputedTorque(task.model, kp=400, kd=40)
    benchmark.group = "batch of UR5"

    def batch() -> dynx.sim.BatchRollouts:
        given: dict[str, Any] = {"rollouts": rollouts, "threads": 1, "friction": FRICTION[friction]}
        return simulate_batch(task.model, controller, task.motion, dt=1e-3, **given)

    repeat: Any = benchmark.pedantic
    many = repeat(batch, rounds=1 if benchmark.disabled else 5, warmup_rounds=1)
    assert np.isnan(many.diverged).all()
    if benchmark.stats is not None:
        seconds = float(benchmark.stats.stats.min)
        benchmark.extra_info.update(ns=1e9 * seconds / rollouts / round(task.motion.duration / 1e-3))
