"""`World.closest_points` beside the distances of the engine: ``pytest benchmarks/test_distances.py``.

A robot and a crate, apart or overlapping. ``us`` and ``native_us`` in the extra information are the times per
pair of links.
"""

from __future__ import annotations

import time
from functools import partial
from typing import Any

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

import dynx
from dynx.bench.timing import interleaved
from dynx.world import Scene, SceneRobot, World, box

ROUNDS = 30


@pytest.mark.parametrize("where", [(0.9, 0.9, 0.15), (0.3, 0.0, 0.15)], ids=["apart", "overlapping"])
@pytest.mark.parametrize("robot", ["a1", "ur5"])
@pytest.mark.parametrize("engine", ["pybullet", "mujoco", "drake"])
def test_closest_points(
    benchmark: BenchmarkFixture, engine: str, robot: str, where: tuple[float, float, float]
) -> None:
    pytest.importorskip("pydrake" if engine == "drake" else engine)
    crate = box("crate", (0.3, 0.3, 0.3), pose=dynx.Pose(where))
    scene = Scene("s", robots=(SceneRobot("robot", dynx.load(robot)),), bodies=(crate,))
    with World(scene, engine) as world:
        calls = [
            partial(world.closest_points, "robot", "crate", within=5.0, native=native)
            for native in (False, True)
        ]
        rounds = 1 if benchmark.disabled else ROUNDS
        times = interleaved(calls, rounds, time.process_time, calls_per_timing=1)
        own, native = (1e6 * each.least / len(call()) for each, call in zip(times, calls, strict=True))
        repeat: Any = benchmark.pedantic
        repeat(
            lambda: world.closest_points("robot", "crate", within=5.0),
            rounds=1 if benchmark.disabled else ROUNDS,
        )
    benchmark.extra_info.update(us=own, native_us=native)
