"""A step with dry friction beside one without, as a table: ``python -m benchmarks.dry_friction``.

Both simulations advance in turn, and the processor time of the fastest round counts, so that other programs
on the machine disturb little. The target is at most twice the time.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from time import process_time
from typing import Any

import numpy as np

from dynx.bench.timing import interleaved
from dynx.control import PD, ComputedTorque
from dynx.errors import DynxError
from dynx.model import Model
from dynx.model.loading import load
from dynx.sim import Scenario, Simulation, simulate_batch

ROBOTS = ("ur5", "panda", "talos")
PLANTS = ("pinocchio", "compiled", "pybullet", "mujoco", "drake")
FRICTION = (0.0, 0.5)
"""Dry friction of every joint [N m]."""
WITHOUT: dict[str, Any] = {"joint_damping": False, "joint_armature": False}
"""Joint dynamics of the description that neither of the two has."""
STEPS, DT = 300, 1e-3
BATCH = 1024
"""Rollouts of a batch."""

MAX_RATIO = 2.0
"""Target."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a table; 1 where a step with friction costs more than `MAX_RATIO` times one without."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robots", nargs="*", default=ROBOTS)
    parser.add_argument("--plant", action="append", choices=PLANTS)
    parser.add_argument("--rounds", type=int, default=12)
    parser.add_argument("--integrator", help="integrator of dynx, or the default of the plant")
    parser.add_argument("--batch", action="store_true", help="batches too; those of humanoids compile long")
    options = parser.parse_args(arguments)
    print(f"{'':24}{'without':>10}{'with':>10}{'ratio':>8}{'stuck':>8}   [us a step]")
    missed = False
    for robot in options.robots:
        model = load(robot)
        for plant in options.plant or PLANTS:
            try:
                simulations = [_simulation(model, plant, f, options.integrator) for f in FRICTION]
            except DynxError as reason:
                print(f"{robot} on {plant}: {reason}")
                continue
            without, rubbing = fastest([_advance(each) for each in simulations], options.rounds)
            stuck = float(np.mean(simulations[1].rollout.v == 0.0))
            missed |= _print_row(f"{robot} on {plant}", without / STEPS, rubbing / STEPS, stuck)
            for each in simulations:
                each.close()
        if options.batch:
            without, rubbing = fastest([_batch(model, f) for f in FRICTION], options.rounds)
            steps = STEPS * BATCH
            missed |= _print_row(f"{robot}, batch", without / steps, rubbing / steps, np.nan)
    return int(missed)


def fastest(advances: Sequence[Callable[[], object]], rounds: int) -> list[float]:
    """Return the least processor time [s] of each function, called in turn."""
    return [each.least for each in interleaved(advances, rounds, process_time, calls_per_timing=1)]


def _print_row(name: str, without: float, rubbing: float, stuck: float) -> bool:
    """Print a row; return whether it misses the target."""
    ratio = rubbing / without
    print(f"{name:24}{1e6 * without:10.3g}{1e6 * rubbing:10.3g}{ratio:8.2f}{stuck:8.2f}", flush=True)
    return ratio > MAX_RATIO


def _simulation(model: Model, plant: str, friction: float, integrator: str | None) -> Simulation:
    start = model.clip(model.neutral())
    goal = model.clip(model.integrate(start, np.full(model.nv, 0.1)))
    law = ComputedTorque(model, kp=100, kd=20, backend="compiled")
    options: dict[str, Any] = WITHOUT | {"joint_friction": friction, "integrator": integrator}
    return Simulation(Scenario(model, law, goal, q0=start, plant=plant, **options))


def _advance(simulation: Simulation) -> Callable[[], object]:
    return lambda: simulation.run(until=round(simulation.time + STEPS * DT, 6))


def _batch(model: Model, friction: float) -> Callable[[], object]:
    start = model.clip(model.neutral())
    goal = model.clip(model.integrate(start, np.full(model.nv, 0.1)))
    law = PD(model, kp=20.0, kd=2.0)

    def run() -> object:
        return simulate_batch(
            model,
            law,
            goal,
            q0=start,
            **WITHOUT | {"joint_friction": friction},
            rollouts=BATCH,
            duration=STEPS * DT,
            threads=1,
        )

    return run


if __name__ == "__main__":
    sys.exit(main())
