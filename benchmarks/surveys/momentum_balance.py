"""Balance of momentum in worlds with constraints: ``python -m benchmarks.surveys.momentum_balance``.

A robot with a fixed or a floating base carries a welded load and a bell on a point, is pushed, and is hit by
a falling box or stands on the ground. In each step of each engine, for the robot and for each body,

    base wrench + contacts + constraints + external forces + weight = rate of momentum,

force and moment about the origin of the world. The rate is the sum over the links, whose frames move as in
Pinocchio at the mean acceleration of the step; that of a body follows from its velocities before and after.

Prints the largest error of each engine in parts of the weight of the scene (of moments: by 1 m), and the base
wrench of floating robots, which is zero. Exits with 1 if one exceeds `BARS`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.surveys.sensors import BASES, H, Worst, mean_acceleration, note
from dynx import ExternalForce, Pose
from dynx.backends import Backend, backend
from dynx.model.loading import load
from dynx.model.tree import Base
from dynx.spatial.scalar import Floats
from dynx.world import (
    PointToPoint,
    PositionMotor,
    Scene,
    SceneBody,
    SceneRobot,
    Weld,
    World,
    WorldState,
    box,
    ground,
)

BARS = {"mujoco": 1e-6, "drake": 1e-4, "pybullet": 1e-2}
"""Residual of each engine's own equations of motion with contacts and constraints, in parts of the weight:
the tolerances of the solvers of MuJoCo and Drake, and what Bullet's iterations leave."""

SETTINGS: dict[str, dict[str, Any]] = {
    "mujoco": {"tolerance": 1e-14, "iterations": 500},
    "drake": {"contact_model": "point"},
    "pybullet": {},
}
"""MuJoCo's solver converges, and Drake's contacts are points: a contact of its surfaces also has a moment
about its normal, which no force at a point has."""

IDENTITY = 1e-10
"""Largest error of the balance of a robot, whose base wrench follows from the same motion."""

# fmt: off
ROBOTS = (
    "a1", "anymal_c", "g1", "kinova", "laikago", "panda", "so101", "solo12", "talos", "ur5", "xarm7", "z1",
)
# fmt: on

STEPS = 25

G = 9.81
GRAVITY = np.array([0.0, 0.0, -G])


def about_origin(force: Floats, moment: Floats, point: Floats) -> Floats:
    """Return force and moment at a point as a wrench (6,) about the origin of the world."""
    return np.concatenate([force, moment + np.cross(point, force)])


