"""All solutions of reachable poses of arms with a closed form: how many, how exact, how fast.

``python -m benchmarks.closed_form`` draws configurations within limits and solves for their poses with each
solver (`benchmarks.closed_form.peers`). Pinocchio evaluates every solution before anything is timed; one
counts if it reaches the pose to 1e-6 m and 1e-6 rad, lies within the limits up to full turns, and differs
from the others. Times are processor times on one thread.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks.closed_form.peers import Solver, installed_solvers
from dynx.backends import Backend, backend
from dynx.bench.timing import interleaved
from dynx.ik.closed_forms.chain import chain_to
from dynx.model import Model
from dynx.model.loading import load
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import pose_error
from tests.oracles.closed_form import MODELS

ARMS = {
    "ur5": (load("ur5"), "ee_link"),
    "kinova_j2s6s200": (load("kinova"), "j2s6s200_end_effector"),
    "six_axis_arm": (load(MODELS / "six_axis_arm.urdf"), "flange"),
}
"""Three parallel axes; spherical wrists, in a file with rounded angles and in an exact one."""

TOLERANCE = 1e-6
"""Error [m], [rad] up to which a pose counts as reached."""

SAME = 1e-5
"""Difference of all angles [rad] up to which two solutions are one."""

REPEATS = 7


def turned(q: Floats, low: Floats, high: Floats) -> Floats:
    """Return angles shifted by full turns into their limits where possible."""
    middle = 0.5 * (np.maximum(low, -np.pi) + np.minimum(high, np.pi))
    limited = np.isfinite(low) & np.isfinite(high)
    middle[limited] = 0.5 * (low[limited] + high[limited])
    return np.asarray(middle + np.remainder(q - middle + np.pi, 2.0 * np.pi) - np.pi)


def checked(model: Model, engine: Backend, frame: str, T: Floats, q: Floats) -> tuple[int, float]:
    """Return the number of distinct solutions q (k, 6) of a pose, and the largest error of one."""
    columns = list(chain_to(model, frame, {}).columns)
    low, high = model.lower[columns], model.upper[columns]
    q = turned(q, low, high)
    full = np.tile(model.neutral(), (len(q), 1))
    full[:, columns] = q
    errors = [np.linalg.norm(e, axis=-1) for e in pose_error(T, engine.forward_kinematics(full, frame))]
    error = np.maximum(*errors)
    good = (error <= TOLERANCE) & ((q >= low - 1e-8) & (q <= high + 1e-8)).all(axis=-1)
    kept: list[Floats] = []
    for each in q[good]:
        differences = [np.abs(np.remainder(each - x + np.pi, 2.0 * np.pi) - np.pi).max() for x in kept]
        if min(differences, default=1.0) > SAME:
            kept.append(each)
    return len(kept), float(error[good].max(initial=0.0))


def shortest(call: Callable[[], object]) -> float:
    """Return the least processor time of a call [us]."""
    return 1e6 * interleaved([call], REPEATS, time.process_time, calls_per_timing=1)[0].least


def row(
    name: str, solver: Solver, T: Floats, batch: Floats, model: Model, engine: Backend, frame: str
) -> str:
    """Return the line of the table of a solver."""
    found = [checked(model, engine, frame, pose, solver.angles(solver.solve(pose))) for pose in T]
    counts, errors = (np.array(each) for each in zip(*found, strict=True))

    def all_poses() -> None:
        for pose in T:
            solver.solve(pose)

    single = shortest(all_poses) / len(T)
    together = ""
    if solver.batch is not None:
        together = f"{shortest(partial(solver.batch, batch)) / len(batch):.2f}"
    return (
        f"| {name} | {solver.name} | {counts.mean():.3f} | {(counts > 0).mean():.1%} | {errors.max():.1e} "
        f"| {single:.1f} | {together} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("arms", nargs="*", metavar="arm", help=f"arms to measure, of {', '.join(ARMS)}")
    parser.add_argument("--poses", type=int, default=500, help="poses solved one by one")
    parser.add_argument("--batch", type=int, default=10_000, help="poses of a batch")
    options = parser.parse_args()
    if unknown := set(options.arms) - set(ARMS):
        parser.error(f"no arm {', '.join(sorted(unknown))}; known are {', '.join(ARMS)}")
    print(
        "| arm | solver | solutions a pose | poses solved | worst error | one pose [us] | in a batch [us] |"
    )
    print("|---|---|---|---|---|---|---|")
    for name in options.arms or ARMS:
        model, frame = ARMS[name]
        with backend("pinocchio", model) as engine:
            batch = engine.forward_kinematics(model.random(2026, options.batch), frame)
            poses = batch[: options.poses].copy()
            for solver in installed_solvers(model, frame):
                print(row(name, solver, poses, batch, model, engine, frame), flush=True)


if __name__ == "__main__":
    main()
