"""Rewrites that keep a robot, and planted differences, against ``dynx same``.

``python -m benchmarks.surveys.same_rewrites rewrites 0:2000 --record FILE`` and ``... planted 0:2000
--record FILE``.

Each seed draws a robot (of example-robot-data, of models/, or a random one), base, formats and changes.
Both were written from the specifications of URDF, MJCF and SDF before the comparison was opened. Whether a
rewrite keeps the robot, and whether a planted difference is one, engines decide that know nothing of dynx
(`robot_truth`): mass matrices and gravity at random states. For what MJCF alone has, MuJoCo decides: lengths
of tendons and actuators, errors of constraints, and keyframes. A run that was interrupted continues with
``--record``; ``--jobs`` runs several seeds at once, ``--seconds`` ends a run after that time, ``--report``
only prints the counts of the record.

A rewrite is right if the verdict is "same", no element is named, and no attribute differs. A planted
difference is right if the element it is planted in is named, and no other. Another element counts as right
("equivalent") if it is the only one and its mended file is the robot by the engines. A planted difference
that engines and joint lines do not see lies in the null space: there "same" is right.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.progress import Record, tell
from benchmarks.surveys.robot_texts import (
    Actuator,
    Equality,
    Format,
    Inertial,
    Joint,
    Keyframe,
    Link,
    Matrix,
    Robot,
    Sensor,
    Shape,
    Style,
    Tendon,
    axis_angle,
    combined,
    exponential,
    inverse,
    pose,
    read_urdf,
    rotation_from_rpy,
    shifted_tensor,
    split_file,
    write,
    write_urdf,
)
from benchmarks.surveys.robot_truth import (
    Correspondence,
    coupling_difference,
    line_difference,
    text_difference,
)

TOLERANCE = 1e-10
"""Tolerance of the comparison for planted differences; rewrites are compared with the default."""
ALTERED = 1e-8
"""Relative difference of mass matrices from which a rewrite is wrong."""
DROPPED = 1e-6
"""The same for MuJoCo, which drops inertial offsets below 1e-6 m."""
UNCOUPLED = 1e-9
"""The same for lengths of tendons and actuators, errors of constraints, and keyframes."""
LIBRARY = (
    "a1 allegro_left_hand alexander anymal anymal_kinova asr_twodof b1_z1 baxter bolt borinot centauro",
    "double_pendulum double_pendulum_continuous finger_edu g1 go1 go2 hextilt human hyq icub_reduced",
    "iris_description_iris kinova laikago panda pr2 quadruped romeo_small simple_humanoid so100 so101 solo12",
    "solo8 talos talos_arm tiago_no_hand ur3_gripper ur5 ur10 xarm7 z1",
)
OWN = ("cart_pole dynx_double_pendulum pendulum planar_2r planar_3r scara", "seven_axis_arm six_axis_arm")


# Robots.


@cache
def library_robot(name: str) -> tuple[Robot, str]:
    """Return a robot by name, and the text of its file."""
    from dynx.model.library import robots

    text = next(Path(each.path) for each in robots() if each.name == name).read_text(encoding="utf-8")
    return read_urdf(text), text


def random_inertial(rng: np.random.Generator, size: float) -> Inertial:
    """Return the inertia of a random cloud of six points within `size` [m], in a random frame."""
    points, masses = rng.uniform(-size, size, (6, 3)), rng.uniform(0.05, 1.0, 6)
    com = masses @ points / masses.sum()
    tensor = sum(shifted_tensor(m, p - com) for m, p in zip(masses, points, strict=True))
    frame = random_rotation(rng) if rng.random() < 0.5 else np.eye(3)
    return Inertial(float(masses.sum()), com, np.asarray(tensor), frame)


def random_rotation(rng: np.random.Generator) -> Matrix:
    """Return a random rotation, a quarter turn in one case of three."""
    if rng.random() < 1 / 3:
        return rotation_from_rpy(rng.integers(-1, 3, 3) * np.pi / 2)
    axis = rng.normal(size=3)
    return axis_angle(axis / np.linalg.norm(axis), rng.uniform(0, np.pi))


def random_shape(rng: np.random.Generator, visual: bool) -> Shape:
    """Return a random box, sphere or cylinder."""
    kind = str(rng.choice(["box", "sphere", "cylinder"]))
    size = tuple(rng.uniform(0.02, 0.3, {"box": 3, "sphere": 1, "cylinder": 2}[kind]).tolist())
    return Shape(kind, size, pose(random_rotation(rng), rng.uniform(-0.2, 0.2, 3)), visual)


def random_robot(rng: np.random.Generator) -> Robot:
    """Return a random tree of 2 to 12 joints; one in two has ball joints, which excludes mimics and URDF."""
    count = int(rng.integers(2, 13))
    kinds = ["revolute", "revolute", "continuous", "prismatic", "fixed"]
    has_balls = bool(rng.random() < 0.5)
    kinds += ["ball", "ball"] * has_balls
    robot = Robot("random", {"link_0": Link("link_0", random_inertial(rng, 0.2))}, [])
    for i in range(1, count + 1):
        kind = str(rng.choice(kinds))
        parent = f"link_{rng.integers(max(0, i - 3), i)}"
        axis = np.eye(3)[rng.integers(3)] * rng.choice([-1, 1]) if rng.random() < 0.5 else rng.normal(size=3)
        T = pose(random_rotation(rng) if rng.random() < 0.6 else None, rng.uniform(-0.4, 0.4, 3).round(3))
        if kind != "fixed" and rng.random() < 0.15:
            # In one body of MJCF no joint that turns may follow a ball joint.
            others = [each for each in kinds if each != "ball" or kind == "prismatic"]
            parent = insert_joint(robot, rng, parent, f"joint_{i}_first", others, T)
            T = pose(None, rng.uniform(-0.2, 0.2, 3).round(3))
        joint = Joint(f"joint_{i}", kind, parent, f"link_{i}", T, axis / np.linalg.norm(axis))
        if joint.is_ball:
            draw_ball(joint, rng)
        if joint.moves:
            joint.effort, joint.velocity = round(rng.uniform(1, 100), 2), round(rng.uniform(1, 10), 2)
            joint.damping, joint.friction = (
                round(rng.uniform(0, 1), 3) if rng.random() < 0.5 else 0.0 for _ in "ab"
            )
            if kind != "continuous":
                joint.lower, joint.upper = round(rng.uniform(-3, -0.1), 3), round(rng.uniform(0.1, 3), 3)
            if rng.random() < 0.2:
                joint.stiffness, joint.rest = round(rng.uniform(0.1, 5), 3), round(rng.uniform(-0.5, 0.5), 3)
            leaders = [each.name for each in robot.joints if each.type == kind and each.mimic is None]
            if leaders and not has_balls and rng.random() < 0.1:
                joint.mimic = (
                    str(rng.choice(leaders)),
                    round(rng.uniform(0.3, 2), 2),
                    round(rng.uniform(-1, 1), 2),
                )
        link = Link(joint.child, random_inertial(rng, 0.2))
        link.shapes = [random_shape(rng, bool(rng.random() < 0.5)) for _ in range(rng.integers(0, 3))]
        robot.links[link.name] = link
        robot.joints.append(joint)
        if joint.type != "fixed" and rng.random() < 0.15:
            offset_link(robot, joint, rng.uniform(-0.2, 0.2, 3).round(3))
    if not any(joint.moves for joint in robot.joints):
        return random_robot(rng)
    if rng.random() < 0.4:
        held = str(rng.choice([name for name, link in robot.links.items() if not link.is_empty]))
        robot.links["tool"] = Link("tool")
        robot.joints.append(
            Joint("to_tool", "fixed", held, "tool", pose(random_rotation(rng), rng.uniform(-0.2, 0.2, 3)))
        )
    return robot


def draw_ball(joint: Joint, rng: np.random.Generator) -> None:
    """Draw the largest angle and the losses of a ball joint."""
    if rng.random() < 0.5:
        joint.upper = round(rng.uniform(0.3, 3.0), 3)
    joint.damping, joint.friction, joint.armature = (
        round(rng.uniform(0, 1), 3) if rng.random() < 0.3 else 0.0 for _ in "abc"
    )


def insert_joint(
    robot: Robot, rng: np.random.Generator, parent: str, name: str, kinds: list[str], T: Matrix
) -> str:
    """Add a joint that moves no link of its own, and return the link between it and the next joint."""
    axis = rng.normal(size=3)
    kind = str(rng.choice([each for each in kinds if each != "fixed"]))
    joint = Joint(name, kind, parent, f"{name}_link", T, axis / np.linalg.norm(axis))
    if joint.is_ball:
        draw_ball(joint, rng)
    elif kind != "continuous":
        joint.lower, joint.upper = round(rng.uniform(-3, -0.1), 3), round(rng.uniform(0.1, 3), 3)
    if joint.moves:
        joint.effort, joint.velocity = round(rng.uniform(1, 100), 2), round(rng.uniform(1, 10), 2)
    robot.links[joint.child] = Link(joint.child)
    robot.joints.append(joint)
    return joint.child


def offset_link(robot: Robot, joint: Joint, p: Matrix) -> None:
    """Put a link away from its joint, to the point p in the frame that it had; its contents go along."""
    between, child = f"{joint.name}_link", joint.child
    robot.links[between] = Link(between)
    joint.child = between
    robot.joints.append(Joint(f"{child}_fixed", "fixed", between, child, pose(None, p)))


def decorate(robot: Robot, rng: np.random.Generator, floating: bool) -> None:
    """Draw what MJCF alone can say: tendons, constraints, keyframes, actuators, filters, pairs."""
    moving = [joint.name for joint in robot.joints if joint.moves]

    def several(most: int) -> range:
        return range(int(rng.integers(0, most + 1)))

    def interval(size: float) -> tuple[float, float]:
        return -round(rng.uniform(0.1, size), 3), round(rng.uniform(0.1, size), 3)

    for i in several(3):
        names = rng.permutation(moving)[: rng.integers(1, 5)]
        terms = {str(name): round(float(rng.choice([-1, 1]) * rng.uniform(0.1, 2.0)), 3) for name in names}
        tendon = Tendon(f"tendon_{i}", terms, interval(2.0) if rng.random() < 0.5 else None)
        tendon.stiffness, tendon.rest = round(rng.uniform(0.1, 5), 3), round(rng.uniform(-0.5, 0.5), 3)
        tendon.rest *= rng.random() < 0.7
        tendon.damping, tendon.friction = (
            round(rng.uniform(0, 1), 3) if rng.random() < 0.5 else 0.0 for _ in "ab"
        )
        robot.tendons.append(tendon)
    heavy = [name for name, link in robot.links.items() if not link.is_empty and name != "world"]
    for i in several(4):
        kind = str(rng.choice(["connect", "weld", "joint", "tendon"]))
        each = Equality(f"equality_{i}", kind, "", "", active=bool(rng.random() < 0.7))
        if rng.random() < 0.5:
            each.time_constant = round(rng.uniform(0.01, 0.1), 4)
        if each.joins_links:
            each.first = str(rng.choice(heavy))
            apart = [name for name in heavy if name not in robot.body(each.first)]
            if not apart:
                continue
            each.second = str(rng.choice(apart))
            each.anchor = rng.uniform(-0.2, 0.2, 3).round(3)
            each.T = pose(random_rotation(rng), rng.uniform(-0.3, 0.3, 3))
            if kind == "weld":
                each.torque_scale = round(rng.uniform(0.5, 2), 2)
                each.is_closed = bool(rng.random() < 0.3)
        else:
            names = rng.permutation(moving if kind == "joint" else [tendon.name for tendon in robot.tendons])
            if len(names) == 0:
                continue
            each.first, each.second = str(names[0]), str(names[1]) if len(names) > 1 else ""
            each.polynomial = rng.uniform(-1, 1, 5).round(3) * (rng.random(5) < 0.6)
            if not each.second:
                each.polynomial[1:] = [1.0, 0.0, 0.0, 0.0]
        robot.equalities.append(each)
    for i in several(3):
        key = Keyframe(f"key_{i}", {name: round(float(rng.uniform(-1, 1)), 4) for name in moving})
        key.q.update({joint.name: random_rotation(rng) for joint in robot.joints if joint.is_ball})
        if floating:
            key.T_world_root = pose(random_rotation(rng), rng.uniform(-1, 1, 3).round(3))
        robot.keyframes.append(key)
    for i in several(3):
        on_tendon = bool(robot.tendons) and bool(rng.random() < 0.4)
        target = str(rng.choice([tendon.name for tendon in robot.tendons] if on_tendon else moving))
        actuator = Actuator(
            f"actuator_{i}", str(rng.choice(["motor", "position", "velocity"])), target, on_tendon
        )
        actuator.gear, actuator.gain = round(rng.uniform(0.5, 50), 2), round(rng.uniform(0.5, 50), 2)
        actuator.ctrl_range = interval(2.0) if rng.random() < 0.5 else None
        actuator.force_range = interval(20.0) if rng.random() < 0.5 else None
        robot.actuators.append(actuator)
    for link in robot.links.values():
        if not link.is_empty and link.name != "world" and rng.random() < 0.1:
            link.compensation = round(rng.uniform(0.1, 1), 3)
    balls = [joint.name for joint in robot.joints if joint.is_ball]
    choices = [("jointpos", moving), ("jointvel", moving), ("ballquat", balls), ("ballangvel", balls)]
    choices.append(("tendonpos", [tendon.name for tendon in robot.tendons]))
    for i in several(3):
        what, targets = choices[int(rng.integers(len(choices)))]
        if targets:
            sensor = Sensor(f"sensor_{i}", what, str(rng.choice(targets)), what == "tendonpos")
            sensor.cutoff, sensor.noise = (round(rng.uniform(0.1, 1), 3) for _ in "ab")
            sensor.cutoff *= what != "ballquat"  # MuJoCo refuses it
            robot.sensors.append(sensor)
    shapes = {
        name: [each for each in link.shapes if not each.visual and each.kind != "mesh"]
        for name, link in robot.links.items()
    }
    touching = [name for name, found in shapes.items() if found]
    if len(touching) > 1 and rng.random() < 0.5:
        first, second = (str(name) for name in rng.choice(touching, 2, replace=False))
        if "world" not in (first, second) and second not in robot.body(first):
            robot.exclusions.append((first, second))
    if len(touching) > 1 and rng.random() < 0.3:
        first, second = (str(name) for name in rng.choice(touching, 2, replace=False))
        if second not in robot.body(first):
            robot.contacts.append((shapes[first][0], shapes[second][0]))


def draw_robot(rng: np.random.Generator) -> tuple[str, Robot, str | None, bool]:
    """Return name, robot, the text of its file if it has one, and whether its base floats."""
    choice = rng.random()
    if choice < 0.3 or rng.random() < 0.3:
        robot = random_robot(rng)
        return "random", robot, None, bool(rng.random() < 0.5)
    name = str(rng.choice(" ".join(OWN if choice < 0.42 else LIBRARY).split()))
    robot, text = library_robot(name)
    if len(robot.joints) > 30 and rng.random() < 0.6:
        return draw_robot(rng)
    root = robot.links[robot.root]
    heavy = root.inertial is not None and root.inertial.mass > 0.0
    return name, robot.copy(), text, bool(heavy and root.name != "world" and rng.random() < 0.5)


# Rewrites that keep the robot.


@dataclass
class Rewritten:
    """A rewritten robot and its coordinates from those of the former one."""

    robot: Robot
    signs: dict[str, int] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)
    turns: dict[str, tuple[Matrix, Matrix]] = field(default_factory=dict)
    T_root: Matrix = field(default_factory=lambda: np.eye(4))
    renamed: bool = False

    @property
    def by(self) -> Correspondence:
        """The coordinates of the rewritten robot from those of the former one."""
        return Correspondence(self.signs, self.names, self.turns, self.T_root)

    def turn_ball(self, joint: str, before: Matrix, after: Matrix) -> None:
        """Turn frames of a ball joint: its former rotation is `before`, the new one, `after`."""
        former = next((old for old, new in self.names.items() if new == joint), joint)
        first, last = self.turns.get(former, (np.eye(3), np.eye(3)))
        self.turns[former] = (first @ before, after @ last)
        for key in self.robot.keyframes:
            q = key.q[joint]
            assert not isinstance(q, float)
            key.q[joint] = before.T @ q @ after.T

    def move_frame(self, name: str, T: Matrix) -> None:
        """Give a link the frame that has the pose T in its former one; what it carries stays.

        A revolute joint above allows turns and moves along its axis, a ball joint turns.
        """
        robot, back = self.robot, inverse(T)
        link, above = robot.links[name], robot.above(name)
        if link.inertial is not None:
            link.inertial = link.inertial.moved(back)
        for shape in link.shapes:
            shape.T = back @ shape.T
        for joint in robot.children(name):
            joint.T = back @ joint.T
        for each in robot.equalities:
            if not each.joins_links:
                continue
            if name == (each.first if each.kind == "connect" else each.second):
                each.anchor = (back @ np.append(each.anchor, 1.0))[:3]
            if name == each.first:
                each.T = back @ each.T
            if name == each.second:
                each.T = each.T @ pose(T[:3, :3])
        if above is None:
            self.T_root = self.T_root @ T
            for key in robot.keyframes:
                key.T_world_root = key.T_world_root @ T
            return
        R = T[:3, :3]
        above.T = above.T @ T
        above.axis = R.T @ above.axis
        if above.is_ball:
            self.turn_ball(above.name, R, R.T)


def has_rough_ball(robot: Robot, link: str) -> bool:
    """Check whether the body of MJCF that has the link turns in a ball joint with friction.

    MuJoCo's friction acts about each of the three axes of the body.
    """
    above = robot.above(link)
    while above is not None:
        if above.is_ball and above.friction:
            return True
        if not robot.is_implied(above.parent):
            return False
        above = robot.above(above.parent)
    return False


def move_frames(it: Rewritten, rng: np.random.Generator, floating: bool) -> None:
    """Move frames of links with mass or shapes: along the axis of a revolute joint, anywhere elsewhere."""
    robot = it.robot
    for name, link in robot.links.items():
        above = robot.above(name)
        if link.is_empty or rng.random() < 0.3 or (above is None and not floating):
            continue
        R, p = random_rotation(rng), rng.uniform(-0.3, 0.3, 3)
        if has_rough_ball(robot, name):
            R = rotation_from_rpy(rng.integers(-1, 3, 3) * np.pi / 2)
        if above is not None and above.type in ("revolute", "continuous"):
            p = above.axis * rng.uniform(-0.3, 0.3) * rng.integers(0, 2)
        elif above is not None and above.is_ball:
            p = np.zeros(3)
        elif above is not None and above.type not in ("prismatic", "fixed"):
            continue
        it.move_frame(name, pose(R, p))


def turn_zero_poses(it: Rewritten, rng: np.random.Generator, floating: bool) -> None:
    """Turn zero poses of ball joints without limits, if no constraint depends on the pose of the file."""
    if it.robot.has_connect:
        return
    for joint in it.robot.joints:
        implied = it.robot.is_implied(joint.parent)
        if joint.is_ball and joint.upper is None and not implied and rng.random() < 0.5:
            R = random_rotation(rng)
            joint.T = joint.T @ pose(R)
            it.turn_ball(joint.name, R, np.eye(3))


def offset_links(it: Rewritten, rng: np.random.Generator, floating: bool) -> None:
    """Move frames of links away from their joints, so that MJCF states the points of the joints."""
    robot = it.robot
    for name in list(robot.links):
        above = robot.above(name)
        if above is None or above.type == "fixed" or robot.links[name].is_empty or rng.random() < 0.5:
            continue
        if f"{above.name}_link" in robot.links:
            continue  # the name that MJCF implies is taken
        p = rng.uniform(-0.2, 0.2, 3)
        offset_link(robot, above, np.zeros(3))
        it.move_frame(name, pose(None, p))


def exchange_ends(it: Rewritten, rng: np.random.Generator, floating: bool) -> None:
    """Name the links of constraints in the other order, with the points and turns that this needs."""
    poses = it.robot.poses()
    for each in it.robot.equalities:
        if not each.joins_links or rng.random() < 0.5:
            continue
        if each.is_closed:
            it.robot.close_weld(each)
        first, second = each.first, each.second
        if each.kind == "connect":
            point = inverse(poses[second]) @ poses[first] @ np.append(each.anchor, 1.0)
            each.anchor = point[:3]
        else:
            each.anchor, each.T = each.T[:3, 3], pose(each.T[:3, :3].T, each.anchor)
        each.first, each.second = second, first


def without_names(text: str) -> str:
    """Return MJCF whose constraints and actuators have no names."""
    return re.sub(r' name="(equality|actuator)_\d+"', "", text)


def align_chains(it: Rewritten) -> None:
    """Turn frames between joints of one body of MJCF like the body, for MJCF states only one frame."""
    robot = it.robot
    for name in list(robot.links):
        if name in robot.links and not robot.is_implied(name):
            above = robot.above(name)
            while above is not None and robot.is_implied(above.parent):
                R = above.T[:3, :3].copy()
                it.move_frame(above.parent, pose(R))
                above.T[:3, :3] = np.eye(3)
                above = robot.above(above.parent)


def change_references(it: Rewritten, rng: np.random.Generator, floating: bool) -> None:
    """Draw another pose of the file, if no constraint depends on it."""
    robot = it.robot
    if robot.has_connect:
        return
    for joint in robot.joints:
        if not joint.moves or rng.random() < 0.5:
            continue
        if not any(each.is_ball for each in robot.chain(joint)):
            joint.ref = round(rng.uniform(-0.5, 0.5), 3)


def turn_inertias(it: Rewritten, rng: np.random.Generator, floating: bool) -> None:
    """State tensors in other axes."""
    for link in it.robot.links.values():
        if link.inertial is not None and rng.random() < 0.7:
            link.inertial.frame = random_rotation(rng)


def split_links(it: Rewritten, rng: np.random.Generator, floating: bool) -> None:
    """Split links in two that a fixed joint holds, with shares of mass, shapes and children."""
    robot = it.robot
    for name in list(robot.links):
        link = robot.links[name]
        if link.inertial is None or link.inertial.mass <= 0.0 or rng.random() < 0.6:
            continue
        own = link.inertial
        share = rng.uniform(0.1, 0.9)
        least = max(float(np.linalg.eigvalsh(own.tensor)[0]), 0.0)
        d = rng.normal(size=3)
        d *= 0.3 * np.sqrt(least / own.mass) / np.linalg.norm(d)
        rest = own.tensor - shifted_tensor(own.mass * share * (1 - share), d)
        moments = np.linalg.eigvalsh(rest)
        if moments[2] > moments[0] + moments[1]:
            # No body has such moments, and Drake replaces them.
            d, rest = np.zeros(3), own.tensor
        T = pose(random_rotation(rng), rng.uniform(-0.2, 0.2, 3))
        second = Inertial(own.mass * (1 - share), own.com - share * d, (1 - share) * rest, own.frame)
        link.inertial = Inertial(own.mass * share, own.com + (1 - share) * d, share * rest, own.frame)
        new = Link(f"{name}_second", second.moved(inverse(T)), compensation=link.compensation)
        for shape in list(link.shapes):
            if rng.random() < 0.5:
                link.shapes = [each for each in link.shapes if each is not shape]
                shape.T = inverse(T) @ shape.T
                new.shapes.append(shape)
        for joint in robot.children(name):
            if rng.random() < 0.5:
                joint.parent, joint.T = new.name, inverse(T) @ joint.T
        for pair in list(robot.exclusions):
            if name in pair:
                robot.exclusions.append((new.name, pair[1] if pair[0] == name else pair[0]))
        robot.links[new.name] = new
        robot.joints.append(Joint(f"{name}_split", "fixed", name, new.name, T))


def merge_links(it: Rewritten, rng: np.random.Generator, floating: bool) -> None:
    """Merge links with mass or shapes into those that hold them by a fixed joint."""
    robot = it.robot
    for joint in [each for each in robot.joints if each.type == "fixed"]:
        link, into = robot.links[joint.child], robot.links[joint.parent]
        if link.is_empty or into.is_empty or rng.random() < 0.4:
            continue
        if any({joint.parent, joint.child} & set(pair) for pair in robot.exclusions):
            continue
        if link.compensation != into.compensation:
            continue
        it.move_frame(link.name, inverse(joint.T))
        for each in robot.equalities:
            if each.joins_links:
                each.first = into.name if each.first == link.name else each.first
                each.second = into.name if each.second == link.name else each.second
        if link.inertial is not None:
            into.inertial = combined(into.inertial, link.inertial)
        into.shapes += link.shapes
        for below in robot.children(link.name):
            below.parent = into.name
        robot.joints = [each for each in robot.joints if each is not joint]
        del robot.links[link.name]


def reverse_axes(it: Rewritten, rng: np.random.Generator, floating: bool) -> None:
    """Reverse axes, with limits and mimics."""
    for joint in it.robot.joints:
        if not joint.moves or rng.random() < 0.5:
            continue
        joint.axis = -joint.axis
        joint.rest, joint.ref = -joint.rest, -joint.ref
        reverse_couplings(it.robot, joint.name)
        it.signs[joint.name] = -it.signs.get(joint.name, 1)
        if joint.lower is not None and joint.upper is not None:
            joint.lower, joint.upper = -joint.upper, -joint.lower
        if joint.mimic is not None:
            joint.mimic = (joint.mimic[0], -joint.mimic[1], -joint.mimic[2])
        for other in it.robot.joints:
            if other.mimic is not None and other.mimic[0] == joint.name:
                other.mimic = (other.mimic[0], -other.mimic[1], other.mimic[2])


def reverse_couplings(robot: Robot, joint: str) -> None:
    """Reverse the sign of a joint's position in tendons, constraints, keyframes and actuators."""
    for tendon in robot.tendons:
        if joint in tendon.terms:
            tendon.terms[joint] *= -1.0
    for each in robot.equalities:
        if each.kind == "joint" and each.first == joint:
            each.polynomial = -each.polynomial
        elif each.kind == "joint" and each.second == joint:
            each.polynomial = each.polynomial * [1.0, -1.0, 1.0, -1.0, 1.0]
    for key in robot.keyframes:
        q = key.q[joint]
        assert isinstance(q, float)
        key.q[joint] = -q
    for actuator in robot.actuators:
        if not actuator.on_tendon and actuator.target == joint:
            actuator.gear *= -1.0


