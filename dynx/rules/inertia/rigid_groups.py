"""Groups of links that fixed joints connect rigidly, and the pose of each link in its group."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from dynx.model.elements import Inertial
from dynx.model.mechanism import pose_arrays
from dynx.rules.case import Case, end_of
from dynx.spatial.extended import longdouble
from dynx.spatial.scalar import Array


@dataclass(frozen=True, eq=False)
class RigidGroup:
    """Rigidly connected links; `head` is nearest to the root, `static` says that the group cannot move.

    `links` are in depth-first order, the head first; `poses` has (R, p) of each in the head's frame, in
    long double; `parents` maps each link but the head to its parent.
    """

    head: str
    static: bool
    links: tuple[str, ...]
    poses: dict[str, tuple[Array, Array]]
    parents: dict[str, str]

    def pose(self, link: str, frame: str) -> tuple[Array, Array]:
        """Return (R, p) of one link of the group in the frame of another."""
        R_frame, p_frame = self.poses[frame]
        R_link, p_link = self.poses[link]
        return R_frame.T @ R_link, R_frame.T @ (p_link - p_frame)

    def children(self, link: str) -> tuple[str, ...]:
        """Return the child links of one link within the group, in document order."""
        return tuple(child for child in self.links if self.parents.get(child) == link)

    def below(self, link: str) -> tuple[str, ...]:
        """Return all descendants of one link within the group, in depth-first order."""
        found = {link}
        for each in self.links:
            if self.parents.get(each) in found:
                found.add(each)
        return tuple(each for each in self.links if each in found and each != link)


# Cached, because all rules use the groups of one case before the first remedy makes another case.
@lru_cache(maxsize=8)
def rigid_groups(case: Case) -> Mapping[str, RigidGroup]:
    """Return the group of every link that dynx reads, by the link's name.

    Joints that the document calls ``fixed`` connect rigidly. Joints that dynx holds still for other reasons,
    such as one that follows a fixed joint, move in other engines.
    """
    model = case.model
    heads = {model.root: model.root}
    poses = {model.root: _identity()}
    parents: dict[str, str] = {}
    for joint in model.joints:
        element = case.joints.get(joint.name)
        fixed = joint.type == "fixed" and (element is None or element.attributes.get("type") == "fixed")
        if not fixed:
            heads[joint.child] = joint.child
            poses[joint.child] = _identity()
            continue
        R_parent, p_parent = poses[joint.parent]
        R, p = pose_arrays(joint.origin, longdouble)
        heads[joint.child] = heads[joint.parent]
        poses[joint.child] = (R_parent @ R, p_parent + R_parent @ p)
        parents[joint.child] = joint.parent
    members: dict[str, list[str]] = {}
    for link in model.links:
        members.setdefault(heads[link.name], []).append(link.name)
    groups: dict[str, RigidGroup] = {}
    for head, names in members.items():
        group = RigidGroup(
            head,
            head == model.root and case.base == "fixed",
            tuple(names),
            {name: poses[name] for name in names},
            {name: parents[name] for name in names if name != head},
        )
        groups.update(dict.fromkeys(names, group))
    return MappingProxyType(groups)


def inertials_in_groups(case: Case) -> Iterator[tuple[str, Inertial, RigidGroup]]:
    """Yield each link with an ``<inertial>``: its name, the inertial as dynx reads it, and its group."""
    groups = rigid_groups(case)
    for name, inertial in case.inertials.items():
        if inertial is not None:
            yield name, inertial, groups[name]


def static_links(case: Case) -> frozenset[str]:
    """Name the links that cannot move: on the fixed base the root and links rigidly connected to it.

    They are taken from the document, so links that dynx reads as frames are included.
    """
    if case.base != "fixed":
        return frozenset()
    ends = [(end_of(joint, "parent"), end_of(joint, "child"), joint) for joint in case.joints.values()]
    children: dict[str, list[str]] = {}
    for parent, child, joint in ends:
        if joint.attributes.get("type") == "fixed":
            children.setdefault(parent, []).append(child)
    below = {child for _, child, _ in ends}
    waiting = [name for name in case.links if name not in below]
    found: set[str] = set()
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += children.get(name, [])
    return frozenset(found)


def _identity() -> tuple[Array, Array]:
    return longdouble(np.eye(3)), longdouble(np.zeros(3))
