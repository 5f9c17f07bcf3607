"""Times to compile every kind of kernel for robots of the library: ``python -m benchmarks.compile_times``.

Every kind is compiled in a process of its own with an empty cache, by the public function that needs it, and
on small data. A time is that of the processors, of all threads together, so that other load on the machine
changes it little; it includes tracing and one evaluation. Rows are printed as they are measured, robots with
most joints first, and the `LONGEST` longest again at the end. A time above `MAX_SECONDS`, or an error other
than dynx's refusal of a robot, ends the command with 1.

``--record FILE`` adds each row to a file when it is measured. Rows that the file has are not measured again,
so an interrupted run continues where it stopped; use it with one state of the source.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import resource
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import ceil
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import numpy as np

from benchmarks.every_quantity import serial_arm, tree
from benchmarks.progress import Record, tell
from dynx import ExternalForce, control
from dynx.backends import backend
from dynx.backends.quantities import QUANTITIES
from dynx.compiled.derivatives import Derivatives
from dynx.compiled.parametric import ParametricDynamics, parametric
from dynx.errors import DescriptionError, DynxError
from dynx.model import Model
from dynx.model.library import robots
from dynx.model.loading import load
from dynx.model.tree import Base
from dynx.sim import Noise, simulate, simulate_batch

MAX_SECONDS = 10.0
"""Longest time that a compilation may take [s]."""

LONGEST = 20
"""Number of rows that are printed again at the end."""

WITHOUT: dict[str, Any] = {"joint_damping": False, "joint_friction": False, "joint_armature": False}
"""Joint dynamics of the description, which only the kinds with dry friction have."""

ROBOTS = (
    "tiago_dual",
    "tiago",
    "g1_with_hands",
    "centauro",
    "alex_psyonic_hands",
    "human",
    "romeo",
    "talos",
    "icub",
    "g1",
    "tiago_pro",
    "pr2",
    "anymal_kinova",
    "baxter",
    "allegro_left_hand",
    "alexander",
    "solo12",
    "hyq",
    "panda",
    "ur5",
)
"""Robots that are compiled by default, from 101 joints to 6: humanoids, hands, arms on wheels and on legs,
quadrupeds and arms of the library, the largest of those that are built alike first."""

BASES: tuple[Base, ...] = ("fixed", "floating")

DT = 1e-3
"""Step of the simulations [s]."""

ROLLOUTS = 16
"""Rollouts of a batch, which suffice for every number of lanes."""

LONG_ENOUGH = 257
"""Steps of one simulation, from which on its step is compiled."""

Kind = Callable[[Model], object]


@dataclass(frozen=True)
class Compilation:
    """A kind of kernel, a robot, and what its compilation took; seconds are None if it did not finish."""

    robot: str
    kind: str
    seconds: float | None
    mebibytes: float
    problem: str = ""

    @property
    def failed(self) -> bool:
        """True if it took too long or did not finish."""
        return self.seconds is None or self.seconds > MAX_SECONDS

    def __str__(self) -> str:
        taken = "ended" if self.seconds is None else f"{self.seconds:.2f}"
        return f"{taken:>8} {self.mebibytes:6.0f}  {self.robot:36}{self.kind}  {self.problem}".rstrip()


def _state(model: Model) -> dict[str, Any]:
    rng = np.random.default_rng(0)
    v, a, tau = rng.uniform(-0.5, 0.5, (3, model.nv))
    return {"q": model.random(rng), "v": v, "a": a, "tau": tau}


def _quantity(model: Model, quantity: str) -> object:
    state, described = _state(model), QUANTITIES[quantity]
    frame = (model.frame_names[-1],) if described.of_frame else ()
    method = getattr(backend("compiled", model, threads=1), quantity)
    return method(*(state[argument] for argument in described.arguments), *frame)


def _derivatives(model: Model, what: str) -> object:
    state, derivatives = _state(model), Derivatives(model, threads=1)
    if what == "inverse dynamics":
        return derivatives.inverse_dynamics_derivatives(state["q"], state["v"], state["a"])
    if what == "forward dynamics":
        return derivatives.forward_dynamics_derivatives(state["q"], state["v"], state["tau"])
    return derivatives.forward_kinematics_derivative(state["q"], model.frame_names[-1])


def _everything_a_parameter(model: Model) -> ParametricDynamics:
    links = [link.name for link in model.links]
    tip = model.frame_names[-1]
    return parametric(model, links=links, payload=tip, point_payload=tip, joint_dynamics=True, threads=1)


def _parametric(model: Model, quantity: str) -> object:
    state = _state(model)
    method = getattr(_everything_a_parameter(model), quantity)
    return method(*(state[argument] for argument in QUANTITIES[quantity].arguments))


def _batch(model: Model, controller: control.Controller[Any], **options: Any) -> object:
    q = np.tile(model.neutral(), (ROLLOUTS, 1))
    return simulate_batch(
        model,
        controller,
        model.neutral(),
        q0=q,
        duration=2 * DT,
        dt=DT,
        threads=1,
        check_reference=False,
        **WITHOUT | options,
    )


def _controller(model: Model, backend: str = "reference") -> control.Controller[Any]:
    """Return computed torque, or a controller of the joints alone for a floating base."""
    if model.floating:
        return control.PD(model, kp=100.0, kd=10.0)
    return control.ComputedTorque(model, kp=400.0, kd=40.0, backend=backend)


def _batch_with(model: Model, **options: Any) -> object:
    return _batch(model, _controller(model), **options)


def _batch_with_everything(model: Model) -> object:
    push = ExternalForce(model.frame_names[-1], (1.0, 0.0, 0.0, 0.0, 0.1, 0.0), duration=DT)
    noise = Noise(q=1e-4, v=1e-3, seed=0)
    options: dict[str, Any] = {"parametric": _everything_a_parameter(model), "pushes": push, "noise": noise}
    options["effort_limits"] = 100.0
    return _batch_with(model, delay=2 * DT, joint_limits=True, **options)


def _batch_in_operational_space(model: Model) -> object:
    if model.floating:
        return None
    tip = model.frame_names[-1]
    return _batch(model, control.OperationalSpace(model, tip, kp=400.0, kd=40.0, backend="reference"))


def _simulation(model: Model, **options: Any) -> object:
    return simulate(
        model,
        # A controller in NumPy would take seconds for the steps of a large robot.
        _controller(model, "compiled"),
        model.neutral(),
        plant="compiled",
        duration=LONG_ENOUGH * DT,
        dt=DT,
        check_reference=False,
        **WITHOUT | options,
    )


KINDS: dict[str, Kind] = {
    **{name: partial(_quantity, quantity=name) for name in QUANTITIES},
    **{
        f"derivatives of {what}": partial(_derivatives, what=what)
        for what in ("inverse dynamics", "forward dynamics", "a pose")
    },
    **{
        f"parametric {name}": partial(_parametric, quantity=name)
        for name in ("inverse_dynamics", "forward_dynamics", "mass_matrix")
    },
    "batch, plain": _batch_with,
    "batch, dry friction": partial(_batch_with, joint_friction=0.1, joint_damping=0.1, joint_armature=0.01),
    "batch, smooth friction": partial(
        _batch_with, joint_friction=0.1, joint_damping=0.1, friction_slip=100.0
    ),
    "batch, position limits": partial(_batch_with, joint_limits=True),
    "batch, all parameters, noise, limits, pushes": _batch_with_everything,
    "batch, operational space": _batch_in_operational_space,
    "simulation, plain": _simulation,
    "simulation, dry friction": partial(
        _simulation, joint_friction=0.1, joint_damping=0.1, joint_armature=0.01
    ),
}
"""Functions that compile each kind of kernel for a robot."""


def measure(robot: str, model: Model, kind: str, limit: float) -> Compilation:
    """Compile a kind of kernel in a new process, which is ended after `limit` seconds of processor time."""
    receiving, sending = multiprocessing.Pipe(duplex=False)
    process = multiprocessing.Process(target=_compile, args=(model, kind, limit, sending))
    process.start()
    sending.close()
    try:
        seconds, mebibytes, problem = receiving.recv()
    except EOFError:
        process.join()
        seconds, mebibytes = None, 0.0
        problem = f"ended after {limit:g} s, or by signal {-(process.exitcode or 0)}"
    finally:
        process.kill()
        process.join()
    return Compilation(robot, kind, seconds, mebibytes, problem)


def _compile(model: Model, kind: str, limit: float, results: Any) -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (ceil(limit), ceil(limit)))
    with TemporaryDirectory() as folder:
        os.environ["DYNX_CACHE_DIR"] = folder
        start, problem = process_time(), ""
        seconds: float | None = None
        try:
            KINDS[kind](model)
            seconds = process_time() - start
        except Exception as error:
            problem = f"{type(error).__name__}: {error}"
            if isinstance(error, DynxError):
                # The robot has no such quantity, a unique acceleration for example.
                seconds = process_time() - start
    results.send((seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, problem))


def chosen_robots(names: Sequence[str], bases: Sequence[Base]) -> list[tuple[str, Model]]:
    """Return robots of the library with each base, those with most joints first; ``tree:101`` and
    ``serial:64`` are trees and arms of so many joints."""
    found: list[tuple[str, Model]] = []
    for name in names:
        kind, _, count = name.partition(":")
        if count:
            found.append((name, (tree if kind == "tree" else serial_arm)(int(count))))
        else:
            found += [(f"{name}, {base}", load(name, base=base)) for base in bases]
    return sorted(found, key=lambda each: -each[1].nv)


def usable_robots() -> list[str]:
    """Return the names of all robots of the library but those whose files have no robot."""
    return [robot.name for robot in robots() if _has_a_robot(robot.name)]


def _has_a_robot(name: str) -> bool:
    try:
        load(name)
    except DescriptionError as error:
        print(f"{name} is left out: {error}", file=sys.stderr)
        return False
    return True


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; return 1 if a compilation takes longer than `MAX_SECONDS` or fails."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.compile_times", description=__doc__)
    parser.add_argument(
        "--robots", nargs="+", default=ROBOTS, metavar="ROBOT", help="names, tree:N, serial:N, or all"
    )
    parser.add_argument("--bases", nargs="+", default=BASES, choices=BASES)
    parser.add_argument("--kinds", nargs="+", metavar="TEXT", help="kinds whose names contain one of these")
    parser.add_argument(
        "--limit", type=float, default=120.0, help="processor time after which one is ended [s]"
    )
    parser.add_argument("--record", type=Path, metavar="FILE", help="rows measured so far, one in a line")
    chosen = parser.parse_args(arguments)
    kinds = [kind for kind in KINDS if not chosen.kinds or any(text in kind for text in chosen.kinds)]
    models = chosen_robots(usable_robots() if chosen.robots == ["all"] else chosen.robots, chosen.bases)
    record = Record(Compilation, lambda row: (row.robot, row.kind), chosen.record)
    done: list[Compilation] = []
    print(f"{'seconds':>8} {'MiB':>6}  {'robot':36}kind")
    for name, model in models:
        for kind in kinds:
            tell(f"{len(done)} of {len(models) * len(kinds)} rows; {name}: {kind}")
            row = record.get((name, kind), partial(measure, name, model, kind, chosen.limit))
            tell("")
            print(row, flush=True)
            done.append(row)
    failed = [row for row in done if row.failed]
    if len(done) > LONGEST:
        print(f"\n{len(done)} rows, {len(failed)} of them too long or not finished; the longest:")
        done.sort(key=lambda row: chosen.limit if row.seconds is None else row.seconds, reverse=True)
        print(*done[:LONGEST], sep="\n")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