def rename_joints(robot: Robot, names: dict[str, str]) -> None:
    """Give joints other names, also where they are named."""
    for joint in robot.joints:
        if joint.name in names and robot.is_implied(joint.child):
            below, old = robot.children(joint.child)[0], joint.child
            joint.child = below.parent = f"{names[joint.name]}_link"
            robot.links = {joint.child if name == old else name: each for name, each in robot.links.items()}
            robot.links[joint.child].name = joint.child
    for tendon in robot.tendons:
        tendon.terms = {names.get(name, name): value for name, value in tendon.terms.items()}
    for equality in robot.equalities:
        if equality.kind == "joint":
            equality.first = names.get(equality.first, equality.first)
            equality.second = names.get(equality.second, equality.second)
    for key in robot.keyframes:
        key.q = {names.get(name, name): value for name, value in key.q.items()}
    on_joints: list[Actuator | Sensor] = [*robot.actuators, *robot.sensors]
    for each in on_joints:
        if not each.on_tendon:
            each.target = names.get(each.target, each.target)
    for joint in robot.joints:
        joint.name = names.get(joint.name, joint.name)
        if joint.mimic is not None:
            joint.mimic = (names.get(joint.mimic[0], joint.mimic[0]), *joint.mimic[1:])


def rename(it: Rewritten, rng: np.random.Generator, floating: bool) -> None:
    """Give every joint another name."""
    it.names = {joint.name: f"j_{joint.name}" for joint in it.robot.joints}
    rename_joints(it.robot, it.names)
    it.renamed = True


