"""Steps of robots on their feet: ``python -m benchmarks.contact_steps``.

A1 of example-robot-data has PD motors and touches a plane with its four feet, spheres of 2 cm. Three motions
of 2 s in steps of 1 ms: it stands; each robot gets random targets at 50 Hz, under which most of them fall; a
trot without feedback. dynx takes a step of all robots in one call of a kernel (`dynx.compiled.contact_step`).
MuJoCo takes the same robot, inertias, spheres, friction, gains and targets, with its default solver, its
default cone, which is the cheaper one, and `mujoco.rollout` on the thread that calls it.

In the last second both are timed in turn, in rounds; a time is the processor time of the thread for a step of
one robot, as the median of the rounds. ``residual`` is the largest violation of the laws of contact in any
step of any robot in the last second [m/s]. ``penetration`` is that of a foot [m] in any of these states, and
``creep`` the mean speed of the standing robots' bases over the last 0.1 s [m/s]. ``weight`` is the error of
the sum of all normal forces at the end, relative to the weight, as the median of the standing robots, and
``lowest base`` the least height of a base at the end [m].

With ``--further`` two more robots stand: G1 with the four spheres under each foot of its description, and A1
with joint limits, dry friction of joints and twelve contacts (feet, the lowest point of each calf, the
corners of the trunk), which has no counterpart; it then gets random targets, too. The motors of G1 are
stiffer than those of A1. The moment of its weight grows by 220 N m per radian of both ankles, so that it
falls on motors of 100 N m/rad, in MuJoCo too. MuJoCo integrates G1's motors implicitly (``implicitfast``), as
dynx does: their damping would be unstable at its light wrists.

The command ends with 1 if a residual of dynx exceeds 1e-6 m/s, but for the fallen A1 with twelve contacts, or
if G1 does not stand.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any
from xml.etree import ElementTree

import numpy as np

from dynx.backends import backend
from dynx.compiled.contact_step import contact_step_text, shapes_on_plane
from dynx.compiled.step import StepText, compiled
from dynx.engines.mujoco.library import mujoco
from dynx.model import Model
from dynx.model.elements import JointDynamics
from dynx.model.geometry import Box, Sphere
from dynx.model.loading import load
from dynx.rbd.contact_step import FramedShape, ShapesOnPlane, spheres_on_plane
from dynx.simd.kernel import Kernel
from dynx.spatial.scalar import Floats
from dynx.world import Material, Scene, SceneRobot, ground
from dynx.world.preparation import prepare

H = 1e-3
"""Length of a step [s]."""
KP, KD, FRICTION, RADIUS = 100.0, 2.0, 0.7, 0.02
HUMANOID_KP, HUMANOID_KD = 200.0, 5.0
FEET = ("FR_foot", "FL_foot", "RR_foot", "RL_foot")
SOLES = ("left_ankle_roll_link", "right_ankle_roll_link")
STANCE = np.tile([0.0, 0.9, -1.8], 4)
"""Positions of the joints [rad] of a standing A1."""
HEIGHT = 0.27
"""Height of its base at the start [m]."""
HUMANOID_STANCE = {"hip_pitch": -0.3, "knee": 0.6, "ankle_pitch": -0.3}
"""Positions of the joints [rad] of a standing G1 that are not zero, by parts of their names."""
HUMANOID_HEIGHT = 0.764
STANDING_HEIGHT = 0.7
"""Least height of the base [m] of a standing G1."""
MAX_RESIDUAL = 1e-6
"""Bound of the residual [m/s]."""
HOLD = 20
"""Number of steps for which a target is held."""
ROUNDS = 30

Targets = Callable[[int, int], Floats]
"""From a step and a number of robots to their targets (n, joints)."""


@dataclass(frozen=True)
class Footed:
    """A robot with PD motors and spheres that may touch a plane."""

    name: str
    model: Model
    touching: ShapesOnPlane
    stance: Floats
    """Positions of the joints [rad] of the standing robot."""
    height: float
    """Height of its base at the start [m]."""
    spread: float
    """Largest distance of a joint from the stance at the start [rad]."""
    kp: float
    kd: float
    h: float = H
    integrator: str = "Euler"
    """Integrator of MuJoCo."""

    def text(self) -> StepText:
        """Return the text of a step."""
        return contact_step_text(self.model, self.touching, h=self.h, kp=self.kp, kd=self.kd)

    def standing(self, step: int, n: int) -> Floats:
        """Return the same stance for all."""
        return np.tile(self.stance, (n, 1))

    def initial_configurations(self, n: int) -> Floats:
        """Return the configurations (n, nq) in which the robots begin."""
        q, joints = np.tile(self.model.neutral(), (n, 1)), len(self.stance)
        q[:, 2] = self.height
        q[:, 7:] = self.stance + np.random.default_rng(1).uniform(-self.spread, self.spread, (n, joints))
        return q

    def spheres(self) -> list[tuple[str, Floats, float]]:
        """Return the link, the center in its axes [m], and the radius [m] of each sphere."""
        found = []
        for each in self.touching.shapes:
            assert isinstance(each.shape, Sphere)
            found.append((self.model.mechanism.frames[each.frame].name, each.p, each.shape.radius))
        return found

    def foot_heights(self) -> Callable[[Floats], Floats]:
        """Return the function of the spheres' heights above the plane (n, spheres) at q (n, nq)."""
        robot, spheres = backend("compiled", self.model), self.spheres()

        def heights(q: Floats) -> Floats:
            T = {link: robot.forward_kinematics(q, link) for link, _, _ in spheres}
            found = [T[link][:, 2, :3] @ p + T[link][:, 2, 3] - radius for link, p, radius in spheres]
            return np.stack(found, axis=1)

        return heights


