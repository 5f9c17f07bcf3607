"""A step of `World` beside the engine's own step: ``pytest benchmarks/test_world.py``.

A quadruped floats above a plane, with and without torques or motors on its joints, so that every step costs
the same. The target is at most 5 microseconds more than the raw engine; ``us``, ``raw_us`` and ``more_us`` in
the extra information are one step. Both sides step the same world in turn, and get the same array of
torques. Beside motors, the raw loop reads the joints from the engine, evaluates the law of a PD motor with
NumPy, and applies the torques.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

import dynx
from dynx.bench.timing import interleaved
from dynx.spatial.scalar import Floats
from dynx.world import PDMotor, PositionMotor, Scene, SceneRobot, World, ground

ROUNDS, STEPS = 60, 200


def floating(engine: str) -> World:
    """Return a world with a quadruped above a plane, without gravity."""
    model = dynx.load("solo12", base="floating")
    q = np.zeros(model.nq)
    q[2], q[6], q[7:] = 5.0, 1.0, np.tile([0.0, 0.8, -1.6], 4)
    robot = SceneRobot("dog", model, q=tuple(q))
    return World(Scene("s", robots=(robot,), bodies=(ground(),), gravity=(0.0, 0.0, 0.0)), engine)


STANCE, KP, KD = np.tile([0.0, 0.8, -1.6], 4), 10.0, 0.2


def raw_step(world: World, tau: Floats | None, *, motors: bool = False) -> Callable[[], None]:
    """Return the engine's own step of a world, with torques (18,) or with a user's own PD law."""
    engine: Any = world._motion.engine
    if world.engine == "pybullet":
        import pybullet

        robot, client = engine.robots[0].object, engine.client.number

        def step() -> None:
            forces = None
            if tau is not None:
                # PyBullet reads a list three times as fast as an array.
                forces = tau[6:].tolist()
            if motors:
                states = pybullet.getJointStates(robot.body, robot.links, physicsClientId=client)
                q, v = (np.array([state[k] for state in states]) for k in range(2))
                forces = KP * (STANCE - q) - KD * v
            if forces is not None:
                pybullet.setJointMotorControlArray(
                    robot.body,
                    robot.links,
                    pybullet.TORQUE_CONTROL,
                    forces=forces,
                    physicsClientId=client,
                )
            pybullet.stepSimulation(physicsClientId=client)

        return step
    import mujoco

    model, data = engine.model, engine.data
    dofs = slice(model.nv - 12, model.nv)

    def advance() -> None:
        if motors:
            data.qfrc_applied[dofs] = KP * (STANCE - data.qpos[-12:]) - KD * data.qvel[dofs]
        elif tau is not None:
            data.qfrc_applied[dofs] = tau[6:]
        mujoco.mj_step(model, data)

    return advance


@pytest.mark.parametrize("loaded", [False, True], ids=["free", "torques"])
@pytest.mark.parametrize("engine", ["pybullet", "mujoco"])
def test_world_step(benchmark: BenchmarkFixture, engine: str, loaded: bool) -> None:
    pytest.importorskip(engine)
    tau = np.zeros(18)
    tau[6:] = 1e-6
    torques = {"dog": tau} if loaded else None
    with floating(engine) as world:
        raw = raw_step(world, tau if loaded else None)
        compare(benchmark, world, raw, lambda: world.step(torques=torques))
    benchmark.group = f"{engine}, {'torques' if loaded else 'free'}"


@pytest.mark.parametrize("motor", [PDMotor, PositionMotor])
@pytest.mark.parametrize("engine", ["pybullet", "mujoco"])
def test_world_step_with_motors(
    benchmark: BenchmarkFixture, engine: str, motor: type[PDMotor | PositionMotor]
) -> None:
    pytest.importorskip(engine)
    motors = {"dog": motor(STANCE, KP, KD, max_force=3.0)}
    with floating(engine) as world:
        compare(benchmark, world, raw_step(world, None, motors=True), lambda: world.step(motors=motors))
    benchmark.group = f"{engine}, {motor.__name__}"


def compare(
    benchmark: BenchmarkFixture, world: World, raw: Callable[[], None], step: Callable[[], None]
) -> None:
    """Time a step of the world and of the raw engine in turn, because the load of the machine changes."""
    steps = 3 if benchmark.disabled else STEPS
    rounds = 1 if benchmark.disabled else ROUNDS
    times = interleaved([step, raw], rounds, time.process_time, calls_per_timing=steps)
    of_world, of_raw = (1e6 * each.least for each in times)
    repeat: Any = benchmark.pedantic
    repeat(step, rounds=rounds)
    assert np.isfinite(world.state.robots["dog"].q).all()
    benchmark.extra_info.update(us=of_world, raw_us=of_raw, more_us=of_world - of_raw)