def _given(link: Link, mass: float, com: Matrix, tensor_at_com: Matrix) -> Inertial | None:
    """Return the inertia of a link with a body added (or taken, with a negative mass)."""
    own = link.inertial
    if own is None:
        return None
    total = own.mass + mass
    if total <= 0.0:
        return None
    centre = (own.mass * own.com + mass * com) / total
    tensor = own.tensor + shifted_tensor(own.mass, own.com - centre)
    tensor = tensor + tensor_at_com + shifted_tensor(mass, com - centre)
    values = np.linalg.eigvalsh(tensor)
    if values[0] <= 0.0 or values[2] > values[0] + values[1]:
        return None
    return Inertial(total, centre, tensor, own.frame)


def exchange_inertia(it: Rewritten, rng: np.random.Generator, floating: bool) -> None:
    """Move inertia that no state shows: mass on a revolute axis, a tensor across a slide, a fixed base."""
    robot = it.robot
    for joint in robot.joints:
        parent, child = robot.links[joint.parent], robot.links[joint.child]
        if joint.type == "fixed" or joint.mimic is not None:
            continue
        if child.inertial is None or parent.inertial is None or child.compensation != parent.compensation:
            continue
        if rng.random() < 0.5:
            continue
        T = joint.T
        if joint.type == "prismatic":
            values = rng.uniform(0.5, 1.0, 3) * 0.05 * max(np.linalg.eigvalsh(child.inertial.tensor)[0], 0.0)
            R = random_rotation(rng)
            tensor = R @ np.diag(values) @ R.T
            less = _given(child, 0.0, np.zeros(3), -tensor)
            more = _given(parent, 0.0, np.zeros(3), T[:3, :3] @ tensor @ T[:3, :3].T)
        elif joint.is_ball:
            mass = 0.03 * child.inertial.mass
            less = _given(child, -mass, np.zeros(3), np.zeros((3, 3)))
            more = _given(parent, mass, T[:3, 3], np.zeros((3, 3)))
        else:
            mass = 0.03 * child.inertial.mass
            along = float(child.inertial.com @ joint.axis) * rng.uniform(0.5, 1.5)
            across = 0.02 * max(np.linalg.eigvalsh(child.inertial.tensor)[0], 0.0)
            tensor = across * (np.eye(3) - np.outer(joint.axis, joint.axis))
            point = along * joint.axis
            less = _given(child, -mass, point, -tensor)
            more = _given(parent, mass, T[:3, :3] @ point + T[:3, 3], T[:3, :3] @ tensor @ T[:3, :3].T)
        if less is not None and more is not None:
            child.inertial, parent.inertial = less, more
    if not floating:
        for name in sorted(robot.body(robot.root)):
            link = robot.links[name]
            if link.inertial is not None and link.inertial.mass > 0.0 and rng.random() < 0.5:
                link.inertial = random_inertial(rng, 0.3)