def quadruped(*, h: float = H, kp: float = KP, kd: float = KD) -> Footed:
    """Return A1 on its feet."""
    model = load("a1", base="floating")
    feet = spheres_on_plane({model.frame_index(foot): RADIUS for foot in FEET}, FRICTION)
    return Footed("A1", model, feet, STANCE, HEIGHT, 0.05, kp, kd, h)


def humanoid() -> Footed:
    """Return G1 on the spheres under its feet."""
    model = load("g1", base="floating")
    shapes = [
        FramedShape(
            model.frame_index(link), each.shape, np.eye(3), np.array(each.origin.xyz, dtype=float), FRICTION
        )
        for link in SOLES
        for each in model.geometry.collisions(link)
    ]
    stance = [sum(a for part, a in HUMANOID_STANCE.items() if part in joint) for joint in model.joint_names]
    return Footed(
        "G1 with 8 contacts",
        model,
        ShapesOnPlane(tuple(shapes)),
        np.array(stance, dtype=float),
        HUMANOID_HEIGHT,
        0.03,
        HUMANOID_KP,
        HUMANOID_KD,
        integrator="implicitfast",
    )


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


STANDING = "standing"
MOTIONS: dict[str, Targets | None] = {STANDING: None, "random targets": random_targets, "trot": trot}
"""Targets of the motions of A1; None: it stands."""


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


def mujoco_model(robot: Footed) -> Any:
    """Return the robot as MuJoCo's model, with spheres, a plane and servos of its own."""
    root = ElementTree.fromstring(robot.model.to_mjcf())
    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag in ("geom", "asset", "actuator", "custom", "contact"):
                parent.remove(child)
    for joint in root.iter("joint"):
        for limit in ("range", "actuatorfrcrange"):
            joint.attrib.pop(limit, None)
    for compiler in root.iter("compiler"):
        compiler.set("fusestatic", "true")
    bodies = {body.get("name"): body for body in root.iter("body")}
    touches = {"friction": f"{FRICTION} 0 0", "condim": "3"}
    for link, p, radius in robot.spheres():
        sphere = {"type": "sphere", "size": str(radius), "pos": " ".join(map(str, p.tolist()))} | touches
        sphere |= {"contype": "1", "conaffinity": "0", "mass": "0"}
        ElementTree.SubElement(bodies[link], "geom", sphere)
    plane = {"type": "plane", "size": "0 0 1", "contype": "0", "conaffinity": "1"} | touches
    world = root.find("worldbody")
    assert world is not None
    ElementTree.SubElement(world, "geom", plane)
    ElementTree.SubElement(root, "option", {"timestep": str(robot.h), "integrator": robot.integrator})
    actuators = ElementTree.SubElement(root, "actuator")
    gains = {"kp": str(robot.kp), "kv": str(robot.kd)}
    for name in robot.model.joint_names:
        ElementTree.SubElement(actuators, "position", {"joint": name} | gains)
    return mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))


