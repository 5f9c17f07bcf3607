"""Inverse kinematics that keeps margins: share of poses that are reached clear of everything, and time.

``python -m benchmarks.kinematics.avoidance`` puts each arm on a table among random boxes, and draws targets
from configurations that keep the margin, so that a solution exists. Every solution is checked by the
distances of MuJoCo. Times are processor time of one thread, with the kernels compiled before.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from benchmarks.inverse_kinematics import ARMS, model_of
from dynx.backends import backend
from dynx.distance.avoidance import Avoidance
from dynx.model import Pose
from dynx.spatial.scalar import Floats
from dynx.world import Scene, SceneBody, SceneRobot, World, box

MARGIN = 0.01
"""Distance that is kept [m]."""

ENGINE_ERROR = 1e-6
"""Bound on MuJoCo's distances of hulls that are apart [m]."""

BOXES = 4
"""Boxes around the arm."""

POSES_PER_SCENE = 20
"""Targets that one scene has."""


def random_scene(arm: SceneRobot, rng: np.random.Generator) -> Scene:
    """Return an arm on a table among boxes of 0.1 to 0.4 m, from 0.3 to 0.8 m away."""
    bodies: list[SceneBody] = [box("table", (2.0, 2.0, 0.1), pose=Pose((0.0, 0.0, -0.07)))]
    for k in range(BOXES):
        angle, radius, height = rng.uniform(-np.pi, np.pi), rng.uniform(0.3, 0.8), rng.uniform(0.1, 0.9)
        at = (radius * np.cos(angle), radius * np.sin(angle), height)
        bodies.append(box(f"box{k}", rng.uniform(0.1, 0.4, 3), pose=Pose(at, (0.0, 0.0, angle))))
    return Scene(robots=[arm], bodies=bodies)


def check(world: World, avoidance: Avoidance, q: Floats) -> None:
    """Raise AssertionError if a pair is closer than its margin by MuJoCo's distances."""
    world.set_state(robots={"arm": (q, np.zeros(avoidance.model.nv))})
    for pair in avoidance.pairs:
        if pair.margin >= 0.0:
            for near in world.closest_points(*avoidance.names(pair), pair.margin + 0.05, native=True):
                assert near.distance >= pair.margin - ENGINE_ERROR, (avoidance.names(pair), near.distance)


def row(name: str, poses: int) -> str:
    """Return the row of one arm."""
    arm, rng = ARMS[name], np.random.default_rng(16)
    model = model_of(arm)
    seconds, plain, reached, count = [], 0, 0, 0
    with backend("compiled", model, threads=1) as engine:
        while count < poses:
            scene = random_scene(SceneRobot("arm", model, self_collision=True), rng)
            avoidance = scene.avoidance(margin=MARGIN)
            clear: list[Floats] = []
            for _ in range(50 * POSES_PER_SCENE):
                q = model.random(rng)
                if avoidance.is_clear(engine, q):
                    clear.append(q)
                if len(clear) == POSES_PER_SCENE:
                    break
            if not clear:
                continue
            engine.inverse_kinematics(
                engine.forward_kinematics(clear[0], arm.frame), arm.frame, avoid=avoidance
            )
            with World(scene, "mujoco") as world:
                for q in clear:
                    target = engine.forward_kinematics(q, arm.frame)
                    begin = time.process_time()
                    found = engine.inverse_kinematics(target, arm.frame, avoid=avoidance)
                    seconds.append(time.process_time() - begin)
                    alone = engine.inverse_kinematics(target, arm.frame)
                    plain += avoidance.is_clear(engine, alone.q)
                    count += 1
                    if found.success:
                        reached += 1
                        check(world, avoidance, found.q)
    times = 1e3 * np.array(seconds)
    shares = [f"{100.0 * each / count:.4g} %" for each in (plain, reached)]
    quantiles = [f"{np.median(times):.3g}", f"{np.percentile(times, 95):.3g}", f"{times.max():.3g}"]
    return "| " + " | ".join([name, str(count), *shares, *quantiles]) + " |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "arms", nargs="*", default=["ur5", "panda", "kuka_iiwa", "z1", "kinova"], help="names of arms"
    )
    parser.add_argument("--poses", type=int, default=100, help="number of poses of each arm")
    options = parser.parse_args()
    head = ["robot", "poses", "clear without `avoid`", "with it", "median [ms]", "95 % below", "largest"]
    print("| " + " | ".join(head) + " |")
    print("|" + "---|" * len(head))
    for name in options.arms:
        print(row(name, options.poses), flush=True)


if __name__ == "__main__":
    main()
