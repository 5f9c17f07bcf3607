"""Reductions of the tree of a robot: links merged into their neighbours, moving joints fixed.

The document stays a tree, and nothing else is preserved: the purpose is a smaller robot that still shows a
difference, not the same robot.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from dynx.model.xml.source import Edit, XmlSource
from dynx.rules.case import end_of


@dataclass(frozen=True)
class Reductions:
    """Changes to one document, and the function that makes some of them together."""

    changes: Sequence[Any]
    apply: Callable[[Sequence[Any]], XmlSource]


def fewer_links(source: XmlSource) -> Reductions:
    """Remove links with their parent joints; their children are connected to the nearest remaining link
    towards the root. The links of a limb follow each other in the list, so that whole limbs can be removed
    at once."""
    return Reductions(
        _LinkTree(source).below_root(), lambda chosen: _LinkTree(source).without_children(chosen)
    )


def higher_links(source: XmlSource) -> Reductions:
    """Remove links, including the root, with one of their child joints, whose child replaces them."""
    return Reductions(
        _LinkTree(source).below_root(), lambda chosen: _LinkTree(source).without_parents(chosen)
    )


def fewer_moving_joints(source: XmlSource) -> Reductions:
    """Make joints fixed."""
    moving = [joint for joint in source.root.all("joint") if joint.attributes.get("type") != "fixed"]
    return Reductions(
        moving,
        lambda chosen: source.apply(*(source.attribute_edit(joint, "type", "fixed") for joint in chosen)),
    )


class _LinkTree:
    """The joints of a document with their ends, which reductions change."""

    def __init__(self, source: XmlSource) -> None:
        self._source = source
        self._joints = source.root.all("joint")
        self._ends = [[end_of(joint, "parent"), end_of(joint, "child")] for joint in self._joints]
        self._gone_joints: set[int] = set()
        self._gone_links: set[str] = set()

    def below_root(self) -> list[int]:
        """List the joints depth first: joint k stands for its child link."""
        children_of: dict[str, list[int]] = {}
        for k, (parent, _) in enumerate(self._ends):
            children_of.setdefault(parent, []).append(k)
        child_links = {child for _, child in self._ends}
        order: list[int] = []
        waiting = [k for root in children_of if root not in child_links for k in reversed(children_of[root])]
        while waiting:
            k = waiting.pop()
            order.append(k)
            waiting += reversed(children_of.get(self._ends[k][1], []))
        return order

    def without_children(self, joints: Sequence[int]) -> XmlSource:
        for k in joints:
            parent, child = self._ends[k]
            self._drop(k, child, parent)
        return self._document()

    def without_parents(self, joints: Sequence[int]) -> XmlSource:
        for k in joints:
            parent, child = self._ends[k]
            self._drop(k, parent, child)
        return self._document()

    def _drop(self, k: int, link: str, other: str) -> None:
        self._gone_joints.add(k)
        self._gone_links.add(link)
        self._ends = [[other if end == link else end for end in ends] for ends in self._ends]

    def _document(self) -> XmlSource:
        source = self._source
        edits: list[Edit] = []
        for k, joint in enumerate(self._joints):
            if k in self._gone_joints:
                edits.append(source.removal(joint))
                continue
            for role, name in zip(("parent", "child"), self._ends[k], strict=True):
                if name != end_of(joint, role):
                    element = joint.first(role)
                    assert element is not None
                    edits.append(source.attribute_edit(element, "link", name))
        links = source.root.all("link")
        gone = [link for link in links if link.attributes.get("name") in self._gone_links]
        return source.apply(*edits, *(source.removal(link) for link in gone))
