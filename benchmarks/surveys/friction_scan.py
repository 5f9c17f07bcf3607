"""Search for joints that rattle under dry friction, over all robots::

    python -m benchmarks.surveys.friction_scan

Each robot falls without motors from a random state, at three steps, with the friction, damping and armature
of its description and with friction drawn over six decades, in single runs and in batches. A joint rattles if
it reverses in three steps in a row, which gravity and inertia do not do. Steps after the energy of a robot
has grown do not count: without motors it can only fall, and friction takes energy at any step, so that the
step is too long there for Euler's method, with friction or without. Results are written line by line to a
file, from which an interrupted search continues.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from dynx.backends import backend
from dynx.control import PD
from dynx.errors import DivergedError, DynxError
from dynx.model import Model
from dynx.model.library import robots
from dynx.model.loading import load
from dynx.sim import simulate, simulate_batch
from dynx.sim.plants.disturbances import Disturbances
from dynx.spatial.scalar import Floats

STEPS = (1e-2, 1e-3, 1e-4)
"""Steps dt [s]."""

LENGTH = 200
"""Number of steps of a run."""

ROWS = 16
"""Number of rollouts in a batch."""

DECADES = (-3.0, 3.0)
"""Powers of ten between which dry friction is drawn [N m or N]."""


MAX_GAIN = 0.1
"""Gain of energy, as a fraction of the largest kinetic energy, above which Euler's method is unstable:
friction and gravity cannot cause it."""

MIN_EIGENVALUE = 1e-3
"""Smallest eigenvalue of the mass matrix, scaled to a unit diagonal, at which a step counts. Where axes of
light links become parallel, as in shoulders and necks, the inertia about one direction vanishes for a few
steps."""

MAX_SPEED = 1e6
"""Velocity [rad/s or m/s] above which it is unstable in any case."""


class Case(NamedTuple):
    """One run or batch of the search."""

    robot: str
    dt: float
    friction: str
    """``file`` for that of the description, or ``drawn``."""
    batch: bool


class Finding(NamedTuple):
    """Result of a case."""

    rattling: list[str]
    """Names of the joints that reversed in one step after another."""
    stuck: float
    """Share of the velocities of joints that are zero."""
    note: str
    """Error message, if there was one."""


def rattling_joints(model: Model, q: Floats, v: Floats, armature: Floats) -> list[str]:
    """Return the joints whose velocities change their sign in three steps in a row, in any of n runs.

    `q` (n, steps, nq) and `v` (n, steps, nv) are records, `armature` (nv,) belongs to the coordinates.
    """
    direction = np.sign(v[..., 6 if model.floating else 0 :])
    turns = direction[:, 1:] * direction[:, :-1] < 0.0
    repeated = turns[:, 2:] & turns[:, 1:-1] & turns[:, :-2]
    found: set[int] = set()
    for row in np.unique(np.nonzero(repeated)[0]).tolist():
        stable = _stable_steps(model, q[row], v[row], armature)
        found |= set(np.nonzero(repeated[row, : max(0, stable - 3)])[1].tolist())
    return [model.joint_names[k] for k in sorted(found)]


def _stable_steps(model: Model, q: Floats, v: Floats, armature: Floats) -> int:
    """Return the number of steps in which the acceleration is well determined and energy does not grow."""
    sound = int(np.argmin(np.append((np.abs(v) < MAX_SPEED).all(axis=-1), False)))
    q, v = q[:sound], v[:sound]
    with backend("reference", model, validate=False) as engine:
        kinetic = engine.kinetic_energy(q, v) + 0.5 * (v * v) @ armature
        energy = kinetic + engine.potential_energy(q)
        M = engine.mass_matrix(q) + np.diag(armature)
    gain = energy - np.minimum.accumulate(energy)
    size = np.sqrt(np.diagonal(M, axis1=-2, axis2=-1))
    least = np.linalg.eigvalsh(M / (size[:, :, None] * size[:, None, :]))[:, 0]
    wrong = (gain > MAX_GAIN * np.maximum.accumulate(kinetic)) | (least < MIN_EIGENVALUE)
    return int(np.argmax(np.append(wrong, True)))


def run(case: Case) -> Finding:
    """Simulate a case and look at its velocities."""
    rng = np.random.default_rng(0)
    try:
        model = load(case.robot)
        base = 6 if model.floating else 0
        own = Disturbances(model, True, True, 0.0, True)
        if model.nv == base:
            return Finding([], 0.0, "no joints")
        if case.friction == "file" and not own.friction.dry.any():
            return Finding([], 0.0, "no friction in the description")
        q, v = (_batch if case.batch else _single)(model, case, rng)
    except DynxError as error:
        return Finding([], 0.0, f"{type(error).__name__}: {error}"[:200])
    armature = own.armature.diagonal() * (case.friction == "file")
    joints = v[np.isfinite(v).all(axis=-1)][..., base:]
    return Finding(rattling_joints(model, q, v, armature), float(np.mean(joints == 0.0)), "")


def _single(model: Model, case: Case, rng: np.random.Generator) -> tuple[Floats, Floats]:
    options: dict[str, Any] = {"joint_friction": True, "joint_damping": True, "joint_armature": True}
    if case.friction == "drawn":
        options = {**dict.fromkeys(options, False), "joint_friction": _drawn(model, rng, 1)[0]}
    options |= {"duration": LENGTH * case.dt, "plant": "compiled", "joint_limits": False}
    options |= {"q0": _start(model, rng), "v0": rng.uniform(-1.0, 1.0, model.nv)}
    try:
        rollout = simulate(model, dt=case.dt, **options)
    except DivergedError as error:
        if error.rollout is None:
            raise
        rollout = error.rollout
    return rollout.q[None], rollout.v[None]


def _batch(model: Model, case: Case, rng: np.random.Generator) -> tuple[Floats, Floats]:
    options: dict[str, Any] = {"joint_friction": True, "joint_damping": True, "joint_armature": True}
    if case.friction == "drawn":
        options = {**dict.fromkeys(options, False), "joint_friction": _drawn(model, rng, ROWS)}
    options |= {"duration": LENGTH * case.dt, "record_every": 1, "check_reference": False}
    options |= {"q0": _start(model, rng), "v0": rng.uniform(-1.0, 1.0, (ROWS, model.nv))}
    law = PD(model, kp=0.0, kd=0.0)
    many = simulate_batch(model, law, model.neutral(), dt=case.dt, **options)
    return many.q_record, many.v_record


def _start(model: Model, rng: np.random.Generator) -> Floats:
    """Return a configuration near the neutral one, where the mass matrix of no robot is singular."""
    return model.clip(model.integrate(model.neutral(), rng.uniform(-0.3, 0.3, model.nv)))


def _drawn(model: Model, rng: np.random.Generator, rows: int) -> Floats:
    joints = model.nv - (6 if model.floating else 0)
    return np.asarray(10.0 ** rng.uniform(*DECADES, (rows, joints)))


def cases(names: Sequence[str], *, batches: bool = True) -> Iterator[Case]:
    """Return the cases of some robots, those that need no compilation of their own first."""
    for batch in (False, True)[: 1 + batches]:
        for name in names:
            for dt in STEPS:
                for friction in ("file", "drawn"):
                    yield Case(name, dt, friction, batch)


def main(arguments: Sequence[str] | None = None) -> int:
    """Search all robots or some, print what is found, and return 1 if a joint rattles."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robots", nargs="*", help="names of robots (all of the library)")
    parser.add_argument("--record", type=Path, default=Path("friction-scan.jsonl"), help="file of results")
    parser.add_argument("--single", action="store_true", help="leave out the batches, which are compiled")
    options = parser.parse_args(arguments)
    names = options.robots or [robot.name for robot in robots()]
    lines = options.record.read_text().splitlines() if options.record.exists() else []
    done = {Case(*each["case"]): Finding(*each["finding"]) for each in map(json.loads, lines)}
    wanted = list(cases(names, batches=not options.single))
    for number, case in enumerate(wanted, 1):
        started = perf_counter()
        if case not in done:
            done[case] = run(case)
            with options.record.open("a") as file:
                file.write(json.dumps({"case": case, "finding": done[case]}) + "\n")
            finding, seconds = done[case], perf_counter() - started
            print(f"{number}/{len(wanted)} {case} {finding} {seconds:.1f} s", flush=True)
    found = {case: done[case] for case in wanted}
    rattling = [case for case, finding in found.items() if finding.rattling]
    print(*(f"rattles: {case} {found[case].rattling}" for case in rattling), sep="\n")
    notes = sorted({f"{case.robot}: {each.note}" for case, each in found.items() if each.note})
    print(*notes, sep="\n")
    print(f"{len(rattling)} of {len(found)} cases rattle, of {len(set(names))} robots")
    return 1 if rattling else 0


if __name__ == "__main__":
    sys.exit(main())
