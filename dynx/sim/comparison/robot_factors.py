"""Differences of two robots: inertia of links, parts of joints, gravity and the pose of the base."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from dynx.model import Model
from dynx.model.elements import Inertial
from dynx.sim.comparison.words import words_apart

Edit = Callable[[Model], Model]
"""Function that takes a difference over into a robot."""

RobotFactor = tuple[str, tuple[str, str], Edit]
"""Name, values in words, and edit of a difference."""

JOINT_PARTS = ("type", "origin", "axis", "limits", "dynamics", "mimic", "locked_at")
MODEL_PARTS = ("gravity", "base_pose", "extra_frames")


def same_tree(one: Model, other: Model) -> bool:
    """Return True if the robots have the same base, and the same links and joints, connected alike."""
    trees = [
        (
            each.base,
            [link.name for link in each.links],
            [(joint.name, joint.parent, joint.child) for joint in each.joints],
        )
        for each in (one, other)
    ]
    return trees[0] == trees[1]


def robot_factors(ours: Model, theirs: Model) -> Iterator[RobotFactor]:
    """Yield the name, the values in words, and the edit of each difference of two robots of one tree."""
    for k, (one, other) in enumerate(zip(ours.links, theirs.links, strict=True)):
        if (one.inertial or Inertial()) != (other.inertial or Inertial()):
            edit = _item_edit("links", k, "inertial", other.inertial)
            yield f"link {one.name}, inertial", words_apart(one.inertial, other.inertial), edit
    for k, (joint, twin) in enumerate(zip(ours.joints, theirs.joints, strict=True)):
        for part in JOINT_PARTS:
            mine, its = getattr(joint, part), getattr(twin, part)
            if mine != its:
                edit = _item_edit("joints", k, part, its)
                yield f"joint {joint.name}, {part}", words_apart(mine, its), edit
    for part in MODEL_PARTS:
        mine, its = getattr(ours, part), getattr(theirs, part)
        if mine != its:
            yield part, words_apart(mine, its), _field_edit(part, its)


def grouped(found: Iterable[RobotFactor]) -> Iterator[RobotFactor]:
    """Yield one difference for each part of all links and of all joints, such as ``links, inertial``."""
    groups: dict[str, list[RobotFactor]] = {}
    for each in found:
        item, _, part = each[0].rpartition(", ")
        groups.setdefault(f"{item.partition(' ')[0]}s, {part}" if item else part, []).append(each)
    for name, members in groups.items():
        if len(members) == 1:
            yield members[0]
            continue
        mine, its = (
            f"{len(members)}: " + "; ".join(f"{_item_of(each[0])} {each[1][side]}" for each in members)
            for side in (0, 1)
        )
        yield name, (mine, its), _all_edits([each[2] for each in members])


def _item_of(name: str) -> str:
    """Return the link or joint in the name of a difference."""
    return name.rpartition(", ")[0].partition(" ")[2]


def _all_edits(edits: Sequence[Edit]) -> Edit:
    def edit(model: Model) -> Model:
        for each in edits:
            model = each(model)
        return model

    return edit


def _item_edit(kind: str, k: int, field: str, value: object) -> Edit:
    def edit(model: Model) -> Model:
        items = list(getattr(model, kind))
        items[k] = replace(items[k], **{field: value})
        return _replaced(model, kind, tuple(items))

    return edit


def _field_edit(field: str, value: object) -> Edit:
    return lambda model: _replaced(model, field, value)


def _replaced(model: Model, field: str, value: Any) -> Model:
    changes: dict[str, Any] = {field: value}
    return replace(model, **changes)