def scene_of(name: str, base: Base, seed: int) -> Scene:
    """Return a robot with a load and a bell, which stands on the ground or is hit."""
    rng, model = np.random.default_rng(seed), load(name, base=base)
    q = model.neutral()
    first = 7 if model.floating else 0
    q[first:] = 0.5 * (model.random(rng) + q)[first:]
    links = [each.name for each in model.links]
    tip, middle = links[-1], links[len(links) // 2]
    with World(Scene("alone", robots=(SceneRobot("robot", model, q=tuple(q)),))) as world:
        low, _ = world.aabb("robot")
        if model.floating:
            q[2] -= low[2]
        highest, top = "", -np.inf
        for each in world._layout.colliders:
            corner = world.aabb(each.name)[1]
            if corner[2] > top:
                highest, top = each.name, float(corner[2])
        ends = world.aabb(highest)
    above = 0.5 * (ends[0] + ends[1])
    with backend("reference", model) as engine:
        at_tip, at_middle = (engine.forward_kinematics(q, each) for each in (tip, middle))
    load_at = at_tip @ Pose((0.1, 0.05, 0.0), (0.2, 0.3, 0.0)).matrix
    bell_at = at_middle @ Pose((0.0, 0.1, 0.3)).matrix
    shift = q[2] if model.floating else 0.0
    bodies = [
        box("load", (0.1, 0.1, 0.1), mass=0.5, pose=Pose.from_matrix(load_at)),
        box("bell", (0.05, 0.05, 0.05), mass=0.3, pose=Pose.from_matrix(bell_at)),
        ground() if model.floating else brick(above, top + shift),
    ]
    ties = (
        Weld("robot/" + tip, "load"),
        PointToPoint("robot/" + middle, "bell", (0.0, 0.1, 0.1), (0.0, 0.0, -0.2)),
    )
    loose = [("robot", "load"), ("robot", "bell"), ("load", "bell")]
    loose += [(each, bodies[2].name) for each in ("load", "bell")]
    robots = (SceneRobot("robot", model, q=tuple(q)),)
    return Scene(f"{name}, {base} base", robots=robots, bodies=bodies, constraints=ties, ignored=loose)


def brick(above: Floats, top: float) -> SceneBody:
    """Return a box that falls on what is highest."""
    at = Pose((float(above[0]), float(above[1]), top + 0.1005))
    return box("brick", (0.3, 0.3, 0.2), mass=1.0, pose=at, twist=(0.0, 0.0, -0.5, 0.0, 0.0, 0.0))


def robot_rate(engine: Backend, q: Floats, v: Floats, a: Floats) -> tuple[Floats, Floats]:
    """Return the rate of momentum (6,) and the weight (6,) of all links, about the origin of the world, from
    the motion of the frames of the links by an engine."""
    rate, weight = np.zeros(6), np.zeros(6)
    for link in engine.model.links:
        inertial = engine.model.inertial(link.name)
        if inertial.mass or inertial.tensor.any():
            T = engine.forward_kinematics(q, link.name)
            _, omega = np.split(engine.frame_velocity(q, v, link.name), 2)
            origin, alpha = np.split(engine.frame_acceleration(q, v, a, link.name), 2)
            R = T[:3, :3] @ inertial.origin.matrix[:3, :3]
            c = T[:3, :3] @ np.array(inertial.origin.xyz)
            center = origin + np.cross(alpha, c) + np.cross(omega, np.cross(omega, c))
            tensor = R @ inertial.tensor @ R.T
            spin = tensor @ alpha + np.cross(omega, tensor @ omega)
            rate += about_origin(inertial.mass * center, spin, T[:3, 3] + c)
            weight += about_origin(inertial.mass * GRAVITY, np.zeros(3), T[:3, 3] + c)
    return rate, weight


def body_rate(world: World, name: str, before: WorldState, after: WorldState) -> tuple[Floats, Floats]:
    """Return the rate of momentum (6,) and the weight (6,) of a body in a step."""
    inertial = next(each for each in world.scene.bodies if each.name == name).inertial
    (T, twist), (T_next, twist_next) = before.bodies[name], after.bodies[name]
    c, c_next = (each[:3, :3] @ np.array(inertial.origin.xyz) for each in (T, T_next))
    speed = twist[:3] + np.cross(twist[3:], c)
    speed_next = twist_next[:3] + np.cross(twist_next[3:], c_next)
    R = T[:3, :3] @ inertial.origin.matrix[:3, :3]
    tensor = R @ inertial.tensor @ R.T
    alpha = (twist_next[3:] - twist[3:]) / H
    spin = tensor @ alpha + np.cross(twist[3:], tensor @ twist[3:])
    at = T[:3, 3] + c
    rate = about_origin(inertial.mass * (speed_next - speed) / H, spin, at)
    return rate, about_origin(inertial.mass * GRAVITY, np.zeros(3), at)


def measure(scene: Scene, name: str, worst: Worst, met: dict[str, int]) -> None:
    """Compare both sides in the steps of a world on each engine."""
    (robot,) = scene.robots
    model = robot.model
    first = 7 if model.floating else 0
    assert robot.q is not None
    motors = {"robot": PositionMotor(np.array(robot.q[first:]), 50.0, 2.0)}
    pushes = [
        ExternalForce(f"robot/{model.root}", (5.0, -3.0, 2.0, 0.1, 0.2, 0.3)),
        ExternalForce("load", (1.0, 2.0, -1.0, 0.05, 0.0, 0.02)),
    ]
    moving = [body.name for body in scene.bodies if not body.fixed]
    total = G * (model.total_mass + sum(each.inertial.mass for each in scene.bodies if not each.fixed))
    settings = SETTINGS[name]
    with (
        World(scene, name, H, keep_last_step=True, **settings) as world,
        backend("pinocchio", model) as engine,
    ):
        for _ in range(STEPS):
            before = world.state
            world.step(motors=motors, forces=pushes)
            after = world.state
            acting = {each: np.zeros(6) for each in ("robot", *moving)}
            for contact in world.contacts():
                for part, sign in ((contact.a, 1.0), (contact.b, -1.0)):
                    if (owner := part.partition("/")[0]) in acting:
                        acting[owner] += sign * about_origin(contact.force, np.zeros(3), contact.point)
                        met[name] = met.get(name, 0) + (owner == "robot")
            for tie in world.constraint_wrenches(reference="world"):
                for part, wrench in ((tie.a, tie.on_a), (tie.b, tie.on_b)):
                    if (owner := part.partition("/")[0]) in acting:
                        acting[owner] += wrench
            state = before.robots["robot"]
            T_root = engine.forward_kinematics(state.q, model.root)
            for push, at in zip(pushes, (T_root, before.bodies["load"].T_world_body), strict=True):
                wrench = np.asarray(push.wrench)
                acting[push.on.partition("/")[0]] += about_origin(wrench[:3], wrench[3:], at[:3, 3])
            base = world.base_wrench("robot", reference="world")
            a = mean_acceleration(model, *state, *after.robots["robot"])
            rates = {"robot": robot_rate(engine, *state, a)}
            rates |= {each: body_rate(world, each, before, after) for each in moving}
            for each, (rate, weight) in rates.items():
                left = acting[each] + weight - rate + (base if each == "robot" else 0.0)
                what = f"{name}: {'robot' if each == 'robot' else 'bodies'}"
                note(worst, what, float(np.abs(left).max()) / total, f"{scene.name}, {each}")
            if model.floating:
                note(worst, f"{name}: floating base", float(np.abs(base).max()) / total, scene.name)


def exceeding(worst: Worst) -> list[str]:
    """Return the figures that exceed their bars."""
    bars = {what: IDENTITY if what.endswith("robot") else BARS[what.partition(":")[0]] for what in worst}
    return [what for what, (figure, _) in worst.items() if not figure <= bars[what]]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the largest errors and return 1 if one exceeds its bar."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("robots", nargs="*", default=ROBOTS, help=f"default: {', '.join(ROBOTS)}")
    worst: Worst = {}
    met: dict[str, int] = {}
    for number, name in enumerate(parser.parse_args(arguments).robots):
        for base in BASES:
            scene = scene_of(name, base, number)
            for engine in BARS:
                measure(scene, engine, worst, met)
    print(f"largest errors, in parts of the weight; contacts of robots in all steps: {met}")
    for what, (figure, where) in worst.items():
        print(f"    {what:28}{figure:10.1e}  {where}")
    return int(bool(exceeding(worst)))


if __name__ == "__main__":
    sys.exit(main())
