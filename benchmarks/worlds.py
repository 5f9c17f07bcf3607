"""Steps and distances of `World` beside the engine's own: ``python -m benchmarks.worlds``.

A quadruped floats above a plane, with and without torques or motors on its joints, so that every step costs
the same; the target is at most 5 microseconds more than the raw engine. Both sides step the same world in
turn, and get the same array of torques. Beside motors, the raw loop reads the joints from the engine,
evaluates the law of a PD motor with NumPy, and applies the torques.

Then `World.closest_points` of a robot and a crate, apart or overlapping, stands beside the distances of the
engine, for a pair of links. All times are the least processor time, in microseconds.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np

import dynx
from dynx.bench.timing import Call, interleaved
from dynx.spatial.scalar import Floats
from dynx.world import PDMotor, PositionMotor, Scene, SceneRobot, World, ground
from dynx.world import box as scene_box

STEPS = 200
"""Steps of one timing."""

ENGINES = {"pybullet": "pybullet", "mujoco": "mujoco", "drake": "pydrake"}
"""Engines and the packages that they need."""

PLACES = {"apart": (0.9, 0.9, 0.15), "overlapping": (0.3, 0.0, 0.15)}
"""Positions of the crate [m]."""


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


def steps(engine: str, rounds: int, count: int) -> Iterator[str]:
    """Yield the times of a step of the world, of the raw engine, and their difference."""
    tau = np.zeros(18)
    tau[6:] = 1e-6
    loads: dict[str, tuple[dict[str, Any], Floats | None]] = {"free": ({}, None)}
    loads["torques"] = {"torques": {"dog": tau}}, tau
    for motor in (PDMotor, PositionMotor):
        loads[motor.__name__] = {"motors": {"dog": motor(STANCE, KP, KD, max_force=3.0)}}, None
    for name, (given, raw) in loads.items():
        with floating(engine) as world:
            calls: list[Call] = [partial(world.step, **given), raw_step(world, raw, motors="motors" in given)]
            times = interleaved(calls, rounds, time.process_time, calls_per_timing=count)
            if not np.isfinite(world.state.robots["dog"].q).all():
                raise AssertionError(f"{engine}, {name}: the state is not finite")
        own, alone = (1e6 * each.least for each in times)
        yield f"{engine:10}{name:16}{own:10.1f}{alone:10.1f}{own - alone:10.1f}"


def distances(engine: str, rounds: int) -> Iterator[str]:
    """Yield the times of a distance of dynx and of the engine, per pair of links."""
    for robot in ("a1", "ur5"):
        for where, position in PLACES.items():
            crate = scene_box("crate", (0.3, 0.3, 0.3), pose=dynx.Pose(position))
            scene = Scene("s", robots=(SceneRobot("robot", dynx.load(robot)),), bodies=(crate,))
            with World(scene, engine) as world:
                closest = partial(world.closest_points, "robot", "crate", within=5.0)
                calls = [partial(closest, native=native) for native in (False, True)]
                times = interleaved(calls, rounds, time.process_time, calls_per_timing=1)
                own, native = (
                    1e6 * each.least / len(call()) for each, call in zip(times, calls, strict=True)
                )
            yield f"{engine:10}{robot + ', ' + where:16}{own:10.1f}{native:10.1f}{own - native:10.1f}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.worlds", description=__doc__)
    parser.add_argument("--rounds", type=int, default=60)
    parser.add_argument("--quick", action="store_true", help="one round of a few steps, to see that it runs")
    chosen = parser.parse_args(arguments)
    rounds, count = (1, 3) if chosen.quick else (chosen.rounds, STEPS)
    print(f"{'engine':10}{'step':16}{'dynx':>10}{'engine':>10}{'more':>10}")
    installed = [engine for engine, package in ENGINES.items() if find_spec(package)]
    for engine in installed:
        if engine != "drake":
            print(*steps(engine, rounds, count), sep="\n", flush=True)
    print(f"{'engine':10}{'distance':16}{'dynx':>10}{'engine':>10}{'more':>10}")
    for engine in installed:
        print(*distances(engine, rounds), sep="\n", flush=True)


if __name__ == "__main__":
    main()
