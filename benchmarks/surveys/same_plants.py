"""Planted differences of 86 kinds for the survey of ``dynx same``, and the elements they change."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.surveys.robot_texts import (
    Format,
    Inertial,
    Joint,
    Link,
    Robot,
    Shape,
    axis_angle,
    inverse,
    pose,
    rotation_from_rpy,
    split_file,
    write,
)
from benchmarks.surveys.robot_truth import line_difference, text_difference
from benchmarks.surveys.same_rewrites import (
    TOLERANCE,
    Rewritten,
    Row,
    align_chains,
    attribute_words,
    change_references,
    compare,
    decorate,
    draw_formats,
    draw_robot,
    draw_style,
    fit_formats,
    is_split,
    move_frames,
    offset_links,
    possible_formats,
    random_inertial,
    rename_joints,
    reverse_axes,
    style_words,
    turn_inertias,
    turn_zero_poses,
)


@dataclass
class Planted:
    """Where a difference was planted: names of the element, and what the report is to call it.

    `part` is a part of an element, "attribute KIND", "unmatched", or "nothing" where the robot is the same.
    """

    part: str
    names: set[str]
    inertial: bool = False
    """Whether inertias or joint lines change by the size, so that the null space decides."""


class NotHereError(Exception):
    """The robot has no place for the difference."""


Plant = Callable[[Robot, np.random.Generator, float], Planted]
PLANTS: dict[str, tuple[Plant, tuple[Format, ...]]] = {}
EVERYWHERE: tuple[Format, ...] = ("urdf", "mjcf", "sdf")


def plant(kind: str, formats: tuple[Format, ...] = EVERYWHERE) -> Callable[[Plant], Plant]:
    """Register a kind of difference, with the formats that can say it."""

    def register(function: Plant) -> Plant:
        PLANTS[kind] = (function, formats)
        return function

    return register


def _pick(rng: np.random.Generator, items: list[Any]) -> Any:
    if not items:
        raise NotHereError
    return items[int(rng.integers(len(items)))]


def _heavy(robot: Robot, rng: np.random.Generator) -> tuple[Link, Inertial, float, float]:
    """Return a link with mass, its inertia, and the mass and the largest central moment of its body."""
    link = _pick(
        rng, [each for each in robot.links.values() if each.inertial is not None and each.inertial.mass > 0.0]
    )
    body = robot.body_inertial(link.name)
    assert body is not None
    largest = float(np.max(np.abs(np.linalg.eigvalsh(body.tensor))))
    if largest <= 0.0:
        raise NotHereError
    return link, link.inertial, body.mass, largest


@plant("mass")
def _mass(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    link, own, mass, _ = _heavy(robot, rng)
    own.mass += size * mass
    return Planted("inertial", {link.name}, True)


def _centre(i: int) -> Plant:
    def change(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
        link, own, mass, largest = _heavy(robot, rng)
        own.com = own.com + own.frame[:, i] * size * np.sqrt(mass * largest) / own.mass
        return Planted("inertial", {link.name}, True)

    return change


def _moment(i: int, j: int) -> Plant:
    def change(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
        link, own, _, largest = _heavy(robot, rng)
        E = np.zeros((3, 3))
        E[i, j] = E[j, i] = size * largest
        own.tensor = own.tensor + own.frame @ E @ own.frame.T
        return Planted("inertial", {link.name}, True)

    return change


for _i in range(3):
    plant(f"centre {'xyz'[_i]}")(_centre(_i))
    for _j in range(_i, 3):
        plant(f"moment {'xyz'[_i]}{'xyz'[_j]}")(_moment(_i, _j))


@plant("inertia axes")
def _inertia_axes(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    link, own, _, _ = _heavy(robot, rng)
    axis = rng.normal(size=3)
    R = axis_angle(axis / np.linalg.norm(axis), size)
    own.tensor = R @ own.tensor @ R.T
    return Planted("inertial", {link.name}, True)


@plant("axis")
def _axis(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    joint = _pick(rng, [each for each in robot.joints if each.moves])
    side = np.cross(joint.axis, rng.normal(size=3))
    joint.axis = axis_angle(side / np.linalg.norm(side), size) @ joint.axis
    return Planted("axis", {joint.name}, True)


def _origin(i: int, turn: bool) -> Plant:
    def change(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
        fixed = rng.random() < 0.2
        joint = _pick(rng, [each for each in robot.joints if (each.type == "fixed") == fixed])
        if not joint.moves and joint.type != "fixed":
            raise NotHereError
        E = np.eye(3)[i] * size
        joint.T = joint.T @ pose(rotation_from_rpy(E)) if turn else pose(None, E * robot.reach) @ joint.T
        names = {joint.name, f"{joint.child}_fixed", joint.child}
        if any(robot.is_implied(each) for each in (joint.parent, joint.child)):
            names |= {name for each in robot.chain(joint) for name in (each.name, each.child)}
        above = robot.above(joint.parent)
        if above is not None and robot.is_implied(joint.parent):
            names.add(f"{above.name}_fixed")  # its name from SDF, where the joint has a place in the link
        only_frame = all(robot.links[each].is_empty for each in robot.below(joint))
        if only_frame and fixed and not any(robot.above(each).moves for each in robot.below(joint)):  # type: ignore[union-attr]
            return Planted("attribute frame", names | robot.below(joint))
        return Planted("origin", names, True)

    return change


for _i in range(3):
    plant(f"origin {'xyz'[_i]}")(_origin(_i, False))
    plant(f"origin {('roll', 'pitch', 'yaw')[_i]}")(_origin(_i, True))


@plant("joint type")
def _type(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    followed = {each.mimic[0] for each in robot.joints if each.mimic is not None}
    joint = _pick(
        rng,
        [each for each in robot.joints if each.moves and each.mimic is None and each.name not in followed],
    )
    if joint.type == "prismatic":
        joint.type = "revolute"
    else:
        joint.type = "prismatic" if rng.random() < 0.7 else "fixed"
        if joint.type == "prismatic" and joint.lower is None:
            joint.lower, joint.upper = -1.0, 1.0
    return Planted("type", {joint.name, joint.child, f"{joint.child}_fixed"})


NO_LIMIT = 1e16
"""Number from which on a limit limits nothing, as SDF has it."""


def _limit(name: str, kind: str) -> Plant:
    def change(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
        joint = _pick(
            rng,
            [
                each
                for each in robot.joints
                if each.moves and 0.0 < abs(getattr(each, name) or 0.0) < NO_LIMIT
            ],
        )
        value = getattr(joint, name)
        outwards = -1.0 if name == "lower" else 1.0
        setattr(joint, name, value + outwards * size * abs(value))
        return Planted(f"attribute {kind}", {joint.name})

    return change


for _name, _kind in (("lower", "lower limit"), ("upper", "upper limit"), ("effort", "effort limit")):
    plant(_kind)(_limit(_name, _kind))
plant("velocity limit", ("urdf", "sdf"))(_limit("velocity", "velocity limit"))


def _dynamics(name: str) -> Plant:
    def change(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
        joint = _pick(rng, [each for each in robot.joints if each.moves])
        value = float(getattr(joint, name))
        setattr(joint, name, value + size * (value or 1.0))
        return Planted(f"attribute {name}", {joint.name})

    return change


plant("damping")(_dynamics("damping"))
plant("friction")(_dynamics("friction"))
plant("armature", ("mjcf",))(_dynamics("armature"))


def _mimic(offset: bool) -> Plant:
    def change(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
        joint = _pick(rng, [each for each in robot.joints if each.moves and each.mimic is not None])
        leader, m, o = joint.mimic
        joint.mimic = (leader, m, o + size) if offset else (leader, m + size * (abs(m) or 1.0), o)
        return Planted("mimic", {joint.name})

    return change


plant("mimic factor", ("urdf", "sdf"))(_mimic(False))
plant("mimic offset", ("urdf", "sdf"))(_mimic(True))


@plant("mimic leader", ("urdf", "sdf"))
def _mimic_leader(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    joint = _pick(rng, [each for each in robot.joints if each.moves and each.mimic is not None])
    leader, m, o = joint.mimic
    others = [each.name for each in robot.joints if each.moves and each.mimic is None and each.name != leader]
    joint.mimic = (_pick(rng, others), m, o)
    return Planted("mimic", {joint.name})


@plant("mimic missing", ("urdf", "sdf"))
def _mimic_missing(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    joint = _pick(rng, [each for each in robot.joints if each.moves and each.mimic is not None])
    joint.mimic = None
    return Planted("mimic", {joint.name})


def _shape(robot: Robot, rng: np.random.Generator, kinds: tuple[str, ...]) -> tuple[Link, Shape, str]:
    found = [(link, shape) for link in robot.links.values() for shape in link.shapes if shape.kind in kinds]
    link, shape = _pick(rng, found)
    return link, shape, "attribute visual shapes" if shape.visual else "attribute collision shapes"


@plant("shape size")
def _shape_size(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    link, shape, kind = _shape(robot, rng, ("box", "sphere", "cylinder", "mesh"))
    sizes = list(shape.size)
    i = int(rng.integers(len(sizes)))
    sizes[i] *= 1.0 + size
    shape.size = tuple(sizes)
    return Planted(kind, robot.body(link.name))


@plant("shape pose")
def _shape_pose(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    link, shape, kind = _shape(robot, rng, ("box", "sphere", "cylinder", "mesh"))
    if shape.kind == "sphere" or rng.random() < 0.5:
        shape.T = pose(None, np.eye(3)[rng.integers(3)] * size * robot.reach) @ shape.T
    else:  # about x, which turns a cylinder as well
        shape.T = shape.T @ pose(axis_angle(np.array([1.0, 0.0, 0.0]), size))
    return Planted(kind, robot.body(link.name))


@plant("shape kind")
def _shape_kind(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    link, shape, kind = _shape(robot, rng, ("box", "sphere", "cylinder"))
    shape.kind, shape.size = {
        "box": ("cylinder", (shape.size[0] / 2, shape.size[-1])),
        "sphere": ("box", (shape.size[0] * 2,) * 3),
        "cylinder": ("box", (shape.size[0] * 2, shape.size[0] * 2, shape.size[-1])),
    }[shape.kind]
    return Planted(kind, robot.body(link.name))


@plant("shape missing")
def _shape_missing(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    link, shape, kind = _shape(robot, rng, ("box", "sphere", "cylinder", "mesh"))
    link.shapes = [each for each in link.shapes if each is not shape]
    return Planted(kind, robot.body(link.name))


@plant("mesh file", ("urdf",))
def _mesh_file(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    link, shape, kind = _shape(robot, rng, ("mesh",))
    path, _, end = shape.file.rpartition(".")
    shape.file = f"{path}_other.{end}"
    return Planted(kind, robot.body(link.name))


def _beside(robot: Robot, name: str) -> set[str]:
    """Return the links of the bodies that a joint connects with that of a link."""
    own = robot.body(name)
    found: set[str] = set()
    for joint in robot.joints:
        if joint.type != "fixed" and (joint.parent in own or joint.child in own):
            found |= robot.body(joint.parent) | robot.body(joint.child)
    return found


@plant("contact filter", ("mjcf",))
def _filter(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    if rng.random() < 0.5:
        names = [name for name, link in robot.links.items() if any(not each.visual for each in link.shapes)]
        # MuJoCo tests no shapes of one body, or of two that a joint connects: a filter is nothing there.
        apart = {name: robot.body(name) | _beside(robot, name) for name in names}
        there = [set(pair) for pair in robot.exclusions]
        # Nor does it filter the shapes of a contact pair.
        paired = [{id(one), id(two)} for one, two in robot.contacts]
        pairs = [
            (a, b)
            for a in names
            for b in names
            if a < b and b not in apart[a] and "world" not in (a, b) and {a, b} not in there
            if any(
                {id(one), id(two)} not in paired
                for one in robot.links[a].shapes
                for two in robot.links[b].shapes
                if not (one.visual or two.visual)
            )
        ]
        pair = _pick(rng, pairs)
        robot.exclusions.append(pair)
        return Planted("attribute contact filter", set(pair))
    found = [(link, each) for link in robot.links.values() for each in link.shapes if not each.visual]
    link, shape = _pick(rng, found)
    shape.filter = 3
    return Planted("attribute contact filter", robot.body(link.name))


@plant("actuator gear", ("mjcf",))
def _gear(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    joint = _pick(rng, [each for each in robot.joints if each.moves])
    joint.gear = 1.0 + size
    return Planted("attribute actuator", {joint.name, "motor_" + joint.name})


@plant("contact pair", ("mjcf",))
def _contact_pair(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    """Let shapes touch that MuJoCo does not test otherwise: those of two links that a joint connects."""
    found = []
    for joint in robot.joints:
        above, below = robot.links[joint.parent], robot.links[joint.child]
        first = [each for each in above.shapes if not each.visual]
        second = [each for each in below.shapes if not each.visual]
        known = [{id(one), id(two)} for one, two in robot.contacts]
        if first and second and {id(first[0]), id(second[0])} in known:
            continue
        if joint.type != "fixed" and first and second and not robot.is_static(joint.parent):
            found.append((joint, first[0], second[0]))
    joint, *shapes = _pick(rng, found)
    robot.contacts.append((shapes[0], shapes[1]))
    return Planted("attribute contact filter", robot.body(joint.parent) | robot.body(joint.child))


@plant("joint point", ("mjcf",))
def _joint_point(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    """Move a joint in its body, which stays: `pos` of a joint of MJCF."""
    joint = _pick(
        rng, [each for each in robot.joints if each.type != "fixed" and robot.is_implied(each.child)]
    )
    below = robot.children(joint.child)[0]
    d = rng.normal(size=3)
    d *= size * robot.reach / np.linalg.norm(d)
    joint.T, below.T = joint.T @ pose(None, d), pose(None, -d) @ below.T
    names = {name for each in robot.chain(joint) for name in (each.name, each.child)}
    return Planted("origin", names, True)


@plant("ball centre", ("mjcf", "sdf"))
def _ball_centre(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    joint = _pick(rng, [each for each in robot.joints if each.is_ball])
    joint.T = pose(None, np.eye(3)[rng.integers(3)] * size * robot.reach) @ joint.T
    return Planted("origin", {joint.name, joint.child}, True)


@plant("ball zero pose", ("mjcf",))
def _ball_zero_pose(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    """Turn the zero pose of a ball joint, and keyframes back: only a limit is another one then."""
    found = [each for each in robot.joints if each.is_ball and not robot.is_implied(each.parent)]
    if robot.has_connect:
        raise NotHereError
    joint = _pick(rng, found)
    axis = rng.normal(size=3)
    R = axis_angle(axis / np.linalg.norm(axis), size)
    joint.T = joint.T @ pose(R)
    Rewritten(robot).turn_ball(joint.name, R, np.eye(3))
    return Planted("nothing" if joint.upper is None else "attribute upper limit", {joint.name})


def _ball_value(name: str, kind: str) -> Plant:
    def change(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
        joint = _pick(rng, [each for each in robot.joints if each.is_ball])
        value = getattr(joint, name)
        if value is None:
            raise NotHereError
        setattr(joint, name, value + size * (value or 1.0))
        return Planted(f"attribute {kind}", {joint.name})

    return change


plant("ball range", ("mjcf",))(_ball_value("upper", "upper limit"))
for _name in ("damping", "friction", "armature"):
    plant(f"ball {_name}", ("mjcf",))(_ball_value(_name, _name))


def _spring(name: str, kind: str) -> Plant:
    def change(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
        joint = _pick(rng, [each for each in robot.joints if each.moves and each.stiffness])
        setattr(joint, name, getattr(joint, name) + size)
        return Planted(f"attribute {kind}", {joint.name})

    return change


plant("stiffness", ("mjcf", "sdf"))(_spring("stiffness", "stiffness"))
plant("spring reference", ("mjcf", "sdf"))(_spring("rest", "spring reference"))


def _interval(given: tuple[float, float], rng: np.random.Generator, size: float) -> tuple[float, float]:
    """Return an interval with one end moved outwards."""
    low, high = given
    width = size * (high - low)
    return (low - width, high) if rng.random() < 0.5 else (low, high + width)


def _tendon_value(name: str) -> Plant:
    def change(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
        tendon = _pick(rng, robot.tendons)
        if name == "range":
            if tendon.range is None:
                raise NotHereError
            tendon.range = _interval(tendon.range, rng, size)
        elif name == "coefficient":
            joint = _pick(rng, list(tendon.terms))
            tendon.terms[joint] *= 1.0 + size
        elif name == "member":
            others = [each.name for each in robot.joints if each.moves and each.name not in tendon.terms]
            coefficient = tendon.terms.pop(_pick(rng, list(tendon.terms)))
            tendon.terms[_pick(rng, others)] = coefficient
        else:
            value = getattr(tendon, name)
            setattr(tendon, name, value + size * (value or 1.0))
        return Planted("attribute tendon", {tendon.name})

    return change


for _name in ("coefficient", "member", "range", "stiffness", "rest", "damping", "friction"):
    plant(f"tendon {_name}", ("mjcf",))(_tendon_value(_name))


@plant("tendon missing", ("mjcf",))
def _tendon_missing(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    used = {each.target for each in robot.actuators if each.on_tendon}
    used |= {sensor.target for sensor in robot.sensors if sensor.on_tendon}
    used |= {name for each in robot.equalities if each.kind == "tendon" for name in (each.first, each.second)}
    tendon = _pick(rng, [each for each in robot.tendons if each.name not in used])
    robot.tendons.remove(tendon)
    return Planted("attribute tendon", {tendon.name})


def _equality_value(name: str, kinds: tuple[str, ...]) -> Plant:
    def change(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
        each = _pick(rng, [each for each in robot.equalities if each.kind in kinds])
        d = rng.normal(size=3)
        d /= np.linalg.norm(d)
        if each.is_closed and name in ("point", "attitude"):
            robot.close_weld(each)
            each.is_closed = False
        if name == "anchor":
            each.anchor = each.anchor + size * robot.reach * d
        elif name == "point":
            each.T = pose(None, size * robot.reach * d) @ each.T
        elif name == "attitude":
            each.T = each.T @ pose(axis_angle(d, size))
        elif name == "torque scale":
            each.torque_scale *= 1.0 + size
        elif name == "polynomial":
            degree = rng.integers(5 if each.second else 1)
            change = np.eye(5)[degree] * size * (np.max(np.abs(each.polynomial)) or 1.0)
            each.polynomial = each.polynomial + change
        elif name == "softness":
            each.time_constant *= 1.0 + size
        elif name == "link":
            own = robot.body(each.first) | robot.body(each.second)
            heavy = [name for name, link in robot.links.items() if not link.is_empty and name != "world"]
            each.second = _pick(rng, [name for name in heavy if name not in own])
        else:
            each.active = not each.active
        return Planted("attribute equality", {each.name})

    return change


_ALL_KINDS = ("connect", "weld", "joint", "tendon")
for _name, _kinds in (
    ("anchor", ("connect", "weld")),
    ("point", ("weld",)),
    ("attitude", ("weld",)),
    ("torque scale", ("weld",)),
    ("polynomial", ("joint", "tendon")),
    ("softness", _ALL_KINDS),
    ("link", ("connect", "weld")),
    ("activity", _ALL_KINDS),
):
    plant(f"equality {_name}", ("mjcf",))(_equality_value(_name, _kinds))


@plant("equality missing", ("mjcf",))
def _equality_missing(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    missing = _pick(rng, robot.equalities)
    robot.equalities = [each for each in robot.equalities if each is not missing]
    return Planted("attribute equality", {missing.name})


@plant("keyframe position", ("mjcf",))
def _keyframe_position(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    key = _pick(rng, robot.keyframes)
    joint = _pick(rng, [each for each in robot.joints if each.moves])
    key.q[joint.name] += size * (robot.reach if joint.type == "prismatic" else 1.0)
    return Planted("attribute configuration", {key.name})


@plant("keyframe attitude", ("mjcf",))
def _keyframe_attitude(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    key, joint = _pick(rng, robot.keyframes), _pick(rng, [each for each in robot.joints if each.is_ball])
    axis = rng.normal(size=3)
    key.q[joint.name] = key.q[joint.name] @ axis_angle(axis / np.linalg.norm(axis), size)
    return Planted("attribute configuration", {key.name})


@plant("keyframe base", ("mjcf",))
def _keyframe_base(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    # Keyframes of a fixed base have the pose of no base.
    key = _pick(rng, [each for each in robot.keyframes if np.any(each.T_world_root != np.eye(4))])
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    turns = rng.random() < 0.5
    key.T_world_root = key.T_world_root @ pose(
        axis_angle(axis, size) if turns else None, None if turns else size * robot.reach * axis
    )
    return Planted("attribute configuration", {key.name})


@plant("keyframe missing", ("mjcf",))
def _keyframe_missing(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    key = _pick(rng, robot.keyframes)
    robot.keyframes = [each for each in robot.keyframes if each is not key]
    return Planted("attribute configuration", {key.name})


def _actuator_value(name: str) -> Plant:
    def change(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
        actuator = _pick(rng, robot.actuators)
        names = {actuator.name, actuator.target}
        if name.endswith("range"):
            attribute = name.replace(" ", "_")
            if getattr(actuator, attribute) is None:
                raise NotHereError
            setattr(actuator, attribute, _interval(getattr(actuator, attribute), rng, size))
        elif name == "target":
            joints = [each.name for each in robot.joints if each.moves]
            taken = [each.name for each in robot.tendons] if actuator.on_tendon else joints
            actuator.target = _pick(rng, [each for each in taken if each != actuator.target])
            names.add(actuator.target)
        elif name == "missing":
            robot.actuators = [each for each in robot.actuators if each is not actuator]
        elif name == "gain" and actuator.kind == "motor":
            raise NotHereError
        else:
            setattr(actuator, name, getattr(actuator, name) * (1.0 + size))
        return Planted("attribute actuator", names)

    return change


for _name in ("gain", "gear", "ctrl range", "force range", "target", "missing"):
    plant(f"actuator {_name} of a servo", ("mjcf",))(_actuator_value(_name))


@plant("gravity compensation", ("mjcf",))
def _compensation(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    link, _, _, _ = _heavy(robot, rng)
    if robot.is_static(link.name) or link.inertial is None or link.inertial.mass < size:
        raise NotHereError
    link.compensation += size
    return Planted("attribute gravity compensation", robot.body(link.name))


def _sensor_value(name: str) -> Plant:
    def change(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
        sensor = _pick(rng, robot.sensors)
        names = {sensor.name, sensor.target}
        if name == "missing":
            robot.sensors = [each for each in robot.sensors if each is not sensor]
        elif name == "target":
            types = {"joint": "moves", "ballq": "is_ball", "balla": "is_ball"}
            if sensor.on_tendon:
                raise NotHereError
            found = [each.name for each in robot.joints if getattr(each, types[sensor.kind[:5]])]
            sensor.target = _pick(rng, [each for each in found if each != sensor.target])
        elif not getattr(sensor, name):
            raise NotHereError
        else:
            setattr(sensor, name, getattr(sensor, name) * (1.0 + size))
        return Planted("attribute sensor", names | {sensor.target})

    return change


for _name in ("cutoff", "noise", "target", "missing"):
    plant(f"sensor {_name}", ("mjcf",))(_sensor_value(_name))


@plant("link missing")
def _missing(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    followed = {each.mimic[0] for each in robot.joints if each.mimic is not None}
    joint = _pick(
        rng,
        [
            each
            for each in robot.joints
            if each.moves and each.name not in followed and not robot.children(each.child)
        ],
    )
    if sum(each.moves for each in robot.joints) < 2:
        raise NotHereError
    robot.joints = [each for each in robot.joints if each is not joint]
    del robot.links[joint.child]
    return Planted("unmatched", {joint.name})


@plant("link added")
def _added(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    parent = _pick(rng, [name for name in robot.links if name != "world" and not robot.links[name].is_empty])
    robot.links["planted"] = Link("planted", random_inertial(rng, 0.1))
    T = pose(None, rng.uniform(-0.2, 0.2, 3))
    robot.joints.append(
        Joint("planted_joint", "revolute", parent, "planted", T, np.eye(3)[2], -1.0, 1.0, 1.0, 1.0)
    )
    return Planted("unmatched", {"planted_joint"})


@plant("held link missing")
def _held_missing(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    found = []
    for each in robot.joints:
        own = robot.links[each.child].inertial
        if each.type == "fixed" and own is not None and own.mass > 0.0 and not robot.children(each.child):
            found.append(each)
    joint = _pick(rng, found)
    names = robot.body(joint.child)
    robot.joints = [each for each in robot.joints if each is not joint]
    del robot.links[joint.child]
    return Planted("inertial", names, True)


@plant("parent exchanged")
def _parent(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    joint = _pick(rng, [each for each in robot.joints if each.moves])
    taken = robot.below(joint) | robot.body(joint.parent)
    parent = _pick(
        rng, [name for name, link in robot.links.items() if name not in taken and not link.is_empty]
    )
    poses = robot.poses()
    joint.T = inverse(poses[parent]) @ poses[joint.child]
    joint.parent = parent
    return Planted("unmatched", {joint.name})


@plant("joint name")
def _joint_name(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    joint = _pick(rng, [each for each in robot.joints if each.moves])
    old = joint.name
    # A link that MJCF implies is called for its joint, and has that name in URDF and SDF.
    links = {joint.child} if robot.is_implied(joint.child) else set()
    rename_joints(robot, {old: "renamed_joint"})
    links |= {joint.child} if links else set()
    return Planted("attribute name", {old, joint.name} | links)


@plant("link name")
def _link_name(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    name = _pick(rng, [each for each, link in robot.links.items() if each != "world" and not link.is_empty])
    robot.links = {("renamed_link" if each == name else each): link for each, link in robot.links.items()}
    robot.links["renamed_link"].name = "renamed_link"
    for joint in robot.joints:
        joint.parent = "renamed_link" if joint.parent == name else joint.parent
        joint.child = "renamed_link" if joint.child == name else joint.child
    names = {name: "renamed_link"}
    robot.exclusions = [(names.get(a, a), names.get(b, b)) for a, b in robot.exclusions]
    for each in robot.equalities:
        each.first, each.second = names.get(each.first, each.first), names.get(each.second, each.second)
    return Planted("attribute name", {name, "renamed_link"})


@plant("frame place")
def _frame(robot: Robot, rng: np.random.Generator, size: float) -> Planted:
    found = [each for each in robot.joints if each.type == "fixed" and robot.links[each.child].is_empty]
    joint = _pick(rng, [each for each in found if not robot.children(each.child)])
    joint.T = pose(None, np.eye(3)[rng.integers(3)] * size * robot.reach) @ joint.T
    return Planted("attribute frame", {joint.child, joint.name})


def seen_size(before: Robot, after: Robot, floating: bool, seed: int) -> tuple[float, float]:
    """Return the difference that an engine sees, and that of the joint lines.

    The engine is MuJoCo if a joint is a ball joint, else Pinocchio.
    """
    to: Format = "mjcf" if any(joint.is_ball for joint in before.joints) else "urdf"
    it = Rewritten(after.copy())
    if to == "mjcf":
        align_chains(it)
    texts = write(before, to, floating), write(it.robot, to, floating)
    seen = text_difference((before, texts[0], to), (it.robot, texts[1], to), floating, seed, it.by)
    return seen, line_difference(before, after)


PAIRS: tuple[tuple[Format, Format], ...] = (
    ("urdf", "urdf"),
    ("mjcf", "mjcf"),
    ("sdf", "sdf"),
    ("urdf", "mjcf"),
    ("urdf", "sdf"),
    ("mjcf", "urdf"),
    ("mjcf", "sdf"),
    ("sdf", "mjcf"),
)
CHANGES_OF_JOINTS = ("joint type", "link missing", "link added", "held link missing", "parent exchanged")
"""Kinds that need a robot whose joints and links nothing else names."""
SEEN = 1e-10
"""Relative change of torques or joint lines from which a difference is to be found."""
AMPLIFIED = 1e-2
"""Size of a change from which the differences of a smaller one follow."""
NULL = 1e-11
"""Change that a difference of size `AMPLIFIED` in the null space has at most: rounding of the engines."""


def plant_row(seed: int) -> Row:
    """Return the row of a planted difference; the kind goes round with the seed."""
    rng = np.random.default_rng([2, seed])
    kind = list(PLANTS)[seed % len(PLANTS)]
    change, possible = PLANTS[kind]
    while True:
        name, robot, text, floating = draw_robot(rng)
        pairs = [pair for pair in PAIRS if set(pair) <= set(possible)]
        weights = [
            {("urdf", "urdf"): 6.0, ("mjcf", "mjcf"): 1.5, ("sdf", "sdf"): 1.0}.get(pair, 0.7)
            for pair in pairs
        ]
        pairs, weights = possible_formats(robot, pairs, weights)
        if not pairs:
            continue
        formats = draw_formats(rng, pairs, weights)
        if formats == ("mjcf", "mjcf"):
            if any(joint.mimic is not None for joint in robot.joints):
                continue
            if kind not in CHANGES_OF_JOINTS:
                decorate(robot, rng, floating)
        if fit_formats(robot, set(formats)):
            continue
        if kind == "actuator gear":
            for joint in robot.joints:
                joint.gear = 1.0 if joint.moves else None
        size = float(10.0 ** rng.uniform(-9, 0))
        draws = int(rng.integers(2**32))
        after = robot.copy()
        try:
            planted = change(after, np.random.default_rng(draws), size)
        except NotHereError:
            continue
        it = Rewritten(after.copy())
        freedoms = [move_frames, turn_inertias, reverse_axes]
        if formats[1] == "mjcf":
            freedoms += [turn_zero_poses, offset_links, change_references]
        steps = [step for step in freedoms if rng.random() < 0.25]
        if kind in ("link missing", "link added"):
            steps = []
        if kind in ("joint type", "axis"):
            # A frame that was moved across a slide would not lie on the axis of the joint that turns, nor one
            # that was moved along a turned axis on the right one: then one element does not mend the robot.
            steps = [step for step in steps if step not in (move_frames, offset_links)]
        for step in steps:
            step(it, rng, floating)
        if formats[1] == "mjcf":
            align_chains(it)
        style = draw_style(rng)
        original = formats == ("urdf", "urdf") and text is not None and rng.random() < 0.6
        try:
            first = text if original and text is not None else write(robot, formats[0], floating)
            second = write(it.robot, formats[1], floating, style)
        except ValueError:
            continue
        truth, expected = "stated", planted.part
        if planted.inertial and kind != "held link missing":
            try:  # amplified, so that rounding does not hide which space it is in
                seen, moved, amplified = _extrapolated(robot, change, draws, size, floating, seed)
                truth = f"torque {seen:.1e}, lines {moved:.1e}"
                if amplified < NULL:
                    expected = "null space"
                elif max(seen, moved) < SEEN:
                    continue  # below what has to be found
            except Exception as error:
                if any(joint.is_ball for joint in robot.joints):
                    continue  # MuJoCo refuses inertias that no body can have
                truth = f"unchecked: {str(error).splitlines()[0][:80]}"
        elif planted.inertial:
            try:
                seen = _held_size(robot, after, floating, seed)
                truth = f"torque {seen:.1e}"
                if seen < 1e-12:
                    expected = "null space"
                elif seen < SEEN:
                    continue
            except Exception as error:
                truth = f"unchecked: {str(error).splitlines()[0][:80]}"
        break
    base = "floating" if floating else "fixed"
    seconds = 0.0
    try:
        report, seconds = compare(
            first, second, base if set(formats) == {"urdf"} else None, TOLERANCE, is_split(formats, style)
        )
        outcome = judged(
            report,
            planted,
            expected,
            (robot, first, formats[0]),
            (after, it),
            second,
            is_split(formats, style),
            formats[1],
            floating,
            seed,
        )
    except Exception as error:
        outcome = f"error: {type(error).__name__}: {str(error)[:300]}"
    words = ", ".join([kind, *(step.__name__ for step in steps), *style_words(style)])
    return Row(
        seed,
        f"{name} {base}",
        "-".join(formats),
        words,
        size,
        f"{expected} {sorted(planted.names)[:4]}",
        outcome,
        truth,
        round(seconds, 3),
    )


def _extrapolated(
    robot: Robot, change: Plant, draws: int, size: float, floating: bool, seed: int
) -> tuple[float, float, float]:
    """Return the differences of torques and of joint lines that a change of `size` makes, and the larger one
    of a change of `AMPLIFIED` at least.

    Torques may change by the square of the size: where an inertia is turned whose principal axis is the
    axis of the joint, or a centre of mass is moved along the joint.
    """

    def seen_at(amount: float) -> tuple[float, float]:
        after = robot.copy()
        change(after, np.random.default_rng(draws), amount)
        return seen_size(robot, after, floating, seed)

    seen, moved = seen_at(max(size, AMPLIFIED))
    ratio = min(size / AMPLIFIED, 1.0)
    order = 1
    if ratio < 1.0 and seen > NULL:
        order = 1 + (seen_at(AMPLIFIED / 10.0)[0] < seen / 30.0)
    return seen * ratio**order, moved * ratio, max(seen, moved)


def _held_size(before: Robot, after: Robot, floating: bool, seed: int) -> float:
    return seen_size(before, after, floating, seed)[0]


TAGS = {
    "tendon": ("fixed",),
    "equality": ("connect", "weld", "joint", "tendon"),
    "configuration": ("key",),
    "actuator": ("motor", "position", "velocity", "general"),
}
"""Elements of MJCF by the kind of an attribute."""


def is_at_its_line(attribute: Any, text: str, includes: bool) -> bool:
    """Check that the line of an attribute is one of the element that it names, if that is one of `TAGS`."""
    if includes:
        text, parts = split_file(text)
        text = parts.get(Path(attribute.second_file or "").name, text)
    rows = text.splitlines()
    if (
        attribute.second == "none"
        or attribute.kind not in TAGS
        or attribute.theirs is None
        or attribute.second_line is None
    ):
        return True
    if attribute.second_line > len(rows):
        return False
    found = re.match(r"\s*<(\w+)", rows[attribute.second_line - 1])
    names = f'"{attribute.theirs}"' in rows[attribute.second_line - 1]
    return found is not None and found[1] in TAGS[attribute.kind] and names


def judged(
    report: Any,
    planted: Planted,
    expected: str,
    a: tuple[Robot, str, Format],
    b: tuple[Robot, Rewritten],
    b_text: str,
    includes: bool,
    to: Format,
    floating: bool,
    seed: int,
) -> str:
    """Return "right", or in which way the report is not."""
    elements = [
        f"{each.tag} {each.ours}/{each.theirs} {each.part} {each.size:.1e}" for each in report.differences
    ]
    unmatched = [f"{each.kind} {each.ours}/{each.theirs}" for each in report.unmatched]
    attributes = attribute_words(report)
    told = "; ".join([*elements, *unmatched, *attributes])[:600] or "nothing"
    if expected == "nothing":
        return "right" if report.same and not (elements or unmatched or attributes) else f"false: {told}"
    if expected == "null space":
        if report.same and not elements and not unmatched:
            return "right (null space)"
        places = [
            {each.ours, each.theirs} & planted.names for each in report.differences if each.part == "origin"
        ]
        if planted.part == "origin" and len(elements) == 1 and any(places) and not unmatched:
            return "right (no torque shows it; the joint's place is named)"
        return f"false: {told}"
    if expected.startswith("attribute"):
        kind = expected.removeprefix("attribute ")
        kinds = (
            {kind, "upper limit", "lower limit"}
            if kind in ("lower limit", "upper limit") and b[1].signs
            else {kind}
        )
        named = [
            each
            for each in report.attributes
            if each.kind in kinds and {each.ours, each.theirs} & planted.names
        ]
        if not named:
            return f"missed: {told}"
        if elements or unmatched or not report.same:
            return f"false: {told}"
        if not all(is_at_its_line(each, b_text, includes) for each in named):
            return f"misplaced at line {named[0].second_line}: {told}"
        return "right" if len(named) == len(report.attributes) else f"extra: {told}"
    if report.same:
        return f"missed: {told}"
    if expected == "unmatched" or (expected == "type" and unmatched):
        named = [each for each in report.unmatched if {each.ours, each.theirs} & planted.names]
        return "right" if named and len(named) == len(report.unmatched) else f"misnamed: {told}"
    if unmatched:
        return f"misnamed: {told}"
    named = [
        each
        for each in report.differences
        if {each.ours, each.theirs} & planted.names and (each.part == expected or len(planted.names) > 4)
    ]
    if named and len(report.differences) == 1:
        return "right" if not attributes else f"right, extra: {told}"
    if len(report.differences) == 1 and report.mended_text is not None and not attributes:
        other = _mended_difference(a, b[1], report, to, floating, seed)
        if other < 1e-5:
            return f"right (equivalent): {told}"
        return f"misnamed: {told}; its mended file differs by {other:.1e}"
    return f"misnamed: {told}"


def _mended_difference(
    a: tuple[Robot, str, Format], it: Rewritten, report: Any, to: Format, floating: bool, seed: int
) -> float:
    """Return how far the engines see the mended file from the first one, with the frame of a floating base
    that the report states: another inertia of the base may explain a turned joint, in another frame."""
    by = it.by
    if report.T_first_second is not None:
        by = replace(by, T_root=report.T_first_second)
    try:
        return text_difference(a, (it.robot, report.mended_text.decode(), to), floating, seed, by)
    except Exception:
        return float("inf")


__all__ = ["PLANTS", "Planted", "judged", "plant_row"]
