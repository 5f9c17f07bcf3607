"""Steps of a quadruped on its feet: ``python -m benchmarks.contact_steps``.

A1 of example-robot-data has PD motors and touches a plane with its four feet, spheres of 2 cm. Three motions
of 2 s in steps of 1 ms: it stands; each robot gets random targets at 50 Hz, under which most of them fall; a
trot without feedback. dynx takes a step of all robots in one call of a kernel (`dynx.compiled.contact_step`).
MuJoCo takes the same robot, inertias, spheres, friction, gains and targets, with its default solver, its
default cone, which is the cheaper one, and `mujoco.rollout` on the thread that calls it.

In the last second both are timed in turn, in rounds; a time is the processor time of the thread for a step of
one robot, as the median of the rounds. ``residual`` is the largest violation of the laws of contact in any
step of any robot in the last second [m/s]. ``penetration`` is that of a foot [m] in any of these states, and
``creep`` the mean speed of the standing robots' bases over the last 0.1 s [m/s]. ``weight`` is the error of
the sum of all normal forces at the end, relative to the weight, as the median of the standing robots.

With ``--further`` two more cases follow that have no counterpart: A1 with joint limits, dry friction of
joints and twelve contacts (feet, the lowest point of each calf, the corners of the trunk), and G1 with four
spheres under each foot. They stand.

The command ends with 1 if a residual of dynx exceeds 1e-6 m/s.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree

import numpy as np

from dynx.compiled.contact_step import contact_step_text, shapes_on_plane
from dynx.compiled.step import StepText, compiled
from dynx.engines.mujoco.library import mujoco
from dynx.model import Model
from dynx.model.elements import JointDynamics
from dynx.model.geometry import Box
from dynx.model.loading import load
from dynx.rbd.contact_step import FramedShape, ShapesOnPlane, spheres_on_plane
from dynx.simd.kernel import Kernel
from dynx.spatial.scalar import Floats
from dynx.world import Material, Scene, SceneRobot, ground
from dynx.world.preparation import prepare

H = 1e-3
"""Length of a step [s]."""
KP, KD, FRICTION, RADIUS = 100.0, 2.0, 0.7, 0.02
FEET = ("FR_foot", "FL_foot", "RR_foot", "RL_foot")
STANCE = np.tile([0.0, 0.9, -1.8], 4)
"""Positions of the joints [rad] of a standing A1."""
HEIGHT = 0.27
"""Height of its base at the start [m]."""
MAX_RESIDUAL = 1e-6
"""Bound of the residual [m/s]."""
HOLD = 20
"""Number of steps for which a target is held."""
ROUNDS = 30

Targets = Callable[[int, int], Floats]
"""From a step and a number of robots to their targets (n, 12)."""


def standing(step: int, n: int) -> Floats:
    """Return the same stance for all."""
    return np.tile(STANCE, (n, 1))


def random_targets(step: int, n: int) -> Floats:
    """Return another target for each robot every 20 ms."""
    return STANCE + np.random.default_rng(step // HOLD).uniform(-0.3, 0.3, (n, 12))


def trot(step: int, n: int) -> Floats:
    """Return targets of a trot at 2 Hz whose phase differs from robot to robot."""
    phase = 2.0 * np.pi * (2.0 * H * (step // HOLD * HOLD) + np.arange(n) / n)
    pair = phase[:, None] + np.array([0.0, np.pi, np.pi, 0.0])
    lift = np.maximum(np.sin(pair), 0.0)
    found = np.empty((n, 4, 3))
    found[..., 0] = 0.0
    found[..., 1] = 0.9 + 0.2 * lift - 0.1 * np.cos(pair)
    found[..., 2] = -1.8 - 0.5 * lift
    return found.reshape(n, 12)


MOTIONS: dict[str, Targets] = {"standing": standing, "random targets": random_targets, "trot": trot}


def initial_configurations(model: Model, n: int) -> Floats:
    """Return the configurations (n, nq) in which the robots begin."""
    q = np.tile(model.neutral(), (n, 1))
    q[:, 2] = HEIGHT
    q[:, 7:] = STANCE + np.random.default_rng(1).uniform(-0.05, 0.05, (n, 12))
    return q


class Robots:
    """A batch of robots on the kernel of dynx."""

    def __init__(self, kernel: Kernel, q: Floats) -> None:
        """`q` (n, nq) are the configurations at the start."""
        n, sizes = len(q), {port.name: port.size for port in kernel.inputs}
        self.state = [q.copy(), np.zeros((n, sizes["v"])), np.zeros((n, sizes["impulses"]))]
        self._next = [each.copy() for each in self.state]
        self.residual = np.zeros((n, 1))
        self._kernel = kernel

    def step(self, target: Floats) -> float:
        """Take a step and return its processor time [s]."""
        q, v, impulses = self.state
        start = time.thread_time()
        self._kernel([q, v, target, impulses], [*self._next, self.residual])
        spent = time.thread_time() - start
        self.state, self._next = self._next, self.state
        return spent


def mujoco_model(model: Model) -> Any:
    """Return the robot as MuJoCo's model, with spheres, a plane and servos of its own."""
    root = ElementTree.fromstring(model.to_mjcf())
    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag in ("geom", "asset", "actuator", "custom", "contact"):
                parent.remove(child)
    for joint in root.iter("joint"):
        for limit in ("range", "actuatorfrcrange"):
            joint.attrib.pop(limit, None)
    for compiler in root.iter("compiler"):
        compiler.set("fusestatic", "true")
    for body in root.iter("body"):
        if body.get("name") in FEET:
            sphere = {"type": "sphere", "size": str(RADIUS), "friction": f"{FRICTION} 0 0", "condim": "3"}
            ElementTree.SubElement(body, "geom", sphere | {"contype": "1", "conaffinity": "0", "mass": "0"})
    plane = {"type": "plane", "size": "0 0 1", "friction": f"{FRICTION} 0 0", "condim": "3"}
    world = root.find("worldbody")
    assert world is not None
    ElementTree.SubElement(world, "geom", plane | {"contype": "0", "conaffinity": "1"})
    ElementTree.SubElement(root, "option", {"timestep": str(H)})
    actuators = ElementTree.SubElement(root, "actuator")
    for name in model.joint_names:
        ElementTree.SubElement(actuators, "position", {"joint": name, "kp": str(KP), "kv": str(KD)})
    return mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))


