"""What two descriptions of a robot say beside its rigid-body dynamics: limits, joint dynamics, shapes,
frames, names, gravity. Such differences do not change the verdict."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from dynx.errors import DescriptionError
from dynx.model import Model
from dynx.model.elements import Joint, Limits, Link
from dynx.model.geometry.links import ShapeNumber
from dynx.model.mechanism import ROOT
from dynx.model.xml.several_files import file_of_line
from dynx.same.decimals import rounded
from dynx.same.fit import BodyFit, Fit, angle_of
from dynx.same.limits import differs, limit_pairs
from dynx.same.scales import inertia_ratio
from dynx.same.shapes import NEGLIGIBLE, SHAPE_KINDS, MatchedShapes, ShapeKind, ShapeOfBody, matched_shapes
from dynx.same.skeleton import float_inertia, is_of_reader, subtract, transformed
from dynx.same.text import pose_text, vector_text
from dynx.spatial.se3 import homogeneous, inverse

Kind = Literal[
    "lower limit",
    "upper limit",
    "velocity limit",
    "effort limit",
    "damping",
    "friction",
    "armature",
    "stiffness",
    "spring reference",
    "collision shapes",
    "visual shapes",
    "contact filter",
    "actuator",
    "sensor",
    "tendon",
    "equality",
    "gravity compensation",
    "configuration",
    "frame",
    "name",
    "gravity",
    "base pose",
]


Tag = Literal["joint", "link", "robot", "actuator", "sensor", "tendon", "equality", "configuration"]
"""Kind of part that differs."""


@dataclass(frozen=True)
class StatedEffect:
    """Largest change of a quantity over random states, or at a configuration, with its unit."""

    quantity: str
    size: float
    unit: str


@dataclass(frozen=True)
class Attribute:
    """A difference beside the verdict, with the values in both descriptions and their lines.

    `effects` are those of a tendon, constraint or configuration that both have: what of it changes by how
    much if it is as in the second description.
    """

    kind: Kind
    tag: Tag
    ours: str | None
    theirs: str | None
    first: str
    second: str
    first_line: int | None = None
    second_line: int | None = None
    first_file: str | None = None
    second_file: str | None = None
    """Files of the lines, where another file includes them."""
    effects: tuple[StatedEffect, ...] = ()

    def __post_init__(self) -> None:
        name_files_of_lines(self)


def name_files_of_lines(difference: object) -> None:
    """Set the files of the lines of a difference that are of included files."""
    for which in ("first", "second"):
        file = file_of_line(getattr(difference, f"{which}_line"))
        if file is not None:
            object.__setattr__(difference, f"{which}_file", file)


@dataclass(frozen=True)
class DescriptionFreedom:
    """A difference of two descriptions that is none of the robots, in words."""

    kind: Literal["frame", "axis", "zero pose", "order", "links", "inertia", "contacts", "constraint"]
    ours: str | None
    theirs: str | None
    message: str


def attributes(ours: Model, theirs: Model, found: Fit, tolerance: float) -> Iterator[Attribute]:
    """Yield what differs beside the verdict, joints first."""
    for each in found.bodies:
        if each.ours != ROOT:
            mine = ours.joint(found.ours.joints[each.ours].name)
            yield from _of_joint(mine, theirs.joint(found.theirs.joints[each.theirs].name), each, tolerance)
    for each in found.bodies:
        yield from _of_links(ours, theirs, found, each, tolerance)
    if not np.allclose(ours.gravity, theirs.gravity, rtol=tolerance, atol=tolerance):
        first, second = (vector_text(model.gravity) for model in (ours, theirs))
        yield Attribute("gravity", "robot", ours.name, theirs.name, first, second)
    if ours.base_pose != theirs.base_pose and not (ours.floating or theirs.floating):
        first, second = (pose_text(model.base_pose) for model in (ours, theirs))
        yield Attribute("base pose", "robot", ours.name, theirs.name, first, second)


def _of_joint(mine: Joint, joint: Joint, each: BodyFit, tolerance: float) -> Iterator[Attribute]:
    if not joint.moves:
        return  # its type differs, and a joint that does not move has nothing else
    if mine.name != joint.name:
        yield Attribute("name", "joint", mine.name, joint.name, mine.name, joint.name, mine.line, joint.line)
    rows: list[tuple[Kind, float, float]] = [
        *limit_pairs(_stated_limits(mine), _stated_limits(joint), each.sign),
        ("damping", mine.dynamics.damping, joint.dynamics.damping),
        ("friction", mine.dynamics.friction, joint.dynamics.friction),
        ("armature", mine.dynamics.armature, joint.dynamics.armature),
        ("stiffness", mine.dynamics.stiffness, joint.dynamics.stiffness),
    ]
    references = [dynamics.spring_reference for dynamics in (mine.dynamics, joint.dynamics)]
    if mine.dynamics.stiffness and joint.dynamics.stiffness:
        rows.append(("spring reference", references[0], each.sign * references[1]))
    balls = mine.type == joint.type == "ball"
    turns = _turns_of_ball(mine, joint, each, tolerance) if balls else {}
    for kind, first, second in rows:
        if differs(first, second, tolerance) or kind in turns:
            yield Attribute(
                kind,
                "joint",
                mine.name,
                joint.name,
                number_text(first),
                number_text(second) + turns.get(kind, ""),
                mine.line,
                joint.line,
            )


def _stated_limits(joint: Joint) -> Limits:
    """Return the limits of a joint; the angle of a ball joint counts from 0, which is no lower limit."""
    return replace(joint.limits, lower=-np.inf) if joint.type == "ball" else joint.limits


def _turns_of_ball(mine: Joint, joint: Joint, each: BodyFit, tolerance: float) -> dict[Kind, str]:
    """Return how numbers of a ball joint differ that count from its zero pose, or about the axes of its
    child, and are equal."""
    found: dict[Kind, str] = {}
    if each.zero_turn > tolerance and joint.limits.upper < np.pi and mine.limits.upper < np.pi:
        found["upper limit"] = f" from a zero pose turned by {each.zero_turn:.6g} rad"
    entries = np.abs(rounded(each.D[:3, :3]))
    if float(np.max(np.minimum(entries, np.abs(1.0 - entries)))) > tolerance:
        words = f" about axes turned by {angle_of(each.D):.6g} rad"
        if mine.dynamics.friction and joint.dynamics.friction:
            found["friction"] = words
        if np.isfinite(mine.limits.velocity) and np.isfinite(joint.limits.velocity):
            found["velocity limit"] = words
        if np.isfinite(mine.limits.effort) and np.isfinite(joint.limits.effort):
            found["effort limit"] = words
    return found


def number_text(value: float) -> str:
    """Write a number; one that is infinite limits nothing."""
    return "none" if np.isinf(value) else f"{value + 0.0:.9g}"


def _of_links(ours: Model, theirs: Model, found: Fit, each: BodyFit, tolerance: float) -> Iterator[Attribute]:
    """Yield differences of the links of a body: names, shapes of the whole body, frames of the same name."""
    mine = {ours.links[k].name: k for k in found.ours.links[each.ours]}
    other = {theirs.links[k].name: k for k in found.theirs.links[each.theirs]}
    if each.ours != ROOT:
        joint, their_joint = found.ours.joints[each.ours], found.theirs.joints[each.theirs]
        first, second = joint.child, their_joint.child
        # Links that a reader makes stand in no file.
        made = is_of_reader(ours, joint) or is_of_reader(theirs, their_joint)
        if first != second and first not in other and second not in mine and not made:
            lines = ours.link(first).line, theirs.link(second).line
            yield Attribute("name", "link", first, second, first, second, *lines)
            mine.pop(first)
            other.pop(second)
    shapes = {
        kind: matched_shapes(kind, found.ours, found.theirs, each.ours, each.theirs, each.D, tolerance)
        for kind in SHAPE_KINDS
    }
    placed = {
        (first.number[0], second.number[0])
        for matched in shapes.values()
        for first, second in matched.pairs
        if first.number and second.number
    }
    for a, b in _renamed_links(mine, other, found, each, placed, tolerance):
        lines = ours.link(a).line, theirs.link(b).line
        yield Attribute("name", "link", a, b, a, b, *lines)
    for kind, matched in shapes.items():
        yield from _of_shapes(kind, matched, found, each)


def _renamed_links(
    mine: dict[str, int],
    other: dict[str, int],
    found: Fit,
    each: BodyFit,
    placed: set[tuple[str, str]],
    tolerance: float,
) -> Iterator[tuple[str, str]]:
    """Yield links that only the names distinguish: those of a body whose inertias are equal, or that have the
    same shapes and no mass. `placed` has the names of links with shapes that are equal."""
    left = [name for name in other if name not in mine]
    for a in mine:
        if a in other or not left:
            continue
        inertia = found.ours.link_inertia(mine[a])
        own = float_inertia(inertia)
        for b in left:
            theirs = found.theirs.link_inertia(other[b])
            difference = float_inertia(subtract(inertia, transformed(theirs, each.D)))
            if own.mass > 0.0:
                equal = inertia_ratio(difference, own, found.ours.whole) <= tolerance
            else:
                equal = (a, b) in placed and not float(theirs.mass) > 0.0
            if equal:
                yield a, b
                left.remove(b)
                break


def _of_shapes(kind: ShapeKind, matched: MatchedShapes, found: Fit, each: BodyFit) -> Iterator[Attribute]:
    """Yield the difference of the shapes of a body, if there is one; meshes differ by their names and
    scales."""
    alone, left = matched.first, matched.second
    if alone or left:
        names = [
            _link_of_shapes(skeleton.model, skeleton.links[body], [*own, *others])
            for skeleton, body, own, others in (
                (found.ours, each.ours, alone, left),
                (found.theirs, each.theirs, left, alone),
            )
        ]
        first, second = (
            ", ".join(sorted(shape.words for shape in shapes)) or "none" for shapes in (alone, left)
        )
        if first == second:
            second = f"placed otherwise: {second}"
        lines = names[0].line, names[1].line
        yield Attribute(kind, "link", names[0].name, names[1].name, first, second, *lines)


def _link_of_shapes(model: Model, numbers: list[int], shapes: list[ShapeOfBody]) -> Link:
    """Return the link of a body that has the first of some shapes, or the name of the link that has it in the
    other description; the first link of the body if it has neither."""
    links = {model.links[number].name: model.links[number] for number in numbers}
    named = (shape.number[0] for shape in shapes if shape.number is not None)
    return next((links[name] for name in named if name in links), model.links[numbers[0]])


def collision_pairs(found: Fit, tolerance: float) -> Iterator[tuple[ShapeNumber, ShapeNumber]]:
    """Yield the collision shapes that are equal in both robots, wherever in the links of a body they are."""
    for each in found.bodies:
        matched = matched_shapes(
            "collision shapes", found.ours, found.theirs, each.ours, each.theirs, each.D, tolerance
        )
        for mine, other in matched.pairs:
            if mine.number and other.number:
                yield mine.number, other.number


def frame_differences(
    ours: Model, theirs: Model, found: Fit, tolerance: float
) -> Iterator[Attribute | DescriptionFreedom]:
    """Yield frames of one name that stand elsewhere. It is a freedom where the frame is that of a joint's
    link, or of a link with mass or shapes, which are where they were; a difference where it only names a
    place."""
    fits = {each.theirs: each for each in found.bodies}
    mine = {frame.name: frame for frame in found.ours.frames}
    for frame in found.theirs.frames:
        other, each = mine.get(frame.name), fits.get(frame.body)
        if other is None or each is None or other.body != each.ours:
            continue
        place = each.D @ homogeneous(frame.R, frame.p)
        off = inverse(homogeneous(other.R, other.p)) @ place
        turn, shift = angle_of(off), float(np.linalg.norm(rounded(off[:3, 3])))
        if turn <= tolerance and shift <= tolerance * found.ours.reach:
            continue
        moved = " and ".join(
            words
            for size, words in ((turn, f"turned by {turn:.6g} rad"), (shift, f"moved by {shift:.6g} m"))
            if size > NEGLIGIBLE
        )
        is_body = _belongs_to_joint(frame.name, found, each) or not any(
            _only_names_a_place(model, frame.name) for model in (ours, theirs)
        )
        if is_body:
            yield DescriptionFreedom("frame", frame.name, frame.name, f"frame of {frame.name} {moved}")
        else:
            lines = line_of_link(ours, frame.name), line_of_link(theirs, frame.name)
            yield Attribute("frame", "link", frame.name, frame.name, "", moved, *lines)


def _belongs_to_joint(name: str, found: Fit, each: BodyFit) -> bool:
    return each.theirs != ROOT and found.theirs.joints[each.theirs].child == name


def _only_names_a_place(model: Model, frame: str) -> bool:
    """Check whether a frame has no mass and no shape."""
    if all(link.name != frame for link in model.links):
        return True
    inertial = model.inertial(frame)
    if inertial.mass or inertial.tensor.any():
        return False
    try:
        return not (model.geometry.collisions(frame) or model.geometry.visuals(frame))
    except DescriptionError:  # a fault in a shape: there is one
        return False


def line_of_link(model: Model, name: str) -> int | None:
    """Return the line of a link; None for a frame that is no link."""
    link = next((link for link in model.links if link.name == name), None)
    return None if link is None else link.line


def freedoms(found: Fit, tolerance: float) -> Iterator[DescriptionFreedom]:
    """Yield opposite axes, zero poses of ball joints, orders of joints and links that are split otherwise."""
    for each in found.bodies:
        if each.zero_turn > max(tolerance, NEGLIGIBLE):
            mine, other = found.ours.joints[each.ours].name, found.theirs.joints[each.theirs].name
            message = f"zero pose of ball joint {other} turned by {each.zero_turn:.6g} rad"
            yield DescriptionFreedom("zero pose", mine, other, message)
        if each.sign < 0:
            mine, other = found.ours.joints[each.ours].name, found.theirs.joints[each.theirs].name
            yield DescriptionFreedom(
                "axis",
                mine,
                other,
                f"axis of {other} reversed: its position, velocity and torque change sign",
            )
    joints = [each.theirs for each in found.bodies if each.ours != ROOT]
    if joints != sorted(joints):
        yield DescriptionFreedom("order", None, None, "the joints are listed in another order")
    for each in found.bodies:
        first = _heavy_links(found.ours.model, found.ours.links[each.ours])
        second = _heavy_links(found.theirs.model, found.theirs.links[each.theirs])
        if len(first) != len(second):
            yield DescriptionFreedom(
                "links",
                first[0] if first else None,
                second[0] if second else None,
                f"a body of {_heavy_names(first)} is described as {_heavy_names(second)}",
            )


def _heavy_links(model: Model, numbers: list[int]) -> list[str]:
    links = (model.links[k] for k in numbers)
    return [link.name for link in links if link.inertial is not None and link.inertial.mass]


def _heavy_names(names: list[str]) -> str:
    return listed(names) if names else "no link with mass"


def listed(names: list[str]) -> str:
    """Write the first three names, and how many more there are."""
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return f"{', '.join(names[:3])}{more}"