REWRITES: dict[str, Callable[[Rewritten, np.random.Generator, bool], None]] = {
    "frames": move_frames,
    "inertia axes": turn_inertias,
    "split": split_links,
    "merge": merge_links,
    "reversed axes": reverse_axes,
    "null space": exchange_inertia,
    "zero poses of balls": turn_zero_poses,
    "offset links": offset_links,
    "exchanged ends": exchange_ends,
    "references": change_references,
    "names": rename,
}
MJCF_REWRITES = ("zero poses of balls", "offset links", "references")
"""Rewrites for which the text has to be MJCF."""


def draw_style(rng: np.random.Generator) -> Style:
    """Return how a text is written."""
    return Style(
        shuffle=np.random.default_rng(int(rng.integers(2**32))) if rng.random() < 0.5 else None,
        spelled=bool(rng.random() < 0.5),
        number=exponential if rng.random() < 0.3 else repr,
        degree=bool(rng.random() < 0.5),
        rotation=int(rng.integers(4)),
        classes=bool(rng.random() < 0.5),
        sites=bool(rng.random() < 0.3),
        free_joint=bool(rng.random() < 0.5),
        quat_scale=float(rng.choice([1.0, -1.0, 0.4, -3.0])),
        names=bool(rng.random() < 0.8),
        child_class=bool(rng.random() < 0.3),
        constraint_sites=bool(rng.random() < 0.3),
        general=bool(rng.random() < 0.3),
        frames=bool(rng.random() < 0.3),
        includes=bool(rng.random() < 0.25),
    )