class MujocoRobots:
    """A batch of robots of `mujoco.rollout`."""

    def __init__(self, robot: Footed, n: int) -> None:
        from mujoco import rollout

        self._rollout = rollout
        self._spheres = robot.spheres()
        self.model = mujoco_model(robot)
        self.data = mujoco.MjData(self.model)
        kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
        q = robot.initial_configurations(n)
        self.state = np.zeros((n, mujoco.mj_stateSize(self.model, kind)))
        for k in range(n):
            self.data.qpos[:3] = q[k, :3]
            self.data.qpos[3:7] = q[k, [6, 3, 4, 5]]
            self.data.qpos[7:] = q[k, 7:]
            mujoco.mj_getState(self.model, self.data, self.state[k], kind)

    def steps(self, targets: Floats) -> float:
        """Take the steps of targets (n, steps, joints) and return the processor time [s]."""
        start = time.thread_time()
        states, _ = self._rollout.rollout(self.model, self.data, self.state, targets)
        spent = time.thread_time() - start
        self.state = states[:, -1]
        self.states = states
        return spent

    def heights(self) -> Floats:
        """Return the heights of the spheres above the plane [m] (n, spheres) in the last states."""
        nq, found = self.model.nq, []
        for state in self.state:
            self.data.qpos[:] = state[1 : 1 + nq]
            self.data.qvel[:] = state[1 + nq :][: self.model.nv]
            mujoco.mj_fwdPosition(self.model, self.data)
            spheres = self.model.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE
            found.append(self.data.geom_xpos[spheres, 2] - self._spheres[0][2])
        return np.array(found)

    def normal_forces(self, target: Floats) -> Floats:
        """Return the sum of the normal forces (n,) [N] in the last states, at a `target` (joints,)."""
        found, kind = [], mujoco.mjtState.mjSTATE_FULLPHYSICS
        for state in self.state:
            mujoco.mj_setState(self.model, self.data, state, kind)
            self.data.ctrl[:] = target
            mujoco.mj_forward(self.model, self.data)
            force, total = np.zeros(6), 0.0
            for contact in range(self.data.ncon):
                mujoco.mj_contactForce(self.model, self.data, contact, force)
                total += force[0]
            found.append(total)
        return np.array(found)


