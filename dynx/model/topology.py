"""Checks that links and joints form one tree, and orders them depth-first."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import SupportsFloat

import numpy as np

from dynx.errors import (
    DescriptionError,
    DTypeError,
    NotFiniteError,
    UnknownNameError,
    UnsupportedFeatureError,
    nearest,
    shown,
)
from dynx.model.elements import Inertial, Joint, Link, Mimic, Note, Pose
from dynx.model.numbers import MAX_MAGNITUDE, is_real
from dynx.spatial.so3 import rotation_about, rpy_from_rotation

# Bound on the numbers of a description, whether a file or a program states them.


_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def refuse_unbounded_numbers(links: Iterable[Link], joints: Iterable[Joint], source: str) -> None:
    """Raise DescriptionError for a number that is not finite or not below `MAX_MAGNITUDE`, DTypeError for
    what is no number, and UnsupportedFeatureError for a ball joint with a spring.

    Limits may be infinite, and are not part of any product.
    """
    for link in links:
        if link.inertial is not None:
            _require_bounded(f"link {shown(link.name)}", _of_inertial(link.inertial), source, link.line)
    for joint in joints:
        _require_bounded(f"joint {shown(joint.name)}", _of_joint(joint), source, joint.line)
        if joint.type == "ball" and (joint.dynamics.stiffness or not joint.limits.upper >= 0.0):
            from dynx.model.ball_joints import refuse_numbers

            refuse_numbers(joint, source)


def _of_inertial(inertial: Inertial) -> Iterator[tuple[str, float]]:
    yield "mass", inertial.mass
    yield from ((name, getattr(inertial, name)) for name in _MOMENTS)
    yield from _of_pose("origin of the inertia", inertial.origin)


def _of_joint(joint: Joint) -> Iterator[tuple[str, float]]:
    yield from _of_pose("origin", joint.origin)
    yield from (("axis", value) for value in joint.axis)
    dynamics = joint.dynamics
    yield "damping", dynamics.damping
    yield "friction", dynamics.friction
    yield "armature", dynamics.armature
    yield "stiffness", dynamics.stiffness
    yield "spring reference", dynamics.spring_reference
    if joint.mimic is not None:
        yield "multiplier", joint.mimic.multiplier
        yield "offset", joint.mimic.offset
    if joint.locked_at is not None:
        yield "locked position", joint.locked_at


def _of_pose(name: str, pose: Pose) -> Iterator[tuple[str, float]]:
    yield from ((name, value) for value in (*pose.xyz, *pose.rpy))


def _require_bounded(what: str, numbers: Iterable[tuple[str, float]], source: str, line: int | None) -> None:
    for name, value in numbers:
        if not is_real(value):
            raise DTypeError(f"the {name} of {what} is {shown(value)}; wanted a number")
        # The comparison is false for NaN.
        if not abs(value) < MAX_MAGNITUDE:
            raise DescriptionError(
                f"the {name} of {what} is {value}; wanted a number below {MAX_MAGNITUDE:g} in magnitude, "
                "since products of larger numbers overflow",
                source=source,
                line=line,
            )


# Locking of joints at a position: the joint becomes fixed and is removed from q.


def lock_joints(joints: list[Joint], lock: Mapping[str, float]) -> list[Joint]:
    """Return `joints` with those named in `lock` fixed at the given positions [rad or m].

    Joints that follow a locked one are fixed by `topology.resolve_mimics`. Raises UnknownNameError for an
    unknown or fixed joint; DTypeError or NotFiniteError for a position that is not a finite number.
    """
    by_name = {joint.name: joint for joint in joints}
    for name, value in lock.items():
        if name not in by_name:
            raise UnknownNameError(f"cannot lock {shown(name)}: no such joint{nearest(name, by_name)}")
        if not by_name[name].moves:
            raise UnknownNameError(f"cannot lock {shown(name)}: it is a fixed joint already")
        if by_name[name].type == "ball":
            raise UnsupportedFeatureError(
                f"cannot lock {shown(name)}: it is a ball joint, whose position is no number"
            )
        if isinstance(value, bool | str) or not isinstance(value, SupportsFloat):
            raise DTypeError(f"cannot lock {shown(name)} at {shown(value)}; wanted a number")
        if not math.isfinite(value):
            raise NotFiniteError(f"cannot lock {shown(name)} at {value}: wanted a finite number")
    return [lock_joint(joint, float(lock[joint.name])) if joint.name in lock else joint for joint in joints]


def lock_joint(joint: Joint, value: float) -> Joint:
    """Return the joint fixed at position `value`, which is included in its origin."""
    axis, T = np.array(joint.axis), joint.origin.matrix
    if joint.type == "prismatic":
        x, y, z = (T[:3, 3] + T[:3, :3] @ (axis * value)).tolist()
        origin = Pose((x, y, z), joint.origin.rpy)
    elif value == 0.0:
        origin = joint.origin
    else:
        R = T[:3, :3] @ rotation_about(axis, np.array(value))
        roll, pitch, yaw = rpy_from_rotation(R).tolist()
        origin = Pose(joint.origin.xyz, (roll, pitch, yaw))
    return replace(joint, type="fixed", origin=origin, mimic=None, locked_at=value)


MAX_LINKS = 10_000
"""Largest number of links, more than any robot has; larger files would overflow the stack of an engine."""


def depth_first(links: list[Link], joints: list[Joint], source: str) -> tuple[list[Link], list[Joint]]:
    """Return both lists in depth-first order from the root, children in the order of their joints.

    Raises DescriptionError for a repeated name, an unknown link, a link with two parents, two roots, a cycle,
    no link at all, or more than MAX_LINKS links.
    """
    if not links:
        hint = "; a xacro file without links of its own is read by the file that includes it"
        raise DescriptionError(
            f"the robot has no link{hint if source.endswith('.xacro') else ''}", source=source
        )
    if len(links) > MAX_LINKS:
        raise DescriptionError(
            f"the robot has {len(links)} links; at most {MAX_LINKS} are accepted", source=source
        )
    _refuse_duplicates("link", links, source)
    _refuse_duplicates("joint", joints, source)
    by_name = {link.name: link for link in links}
    parent_joint: dict[str, Joint] = {}
    children: dict[str, list[Joint]] = {link.name: [] for link in links}
    for joint in joints:
        for role, name in (("parent", joint.parent), ("child", joint.child)):
            if name not in by_name:
                raise DescriptionError(
                    f"{role} of joint {shown(joint.name)} is {shown(name)}, which is not a link"
                    + nearest(name, by_name),
                    source=source,
                    line=joint.line,
                )
        if joint.parent == joint.child:
            raise DescriptionError(
                f"joint {shown(joint.name)} joins link {shown(joint.child)} to itself",
                source=source,
                line=joint.line,
            )
        if joint.child in parent_joint:
            other = parent_joint[joint.child]
            raise DescriptionError(
                f"link {shown(joint.child)} has two parents: joints {shown(other.name)} and "
                f"{shown(joint.name)}",
                source=source,
                line=joint.line,
            )
        parent_joint[joint.child] = joint
        children[joint.parent].append(joint)

    roots = [link for link in links if link.name not in parent_joint]
    if len(roots) > 1:
        named = ", ".join(shown(root.name) for root in roots[:5])
        raise DescriptionError(
            f"{len(roots)} links have no parent, but a robot is one tree with one root: {named}",
            source=source,
            line=roots[1].line,
        )
    if not roots:
        raise _cycle(links[0].name, parent_joint, source)

    ordered_links, ordered_joints = [roots[0]], []
    stack = children[roots[0].name][::-1]
    while stack:
        joint = stack.pop()
        ordered_joints.append(joint)
        ordered_links.append(by_name[joint.child])
        stack.extend(reversed(children[joint.child]))
    if len(ordered_links) < len(links):
        reached = {link.name for link in ordered_links}
        raise _cycle(next(n for n in by_name if n not in reached), parent_joint, source)
    return ordered_links, ordered_joints


def resolve_mimics(joints: list[Joint], notes: list[Note], source: str) -> list[Joint]:
    """Make every mimic joint refer to the independent joint at the end of its chain.

    A joint that follows a fixed or locked one becomes fixed; one that follows an unknown joint becomes
    independent, with a note. Raises DescriptionError for a cycle of mimic joints.
    """
    by_name = {joint.name: joint for joint in joints}
    balls = [joint for joint in joints if joint.type == "ball"]
    followers = [joint for joint in joints if joint.moves and joint.mimic is not None]
    if balls and followers:
        raise UnsupportedFeatureError(
            f"joint {shown(followers[0].name)} mimics another, and {shown(balls[0].name)} is a ball joint; "
            "dynx takes no robot with both",
            source=source,
            line=followers[0].line,
        )
    resolved: dict[str, Joint] = {}
    for joint in joints:
        for follower in reversed(_unresolved_chain(joint, by_name, resolved, source)):
            resolved[follower.name] = _resolve_mimic(follower, resolved, by_name, notes, source)
    return [resolved[joint.name] for joint in joints]


def _unresolved_chain(
    joint: Joint, by_name: dict[str, Joint], resolved: dict[str, Joint], source: str
) -> list[Joint]:
    """Return `joint`, the joint it follows, and so on, up to one that follows none or is resolved."""
    chain: dict[str, Joint] = {}
    current: Joint | None = joint
    while current is not None and current.name not in resolved:
        if current.name in chain:
            circle = list(chain)[list(chain).index(current.name) :]
            named = " -> ".join(shown(name) for name in [*circle[:5], current.name])
            raise DescriptionError(
                f"mimic joints follow each other in a cycle: {named}", source=source, line=joint.line
            )
        chain[current.name] = current
        current = by_name.get(current.mimic.joint) if current.moves and current.mimic else None
    return list(chain.values())


def _resolve_mimic(
    joint: Joint, resolved: dict[str, Joint], known: Iterable[str], notes: list[Note], source: str
) -> Joint:
    if joint.mimic is None or not joint.moves:
        return replace(joint, mimic=None)
    driver = resolved.get(joint.mimic.joint)
    what = f"joint {shown(joint.name)} mimics {shown(joint.mimic.joint)}"
    if driver is None:
        hint = nearest(joint.mimic.joint, known)
        notes.append(
            Note(f"{what}, which does not exist; it is read as an independent joint{hint}", joint.line)
        )
        return replace(joint, mimic=None)
    scale, offset = joint.mimic.multiplier, joint.mimic.offset
    if driver.moves and driver.mimic is None:
        return joint
    if driver.mimic is not None:
        offset += scale * driver.mimic.offset
        scale *= driver.mimic.multiplier
    else:
        offset += scale * (driver.locked_at or 0.0)
    if not (math.isfinite(scale) and math.isfinite(offset)):
        raise DescriptionError(
            f"{what} by multiplier {scale} and offset {offset}; wanted finite numbers",
            source=source,
            line=joint.line,
        )
    if driver.mimic is not None:
        return replace(joint, mimic=Mimic(driver.mimic.joint, scale, offset))
    if driver.locked_at is None:
        notes.append(Note(f"{what}, which cannot move; it is read as fixed at {offset}", joint.line))
    return lock_joint(joint, offset)


def _refuse_duplicates(kind: str, parts: Iterable[Link | Joint], source: str) -> None:
    first: dict[str, Link | Joint] = {}
    for part in parts:
        if part.name in first:
            where = first[part.name].line
            earlier = "" if where is None else f"; the first is in line {where}"
            raise DescriptionError(
                f"two {kind}s are named {shown(part.name)}{earlier}", source=source, line=part.line
            )
        first[part.name] = part


def _cycle(start: str, parent_joint: dict[str, Joint], source: str) -> DescriptionError:
    path, name = {start: 0}, parent_joint[start].parent
    while name not in path:
        path[name] = len(path)
        name = parent_joint[name].parent
    loop = list(path)[path[name] :]
    return DescriptionError(
        f"the links {', '.join(shown(link) for link in loop[:5])} form a cycle, not a tree",
        source=source,
        line=parent_joint[loop[0]].line,
    )


def longest_chain_end(links: Sequence[Link], joints: Sequence[Joint]) -> str:
    """Return the link that ends the longest chain of moving joints; of several, the last in `links`.

    Both are in depth-first order.
    """
    root = links[0].name
    moving, number = {root: 0}, {root: 0}
    for joint in joints:
        moving[joint.child] = moving[joint.parent] + joint.moves
        number[joint.child] = number[joint.parent] + 1
    order = {link.name: k for k, link in enumerate(links)}
    return max(order, key=lambda link: (moving[link], number[link], order[link]))