def style_words(style: Style) -> list[str]:
    """Return the freedoms that a style uses, in words."""
    words = ["defaults spelled out" if style.spelled else "defaults removed"]
    words += ["order"] * (style.shuffle is not None) + ["degrees"] * style.degree
    words += ["no names"] * (not style.names)
    for name in ("includes", "general", "frames", "constraint_sites", "child_class"):
        words += [name] * getattr(style, name)
    return words


def fit_formats(robot: Robot, formats: set[Format]) -> str:
    """Remove from the robot what a format cannot say; return why it cannot be written at all."""
    if formats != {"mjcf"}:
        robot.exclusions, robot.contacts, robot.tendons, robot.equalities = [], [], [], []
        robot.keyframes, robot.actuators, robot.sensors = [], [], []
        for link in robot.links.values():
            link.compensation = 0.0
    for joint in robot.joints:
        if "urdf" in formats:
            joint.stiffness = joint.rest = 0.0
        if "sdf" in formats and joint.is_ball:
            joint.upper, joint.damping, joint.friction = None, 0.0, 0.0
        if formats != {"mjcf"}:
            joint.armature = 0.0
    if "urdf" in formats and any(joint.is_ball for joint in robot.joints):
        return "a ball joint"
    if formats == {"urdf"}:
        return ""
    for link in robot.links.values():
        link.shapes = [shape for shape in link.shapes if shape.kind != "mesh"]
    for joint in robot.joints:
        if joint.type in ("revolute", "prismatic") and (joint.lower or 0.0) >= (joint.upper or 0.0):
            return "a joint without range"
        if "mjcf" in formats:
            joint.velocity = None
            joint.effort = joint.effort or None
        if "sdf" in formats and joint.moves:
            joint.effort = joint.effort or 1.0
            joint.velocity = None if "mjcf" in formats else joint.velocity or 1.0
    return ""