def measure(
    robot: Footed, name: str, moves: Targets | None, kernel: Kernel, n: int, seconds: float, others: int
) -> dict[str, Any]:
    """Simulate one motion and return its row."""
    targets, steps = moves or robot.standing, round(seconds / robot.h)
    robots = Robots(kernel, robot.initial_configurations(n))
    theirs = MujocoRobots(robot, others)
    ours_ns: list[float] = []
    theirs_ns: list[float] = []
    residual, first = 0.0, steps // 2
    piece = max((steps - first) // ROUNDS, 1)
    heights = robot.foot_heights()
    depth, their_depth = 0.0, 0.0
    start = robots.state[0]
    for begin in range(0, steps, piece):
        end = min(begin + piece, steps)
        spent = 0.0
        for step in range(begin, end):
            if step % HOLD == 0 or step == begin:
                target = targets(step, n)
            if step == steps - round(0.1 / robot.h):
                start = robots.state[0].copy()
            spent += robots.step(target)
            if step >= first:
                residual = max(residual, float(robots.residual.max()))
        sequence = np.stack([targets(step, others) for step in range(begin, end)], axis=1)
        their_time = theirs.steps(sequence)
        if begin >= first:
            ours_ns.append(1e9 * spent / n / (end - begin))
            theirs_ns.append(1e9 * their_time / others / (end - begin))
            depth = max(depth, -float(heights(robots.state[0][:others]).min()))
            their_depth = max(their_depth, -float(theirs.heights().min()))
    row = {
        "motion": name,
        "ns": float(np.median(ours_ns)),
        "mujoco_ns": float(np.median(theirs_ns)),
        "residual": residual,
        "penetration": depth,
        "mujoco_penetration": their_depth,
    }
    if moves is None:
        weight = -float(robot.model.total_mass * robot.model.gravity[2])
        moved = np.linalg.norm(robots.state[0][:, :3] - start[:, :3], axis=1)
        row["creep"] = float(np.median(moved)) / 0.1
        way = np.linalg.norm(theirs.states[:, -1, 1:4] - theirs.states[:, 0, 1:4], axis=1)
        row["mujoco_creep"] = float(np.median(way)) / (robot.h * max(theirs.states.shape[1] - 1, 1))
        normal = robots.state[2][:, ::3].sum(axis=1) / robot.h
        row["weight"] = float(np.median(np.abs(normal / weight - 1.0)))
        row["mujoco_weight"] = float(np.median(np.abs(theirs.normal_forces(robot.stance) / weight - 1.0)))
        row["base"] = float(robots.state[0][:, 2].min())
        row["mujoco_base"] = float(theirs.state[:, 3].min())
    return row


def print_row(row: dict[str, Any]) -> None:
    """Print the row of a motion."""
    print(
        f"{row['motion']}: dynx {row['ns']:.0f} ns, MuJoCo {row['mujoco_ns']:.0f} ns "
        f"({row['mujoco_ns'] / row['ns']:.0f}x), residual {row['residual']:.1e} m/s, penetration "
        f"{row['penetration']:.1e} m, MuJoCo {row['mujoco_penetration']:.1e} m"
    )
    if "creep" in row:
        print(
            f"  creep {row['creep']:.1e} m/s, MuJoCo {row['mujoco_creep']:.1e}; "
            f"weight {row['weight']:.1e}, MuJoCo {row['mujoco_weight']:.1e}; "
            f"lowest base {row['base']:.3f} m, MuJoCo {row['mujoco_base']:.3f} m"
        )


def quadruped_of_all_shapes(n: int, seconds: float) -> float:
    """Print the time of A1 with twelve contacts, which stands, and then gets random targets, under which it
    falls; return the largest residual [m/s] while it stands."""
    text, q = _with_all_shapes(n)
    robots, steps, stance = Robots(compiled(text), q), round(seconds / H), np.tile(STANCE, (n, 1))
    standing, residuals = _times_and_residuals(robots, lambda step, n: stance, steps, n)
    print(
        f"A1 with 12 contacts, standing: dynx {standing:.0f} ns, residual {residuals.max():.1e} m/s, "
        f"lowest base {robots.state[0][:, 2].min():.3f} m"
    )
    moving, of_motion = _times_and_residuals(robots, random_targets, steps, n)
    share = float((of_motion > MAX_RESIDUAL).mean())
    print(
        f"A1 with 12 contacts, random targets: dynx {moving:.0f} ns, residual {of_motion.max():.1e} m/s, "
        f"above {MAX_RESIDUAL:.0e} m/s in {share:.1e} of all steps"
    )
    return float(residuals.max())


def _times_and_residuals(robots: Robots, targets: Targets, steps: int, n: int) -> tuple[float, Floats]:
    """Return the median time of a step [ns], and the residual [m/s] of each robot and step, in the second
    half of so many steps."""
    times: list[float] = []
    residuals: list[Floats] = []
    for step in range(steps):
        if step % HOLD == 0:
            target = targets(step, n)
        spent = robots.step(target)
        if step >= steps // 2:
            times.append(1e9 * spent / n)
            residuals.append(robots.residual[:, 0].copy())
    return float(np.median(times)), np.array(residuals)


def _with_all_shapes(n: int) -> tuple[StepText, Floats]:
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
    return text, quadruped().initial_configurations(n)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a table; return 1 if a residual exceeds its bound."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.contact_steps", description=__doc__)
    parser.add_argument("--batch", type=int, default=8192, help="default: 8192")
    parser.add_argument("--mujoco-batch", type=int, default=64, help="default: 64")
    parser.add_argument("--seconds", type=float, default=2.0, help="default: 2")
    parser.add_argument("--motion", choices=MOTIONS, action="append", help="default: all")
    parser.add_argument(
        "--further", action="store_true", help="let G1, and A1 with twelve contacts, stand, too"
    )
    options = parser.parse_args(arguments)
    robot = quadruped()
    start = time.perf_counter()
    kernel = compiled(robot.text())
    ready = time.perf_counter() - start
    print(f"kernel after {ready:.1f} s; {options.batch} robots, of MuJoCo {options.mujoco_batch}")
    worst, stands = 0.0, True
    sizes = options.batch, options.seconds, options.mujoco_batch
    for name in options.motion or MOTIONS:
        row = measure(robot, name, MOTIONS[name], kernel, *sizes)
        worst = max(worst, row["residual"])
        print_row(row)
    if options.further:
        worst = max(worst, quadruped_of_all_shapes(*sizes[:2]))
        robot = humanoid()
        row = measure(robot, f"{robot.name}, standing", None, compiled(robot.text()), *sizes)
        worst, stands = max(worst, row["residual"]), row["base"] > STANDING_HEIGHT
        print_row(row)
    return 0 if worst <= MAX_RESIDUAL and stands else 1


if __name__ == "__main__":
    sys.exit(main())