class MujocoRobots:
    """A batch of robots of `mujoco.rollout`."""

    def __init__(self, model: Model, n: int) -> None:
        from mujoco import rollout

        self._rollout = rollout
        self.model = mujoco_model(model)
        self.data = mujoco.MjData(self.model)
        kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
        q = initial_configurations(model, n)
        self.state = np.zeros((n, mujoco.mj_stateSize(self.model, kind)))
        for k in range(n):
            self.data.qpos[:3] = q[k, :3]
            self.data.qpos[3:7] = q[k, [6, 3, 4, 5]]
            self.data.qpos[7:] = q[k, 7:]
            mujoco.mj_getState(self.model, self.data, self.state[k], kind)

    def steps(self, targets: Floats) -> float:
        """Take the steps of targets (n, steps, 12) and return the processor time [s]."""
        start = time.thread_time()
        states, _ = self._rollout.rollout(self.model, self.data, self.state, targets)
        spent = time.thread_time() - start
        self.state = states[:, -1]
        self.states = states
        return spent

    def heights(self) -> Floats:
        """Return the heights of the feet above the plane [m] (n, 4) in the last states."""
        nq, found = self.model.nq, []
        for state in self.state:
            self.data.qpos[:] = state[1 : 1 + nq]
            self.data.qvel[:] = state[1 + nq :][: self.model.nv]
            mujoco.mj_fwdPosition(self.model, self.data)
            spheres = self.model.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE
            found.append(self.data.geom_xpos[spheres, 2] - RADIUS)
        return np.array(found)

    def normal_forces(self) -> Floats:
        """Return the sum of the normal forces (n,) [N] in the last states."""
        found, kind = [], mujoco.mjtState.mjSTATE_FULLPHYSICS
        for state in self.state:
            mujoco.mj_setState(self.model, self.data, state, kind)
            self.data.ctrl[:] = STANCE
            mujoco.mj_forward(self.model, self.data)
            force, total = np.zeros(6), 0.0
            for contact in range(self.data.ncon):
                mujoco.mj_contactForce(self.model, self.data, contact, force)
                total += force[0]
            found.append(total)
        return np.array(found)