def is_split(formats: tuple[Format, Format], style: Style) -> bool:
    """Check whether the text of the second robot is split into files."""
    return style.includes and formats[1] == "mjcf"


@dataclass(frozen=True)
class Row:
    """One seed: what was changed, what the comparison said, and what is true."""

    seed: int
    robot: str
    formats: str
    changes: str
    size: float
    expected: str
    outcome: str
    truth: str
    """Relative difference that engines see, or why they do not say."""
    seconds: float


def draw_formats(
    rng: np.random.Generator, pairs: Sequence[tuple[Format, Format]], weights: Sequence[float]
) -> tuple[Format, Format]:
    """Return the formats of A and B."""
    return pairs[int(rng.choice(len(pairs), p=np.array(weights) / sum(weights)))]


PAIRS: tuple[tuple[Format, Format], ...] = (
    ("urdf", "urdf"),
    ("urdf", "mjcf"),
    ("mjcf", "urdf"),
    ("mjcf", "mjcf"),
    ("urdf", "sdf"),
    ("sdf", "sdf"),
    ("sdf", "mjcf"),
)


def possible_formats(
    robot: Robot, pairs: Sequence[tuple[Format, Format]], weights: Sequence[float]
) -> tuple[list[tuple[Format, Format]], list[float]]:
    """Return the pairs that can state the joints of the robot, with their weights."""
    has_balls = any(joint.is_ball for joint in robot.joints)
    kept = [i for i, pair in enumerate(pairs) if not (has_balls and "urdf" in pair)]
    return [pairs[i] for i in kept], [weights[i] for i in kept]


