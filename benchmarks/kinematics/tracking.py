"""Paths followed by `track` on the backend `compiled`: share of samples that are OK, and time of a sample.

``python -m benchmarks.kinematics.tracking`` follows, for each arm, paths of poses that a smooth motion of the
joints within their limits passes through (so that a continuous solution exists), and straight lines between
random reachable poses (of which some leave the workspace). Every sample that is OK is checked by Pinocchio,
and it may not differ from the one before by more than the motion allows. Times are processor time of one
thread.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from benchmarks.inverse_kinematics import ARMS, model_of
from benchmarks.test_inverse_kinematics import TOLERANCE, Arm
from dynx.backends import Backend, backend
from dynx.ik.tracking import TrackResult, TrackStatus
from dynx.ik.tracking.path import MAX_DIVISIONS
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous, pose_error
from dynx.spatial.so3 import quat_exp, quat_from_rotation, quat_log, rotation_from_quat

SAMPLES = 1000
"""Samples of a path."""

MAX_STEP = 0.2
"""Default largest change of a joint in one descent [rad or m]."""


def smooth_motions(engine: Backend, count: int, rng: np.random.Generator) -> Floats:
    """Return configurations (count, SAMPLES, nq) on sums of sines, scaled into the limits."""
    model = engine.model
    low = np.where(np.isfinite(model.lower), model.lower, -np.pi)
    high = np.where(np.isfinite(model.upper), model.upper, np.pi)
    s = np.linspace(0.0, 1.0, SAMPLES)[:, None]
    motions = []
    for _ in range(count):
        frequency, phase = rng.uniform(0.3, 2.0, (2, 1, model.nq)), rng.uniform(0.0, 6.3, (2, 1, model.nq))
        waves = np.sin(2.0 * np.pi * frequency * s + phase).mean(axis=0)
        motions.append(0.5 * (low + high) + 0.45 * (high - low) * waves)
    return np.array(motions)


def lines(ends: Floats) -> Floats:
    """Return poses (count, SAMPLES, 4, 4) on straight lines between pairs of poses (count, 2, 4, 4)."""
    s = np.linspace(0.0, 1.0, SAMPLES)[:, None]
    paths = []
    for first, last in ends:
        vector = quat_log(quat_from_rotation(first[:3, :3].T @ last[:3, :3]))
        R = first[:3, :3] @ rotation_from_quat(quat_exp(s * vector))
        paths.append(homogeneous(R, first[:3, 3] + s * (last[:3, 3] - first[:3, 3])))
    return np.array(paths)


def check(engine: Backend, frame: str, T: Floats, result: TrackResult, q0: Floats) -> None:
    """Raise AssertionError for a sample whose status is not true, by another engine."""
    distance, angle = pose_error(T, engine.forward_kinematics(result.q, frame))
    error = np.maximum(np.linalg.norm(distance, axis=-1), np.linalg.norm(angle, axis=-1))
    reached = np.isin(result.status, (TrackStatus.OK, TrackStatus.JUMPED))
    assert (error[reached] <= TOLERANCE * (1.0 + 1e-3)).all()
    assert ((result.q >= engine.model.lower) & (result.q <= engine.model.upper)).all()
    changes = np.abs(np.diff(np.concatenate([q0[:, None], result.q], axis=1), axis=1)).max(axis=-1)
    assert (changes[result.status != TrackStatus.JUMPED] <= MAX_DIVISIONS * MAX_STEP).all()


def row(name: str, arm: Arm, paths: int) -> str:
    """Return the row of one arm."""
    model = model_of(arm)
    rng = np.random.default_rng(16)
    cells = [name]
    with backend("compiled", model, threads=1) as engine, backend("pinocchio", model) as referee:
        motions = smooth_motions(engine, paths, rng)
        T = engine.forward_kinematics(motions, arm.frame)
        engine.track(T[0, :2], arm.frame, motions[0, 0])
        for poses in (T, lines(T[:, [0, -1]])):
            begin = time.process_time()
            result = engine.track(poses, arm.frame, motions[:, 0])
            seconds = time.process_time() - begin
            check(referee, arm.frame, poses, result, motions[:, 0])
            shares = [f"{100.0 * float((result.status == status).mean()):.4g}" for status in TrackStatus]
            cells += [" / ".join(shares), f"{int(result.ok.all(axis=1).sum())}"]
            cells.append(f"{1e6 * seconds / result.status.size:.2f}")
        begin = time.process_time()
        chosen = engine.track(poses, arm.frame, jumps=False)
        cells += [f"{int(chosen.ok.all(axis=1).sum())}", f"{1e3 * (time.process_time() - begin) / paths:.3g}"]
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("arms", nargs="*", default=list(ARMS), help="names of arms")
    parser.add_argument("--paths", type=int, default=50, help="number of paths of each kind")
    options = parser.parse_args()
    head = ["robot", "joint motions: statuses [%]", "all OK", "a sample [us]", "lines: statuses [%]"]
    head += ["all OK", "a sample [us]", "lines, start chosen: all OK", "a path [ms]"]
    print("| " + " | ".join(head) + " |")
    print("|" + "---|" * len(head))
    for name in options.arms:
        print(row(name, ARMS[name], options.paths), flush=True)


if __name__ == "__main__":
    main()
