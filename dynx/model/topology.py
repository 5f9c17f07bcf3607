"""Links and joints must form one tree; here it is checked and put into depth-first order."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from dynx.errors import DescriptionError, nearest, shown
from dynx.model.elements import Joint, Link, Mimic, Note

MAX_LINKS = 10_000
"""More links than any robot; a longer file is refused before an engine's recursion overflows."""


def depth_first(
    links: list[Link], joints: list[Joint], source: str
) -> tuple[list[Link], list[Joint]]:
    """Both lists in depth-first order from the root, children in the order of their joints.

    Raises DescriptionError for a repeated name, an unknown link, a link with two parents, two
    roots, a cycle, no link at all, or more than MAX_LINKS links.
    """
    if not links:
        raise DescriptionError("the robot has no link", source=source)
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
                    f"{role} of joint {shown(joint.name)} is {shown(name)}, which is no link"
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
    waiting = children[roots[0].name][::-1]
    while waiting:
        joint = waiting.pop()
        ordered_joints.append(joint)
        ordered_links.append(by_name[joint.child])
        waiting.extend(reversed(children[joint.child]))
    if len(ordered_links) < len(links):
        reached = {link.name for link in ordered_links}
        raise _cycle(next(n for n in by_name if n not in reached), parent_joint, source)
    return ordered_links, ordered_joints


def resolve_mimics(joints: list[Joint], notes: list[Note], source: str) -> list[Joint]:
    """Let every mimic joint name the independent joint at the end of its chain.

    A joint that follows a fixed one is itself fixed; one that follows a joint that is not there
    moves freely; each with a note. Raises DescriptionError for a cycle of mimics.
    """
    by_name = {joint.name: joint for joint in joints}
    resolved: dict[str, Joint] = {}
    for joint in joints:
        resolved[joint.name] = _resolve_mimic(joint, by_name, notes, source)
    return [resolved[joint.name] for joint in joints]


def _resolve_mimic(
    joint: Joint, by_name: dict[str, Joint], notes: list[Note], source: str
) -> Joint:
    if joint.mimic is None or not joint.moves:
        return replace(joint, mimic=None)
    scale, offset, current, seen = 1.0, 0.0, joint, [joint.name]
    while current.mimic is not None:
        offset += scale * current.mimic.offset
        scale *= current.mimic.multiplier
        driver = current.mimic.joint
        if driver not in by_name:
            notes.append(
                Note(
                    f"joint {shown(joint.name)} mimics {shown(driver)}, which does not exist; "
                    "it is read as moving freely" + nearest(driver, by_name),
                    joint.line,
                )
            )
            return replace(joint, mimic=None)
        if driver in seen:
            raise DescriptionError(
                "mimic joints follow each other in a circle: " + " -> ".join([*seen, driver]),
                source=source,
                line=joint.line,
            )
        seen.append(driver)
        current = by_name[driver]
    if not current.moves:
        from dynx.model.locking import fixed_at

        notes.append(
            Note(
                f"joint {shown(joint.name)} mimics {shown(current.name)}, which cannot move; "
                f"it is read as fixed at {offset}",
                joint.line,
            )
        )
        return fixed_at(joint, offset)
    return replace(joint, mimic=Mimic(current.name, scale, offset))


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
    path, name = [start], parent_joint[start].parent
    while name not in path:
        path.append(name)
        name = parent_joint[name].parent
    loop = path[path.index(name) :]
    return DescriptionError(
        f"the links {', '.join(shown(link) for link in loop[:5])} form a cycle, not a tree",
        source=source,
        line=parent_joint[loop[0]].line,
    )