def measure(name: str, model: Model, kernel: Kernel, n: int, seconds: float, others: int) -> dict[str, Any]:
    """Simulate one motion and return its row."""
    targets, steps = MOTIONS[name], round(seconds / H)
    robots = Robots(kernel, initial_configurations(model, n))
    theirs = MujocoRobots(model, others)
    ours_ns: list[float] = []
    theirs_ns: list[float] = []
    residual, first = 0.0, steps // 2
    piece = max((steps - first) // ROUNDS, 1)
    bodies = backend_heights(model)
    depth, their_depth = 0.0, 0.0
    start = robots.state[0]
    for begin in range(0, steps, piece):
        end = min(begin + piece, steps)
        spent = 0.0
        for step in range(begin, end):
            if step % HOLD == 0 or step == begin:
                target = targets(step, n)
            if step == steps - round(0.1 / H):
                start = robots.state[0].copy()
            spent += robots.step(target)
            if step >= first:
                residual = max(residual, float(robots.residual.max()))
        sequence = np.stack([targets(step, others) for step in range(begin, end)], axis=1)
        their_time = theirs.steps(sequence)
        if begin >= first:
            ours_ns.append(1e9 * spent / n / (end - begin))
            theirs_ns.append(1e9 * their_time / others / (end - begin))
            depth = max(depth, -float(bodies(robots.state[0][:others]).min()))
            their_depth = max(their_depth, -float(theirs.heights().min()))
    row = {
        "motion": name,
        "ns": float(np.median(ours_ns)),
        "mujoco_ns": float(np.median(theirs_ns)),
        "residual": residual,
        "penetration": depth,
        "mujoco_penetration": their_depth,
    }
    if name == "standing":
        weight = -float(model.total_mass * model.gravity[2])
        moved = np.linalg.norm(robots.state[0][:, :3] - start[:, :3], axis=1)
        row["creep"] = float(np.median(moved)) / 0.1
        way = np.linalg.norm(theirs.states[:, -1, 1:4] - theirs.states[:, 0, 1:4], axis=1)
        row["mujoco_creep"] = float(np.median(way)) / (H * max(theirs.states.shape[1] - 1, 1))
        normal = robots.state[2][:, ::3].sum(axis=1) / H
        row["weight"] = float(np.median(np.abs(normal / weight - 1.0)))
        row["mujoco_weight"] = float(np.median(np.abs(theirs.normal_forces() / weight - 1.0)))
    return row


def backend_heights(model: Model) -> Callable[[Floats], Floats]:
    """Return the function of the feet's heights above the plane (n, 4) at q (n, nq)."""
    from dynx.backends import backend

    robot = backend("compiled", model)
    return lambda q: np.stack([robot.forward_kinematics(q, foot)[:, 2, 3] for foot in FEET], axis=1) - RADIUS


def further_cases(n: int, seconds: float) -> float:
    """Print the times of the cases without MuJoCo, and return their largest residual [m/s]."""
    worst = 0.0
    for name, text, q in (_with_all_shapes(n), _humanoid(n)):
        robots, steps, times, residual = Robots(compiled(text), q), round(seconds / H), [], 0.0
        for step in range(steps):
            spent = robots.step(q[:, 7:] if name.startswith("G1") else standing(step, n))
            if step >= steps // 2:
                times.append(1e9 * spent / n)
                residual = max(residual, float(robots.residual.max()))
        print(
            f"{name}, standing: dynx {np.median(times):.0f} ns, residual {residual:.1e} m/s, "
            f"lowest base {robots.state[0][:, 2].min():.3f} m"
        )
        worst = max(worst, residual)
    return worst


def _with_all_shapes(n: int) -> tuple[str, StepText, Floats]:
    described = load("a1", base="floating")
    joints = [replace(each, dynamics=JointDynamics(friction=0.1)) for each in described.joints]
    model = Model.build("a1", described.links, joints, base="floating", geometry=described.geometry)
    rough = Material(friction=FRICTION)
    scene = Scene(robots=(SceneRobot("a1", model, material=rough),), bodies=(ground(material=rough),))
    options = ("limits", "damping", "friction", "armature", "springs")
    layout = prepare(scene, collisions=True, **{f"joint_{name}": True for name in options})
    chosen = []
    for each in shapes_on_plane(layout).shapes:
        link = model.mechanism.frames[each.frame].name
        if link.endswith("_calf"):
            chosen.append(each._replace(deepest=True))
        elif isinstance(each.shape, Box) and link in ("base", "trunk") and max(each.shape.size) > 0.1:
            chosen.append(each)
    touching = ShapesOnPlane(tuple(chosen))
    assert sum(touching.counts) == 12
    text = contact_step_text(model, touching, h=H, kp=KP, kd=KD, joint_limits=True)
    return "A1 with 12 contacts", text, initial_configurations(model, n)


def _humanoid(n: int) -> tuple[str, StepText, Floats]:
    model = load("g1", base="floating")
    shapes = [
        FramedShape(
            model.frame_index(link), each.shape, np.eye(3), np.array(each.origin.xyz, dtype=float), FRICTION
        )
        for link in ("left_ankle_roll_link", "right_ankle_roll_link")
        for each in model.geometry.collisions(link)
    ]
    text = contact_step_text(model, ShapesOnPlane(tuple(shapes)), h=H, kp=KP, kd=3.0)
    q = np.tile(model.neutral(), (n, 1))
    for name, angle in {"hip_pitch": -0.3, "knee": 0.6, "ankle_pitch": -0.3}.items():
        for k, joint in enumerate(model.joint_names, 7):
            if name in joint:
                q[:, k] = angle
    q[:, 2] = 0.764
    q[:, 7:] += np.random.default_rng(1).uniform(-0.03, 0.03, (n, 29))
    return "G1 with 8 contacts", text, q


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a table; return 1 if a residual exceeds its bound."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.contact_steps", description=__doc__)
    parser.add_argument("--batch", type=int, default=8192, help="default: 8192")
    parser.add_argument("--mujoco-batch", type=int, default=64, help="default: 64")
    parser.add_argument("--seconds", type=float, default=2.0, help="default: 2")
    parser.add_argument("--motion", choices=MOTIONS, action="append", help="default: all")
    parser.add_argument("--further", action="store_true", help="time the cases without MuJoCo, too")
    options = parser.parse_args(arguments)
    model = load("a1", base="floating")
    start = time.perf_counter()
    feet = spheres_on_plane({model.frame_index(foot): RADIUS for foot in FEET}, FRICTION)
    text = contact_step_text(model, feet, h=H, kp=KP, kd=KD)
    kernel = compiled(text)
    ready = time.perf_counter() - start
    print(f"kernel after {ready:.1f} s; {options.batch} robots, of MuJoCo {options.mujoco_batch}")
    worst = 0.0
    for name in options.motion or MOTIONS:
        row = measure(name, model, kernel, options.batch, options.seconds, options.mujoco_batch)
        worst = max(worst, row["residual"])
        print(
            f"{name}: dynx {row['ns']:.0f} ns, MuJoCo {row['mujoco_ns']:.0f} ns "
            f"({row['mujoco_ns'] / row['ns']:.0f}x), residual {row['residual']:.1e} m/s, penetration "
            f"{row['penetration']:.1e} m, MuJoCo {row['mujoco_penetration']:.1e} m"
        )
        if "creep" in row:
            print(
                f"  creep {row['creep']:.1e} m/s, MuJoCo {row['mujoco_creep']:.1e}; "
                f"weight {row['weight']:.1e}, MuJoCo {row['mujoco_weight']:.1e}"
            )
    if options.further:
        worst = max(worst, further_cases(options.batch, options.seconds))
    return 0 if worst <= MAX_RESIDUAL else 1


if __name__ == "__main__":
    sys.exit(main())
