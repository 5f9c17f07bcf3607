"""Inverse kinematics in compiled kernels: share solved, time of single poses and of a batch, bad targets.

``python -m benchmarks.inverse_kinematics`` solves 10,000 random poses of each arm to 1e-6 m and 1e-6 rad,
reachable within limits and without a start, on one thread. Every solution is checked by Pinocchio. Then come
1,000 targets out of reach, and targets of configurations at limits and with joints at zero. Beside it stands
the C++ solver ``ik_LM`` of roboticstoolbox-python (the extra ``benchmark``), single poses.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.test_inverse_kinematics import TOLERANCE, Arm, toolbox_solver
from dynx.backends import Backend, backend
from dynx.bench.timing import interleaved, once
from dynx.ik import IKResult
from dynx.model import Model
from dynx.model.loading import load
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import pose_error

ARMS = {
    "ur5": Arm("ur5", "ee_link"),
    "panda": Arm("panda", "panda_hand", ("panda_finger_joint1", "panda_finger_joint2")),
    "kuka_iiwa": Arm("kuka_iiwa/model.urdf", "lbr_iiwa_link_7"),
    "xarm7": Arm("xarm7", "link7"),
    "z1": Arm("z1", "link06"),
    "kinova": Arm("kinova", "j2s6s200_end_effector"),
    "talos_arm": Arm("talos_arm", "gripper_left_base_link"),
    "tiago": Arm("tiago", "arm_7_link"),
}
REPEATS = 3
"""Times that a single pose is solved; the shortest time counts."""


def model_of(arm: Arm) -> Model:
    """Load an arm of example-robot-data, or of pybullet_data if it is a path."""
    if "/" not in arm.source:
        return load(arm.source, lock=dict.fromkeys(arm.lock, 0.0))
    import pybullet_data

    return load(Path(pybullet_data.getDataPath()) / arm.source)


def shortest(
    call: Callable[[], object], repeats: int = REPEATS, clock: Callable[[], float] = time.perf_counter
) -> float:
    """Return the shortest time of a call [us]."""
    return 1e6 * interleaved([call], repeats, clock, calls_per_timing=1)[0].least


def verified(model: Model, other: Backend, frame: str, targets: Floats, found: IKResult) -> NDArray[np.bool_]:
    """Return which targets are reached (n,); raise if another engine finds one that is not."""
    reached = other.forward_kinematics(found.q, frame)
    position, rotation = (np.linalg.norm(error, axis=-1) for error in pose_error(targets, reached))
    within = ((found.q >= model.lower) & (found.q <= model.upper)).all(axis=-1)
    # Poses of two engines differ by rounding.
    right = (position <= TOLERANCE * 1.001) & (rotation <= TOLERANCE * 1.001)
    if not within.all() or (found.success & ~right).any():
        raise AssertionError(f"{model.name}: a result is beyond the limits, or wrong")
    return np.asarray(found.success)


def edge_targets(engine: Backend, frame: str, count: int, rng: np.random.Generator) -> Floats:
    """Return poses (2 count, 4, 4) of configurations at limits, and of some with joints at zero."""
    model = engine.model
    at_limits = model.random(rng, count)
    chosen = rng.random(at_limits.shape)
    at_limits = np.where((chosen < 0.4) & np.isfinite(model.lower), model.lower, at_limits)
    at_limits = np.where((chosen > 0.6) & np.isfinite(model.upper), model.upper, at_limits)
    straight = model.random(rng, count)
    straight = model.clip(np.where(rng.random(straight.shape) < 0.5, 0.0, straight))
    return engine.forward_kinematics(np.concatenate([at_limits, straight]), frame)


def measure(name: str, count: int, toolbox: bool) -> None:
    """Print the figures of one arm."""
    arm, rng = ARMS[name], np.random.default_rng(2026)
    model = model_of(arm)
    with backend("compiled", model, threads=1) as engine, backend("pinocchio", model) as other:
        neutral = engine.forward_kinematics(model.neutral(), arm.frame)
        first = once(partial(engine.inverse_kinematics, neutral, arm.frame))
        targets = engine.forward_kinematics(model.random(rng, count), arm.frame)
        found = engine.inverse_kinematics(targets, arm.frame)
        share = verified(model, other, arm.frame, targets, found).mean()
        # Processor time: a batch takes so long that other programs interrupt it.
        call = partial(engine.inverse_kinematics, targets, arm.frame)
        batch = shortest(call, 10, time.process_time) / count
        few = targets[: count // 5]
        single = [shortest(partial(engine.inverse_kinematics, target, arm.frame)) for target in few]
        print(
            f"{name:10} {share:8.2%} solved; single median {np.median(single):5.1f}, 95 % below "
            f"{np.percentile(single, 95):5.1f} us; batch {batch:5.2f} us; first call {first:.1f} s; "
            f"{found.iterations.mean():.1f} steps, {found.restarts.mean():.2f} restarts"
        )
        far = targets[:1000].copy()
        far[:, :3, 3] *= 1.0 + 10.0 / np.linalg.norm(far[:, :3, 3], axis=-1, keepdims=True)
        nothing = engine.inverse_kinematics(far, arm.frame)
        none, proved = (
            verified(model, other, arm.frame, far, nothing),
            (nothing.status == "UNREACHABLE").mean(),
        )
        of_far = shortest(partial(engine.inverse_kinematics, far, arm.frame), clock=time.process_time) / len(
            far
        )
        one_far = np.median([shortest(partial(engine.inverse_kinematics, T, arm.frame)) for T in far[:200]])
        edges = edge_targets(engine, arm.frame, count // 10, rng)
        at_edges = verified(model, other, arm.frame, edges, engine.inverse_kinematics(edges, arm.frame))
        limits, zeros = at_edges[: count // 10].mean(), at_edges[count // 10 :].mean()
        print(
            f"{'':10} out of reach: {none.sum()} of {len(far)} solved, {proved:.1%} proved, batch "
            f"{of_far:.1f} us, single {one_far:.0f} us; at limits {limits:.2%}, joints at zero {zeros:.2%}"
        )
        if toolbox:
            solve = toolbox_solver(model, arm.frame)
            solutions = np.array([solve(target) for target in few[:500]])
            times = [shortest(partial(solve, target)) for target in few[:500]]
            share = np.isfinite(solutions).all(axis=-1).mean()
            print(
                f"{'':10} roboticstoolbox ik_LM: {share:.2%} solved; "
                f"single median {np.median(times):.1f}, 95 % below {np.percentile(times, 95):.1f} us"
            )


def main() -> None:
    """Measure the arms that are named, or all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("arms", nargs="*", metavar="arm", help="arms to measure")
    parser.add_argument("--poses", type=int, default=10_000, help="number of poses of each arm")
    options = parser.parse_args()
    unknown = set(options.arms) - set(ARMS)
    if unknown:
        parser.error(f"no arm {', '.join(sorted(unknown))}; known are {', '.join(ARMS)}")
    for name in options.arms or ARMS:
        measure(name, options.poses, toolbox=name in ("ur5", "panda", "kuka_iiwa"))


if __name__ == "__main__":
    main()