def compare(
    a: str, b: str, base: str | None, tolerance: float | None, includes: bool = False
) -> tuple[Any, float]:
    """Return the report of dynx, and its time [s]; with `includes`, b is split into files."""
    if includes:
        with TemporaryDirectory() as folder:
            b, parts = split_file(b)
            for name, text in (*parts.items(), ("robot.xml", b)):
                (Path(folder) / name).write_text(text, encoding="utf-8")
            return compare(a, str(Path(folder) / "robot.xml"), base, tolerance)
    import dynx

    start = time.perf_counter()
    extra: dict[str, Any] = {} if tolerance is None else {"tolerance": tolerance}
    report = dynx.same_robot(a, b, base=base, **extra)  # type: ignore[arg-type]
    return report, time.perf_counter() - start


def attribute_words(report: Any) -> list[str]:
    """Return the attributes that a report lists, in short."""
    return [
        f"{each.kind} of {each.ours or each.theirs}: {each.first} | {each.second}"
        for each in report.attributes
    ]


def _is_altered(robot: Robot, formats: tuple[Format, Format], floating: bool, seed: int) -> bool:
    """Check whether an engine changes the robot itself as it loads the formats: MuJoCo drops inertial offsets
    below 1e-6, Drake replaces inertias that no body can have."""
    if any(joint.is_ball for joint in robot.joints):
        return False
    own = write_urdf(robot)
    return any(
        text_difference((robot, own, "urdf"), (robot, write(robot, to, floating), to), floating, seed)
        > ALTERED
        for to in formats
    )


def rewrite_row(seed: int) -> Row:
    """Return the row of a rewrite."""
    rng = np.random.default_rng([1, seed])
    while True:
        name, robot, text, floating = draw_robot(rng)
        pairs, weights = possible_formats(robot, PAIRS, (5, 2, 1, 4, 1.5, 0.5, 1))
        formats = draw_formats(rng, pairs, weights)
        if formats == ("mjcf", "mjcf"):
            if any(joint.mimic is not None for joint in robot.joints):
                continue
            decorate(robot, rng, floating)
        if fit_formats(robot, set(formats)):
            continue
        it = Rewritten(robot.copy())
        chosen = [each for each in REWRITES if rng.random() < (0.1 if each == "names" else 0.35)]
        if formats[1] != "mjcf":
            chosen = [each for each in chosen if each not in MJCF_REWRITES]
        for each in chosen:
            REWRITES[each](it, rng, floating)
        if formats[1] == "mjcf":
            align_chains(it)
        style = draw_style(rng)
        original = formats == ("urdf", "urdf") and text is not None and rng.random() < 0.6
        try:
            first = text if original and text is not None else write(robot, formats[0], floating)
            second = write(it.robot, formats[1], floating, style)
        except ValueError:
            continue
        break
    try:
        seen = text_difference(
            (robot, first, formats[0]),
            (it.robot, second, formats[1]),
            floating,
            seed,
            it.by,
        )
        truth = f"{seen:.1e}"
        if formats == ("mjcf", "mjcf"):
            coupled, most = coupling_difference((robot, first), (it.robot, second), floating, seed, it.by)
            if coupled > UNCOUPLED:
                seen, truth = np.inf, f"{coupled:.1e} {most}"
        wrong = seen > (DROPPED if "mjcf" in formats else ALTERED)
        if (
            wrong
            and np.isfinite(seen)
            and formats != ("urdf", "urdf")
            and _is_altered(robot, formats, floating, seed)
        ):
            own, other = write_urdf(robot), write_urdf(it.robot)
            seen = text_difference((robot, own, "urdf"), (it.robot, other, "urdf"), floating, seed, it.by)
            truth, wrong = f"{seen:.1e} in URDF", seen > ALTERED
    except Exception as error:  # an engine refuses the text: the robot is not checked
        truth, wrong = f"unchecked: {str(error).splitlines()[0][:80]}", False
    base = "floating" if floating else "fixed"
    seconds = 0.0
    b = without_names(second) if formats[1] == "mjcf" and not style.names else second
    if wrong:
        outcome = "generator wrong"
    else:
        try:
            report, seconds = compare(
                first, b, base if set(formats) == {"urdf"} else None, None, is_split(formats, style)
            )
            attributes = attribute_words(report)
            if it.renamed or not style.names:
                attributes = [each for each in attributes if not each.startswith("name of")]
            if not report.same or report.differences or report.unmatched:
                said = [
                    f"{each.tag} {each.theirs} {each.part} {each.size:.1e}" for each in report.differences
                ]
                said += [each.message for each in report.unmatched]
                outcome = "different: " + "; ".join(said)[:300]
            elif attributes:
                outcome = "attributes: " + "; ".join(attributes)[:300]
            else:
                outcome = "right"
        except Exception as error:
            outcome = f"error: {type(error).__name__}: {str(error)[:300]}"
    changes = ", ".join([*chosen, *style_words(style)])
    return Row(
        seed, f"{name} {base}", "-".join(formats), changes, 0.0, "same", outcome, truth, round(seconds, 3)
    )


def run(
    measure: Callable[[int], Row], seeds: Sequence[int], path: Path | None, jobs: int, limit: float
) -> list[Row]:
    """Return the rows of the seeds that were measured within `limit` seconds, and those of the record."""
    record: Record[Row] = Record(Row, lambda row: row.seed, path)
    start = time.monotonic()
    rows = []

    waiting = []
    for seed in seeds:
        row = record.known(seed)
        if row is None:
            waiting.append(seed)
        else:
            rows.append(row)
    with ProcessPoolExecutor(jobs) as pool:
        while waiting and time.monotonic() - start < limit:
            batch, waiting = waiting[: 4 * jobs], waiting[4 * jobs :]
            for row in pool.map(measure, batch):
                record.add(row)
                rows.append(row)
            tell(f"{len(rows)} of {len(seeds)}, {sum(not is_right(row) for row in rows)} not right")
    tell("")
    return rows


def is_right(row: Row) -> bool:
    """Whether the comparison said what is true."""
    return row.outcome.startswith("right")


def print_report(rows: Sequence[Row]) -> None:
    """Print counts by outcome, and every row that is not right."""
    for row in rows:
        if not is_right(row):
            print(f"seed {row.seed}, {row.robot}, {row.formats}, {row.changes}, size {row.size:.1e}")
            print(f"  truth {row.truth}")
            print(f"  expected {row.expected}\n  {row.outcome}")
    outcomes = Counter(row.outcome.split(":")[0] for row in rows)
    print(f"{len(rows)} rows: " + ", ".join(f"{count} {what}" for what, count in outcomes.most_common()))
    checked = sum(not row.truth.startswith("unchecked") for row in rows)
    print(f"{checked} checked by engines; robots: {len({row.robot.split()[0] for row in rows})}")
    print(
        "formats: "
        + ", ".join(f"{count} {what}" for what, count in Counter(row.formats for row in rows).most_common())
    )
    times = sorted(row.seconds for row in rows)
    if times:
        print(f"seconds: median {times[len(times) // 2]:.2f}, largest {times[-1]:.2f}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the seeds, print counts, and return 1 if a row is not right."""
    from benchmarks.surveys.same_plants import plant_row

    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=["rewrites", "planted"])
    parser.add_argument("seeds", help="first:end")
    parser.add_argument("--record", type=Path, help="file of rows; an interrupted run continues")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=1e9, help="no new seed after this time")
    parser.add_argument("--report", action="store_true", help="only print what the record holds")
    given = parser.parse_args(arguments)
    first, end = (int(each) for each in given.seeds.split(":"))
    measure = rewrite_row if given.what == "rewrites" else plant_row
    rows = run(measure, range(first, end), given.record, given.jobs, 0.0 if given.report else given.seconds)
    print_report(rows)
    return int(not all(is_right(row) for row in rows))


__all__ = ["REWRITES", "TOLERANCE", "Rewritten", "Row", "compare", "line_difference", "main", "write_urdf"]

if __name__ == "__main__":
    sys.exit(main())
