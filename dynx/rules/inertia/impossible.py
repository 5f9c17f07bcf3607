"""The common part of the rules on inertia tensors that no body can have: detection and remedies."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar

import numpy as np

from dynx.model.elements import Inertial
from dynx.rules.case import Case
from dynx.rules.engine_versions import measured_on
from dynx.rules.inertia.central import CentralInertia
from dynx.rules.inertia.edits import line_of, with_inertials
from dynx.rules.inertia.merging import merged_inertials
from dynx.rules.inertia.physical import (
    ACCEPTED_MOMENT,
    Fault,
    fault_beyond_rounding,
    is_borderline,
    nearest_moments,
    principal_moments,
    with_raised_moments,
)
from dynx.rules.inertia.rigid_groups import RigidGroup, rigid_groups
from dynx.rules.rule import Detection, Remedy, Rule, links_of

NUMBERS_OF_THE_FILE = ("pybullet.set_inertias", "pybullet.extrapolate_inertias", "drake.set_inertias")
"""The engine settings with which engines use the numbers of the file."""


class ImpossibleInertia(Rule):
    """A rule about tensors that no body can have, by more than rounding."""

    fault: ClassVar[Fault]
    engines: ClassVar[Mapping[str, str]] = measured_on("pybullet", "mujoco", "drake")
    advice = "Take the tensor from the CAD model again; in the meantime use the nearest that a body can have."
    choices: ClassVar[Mapping[str, str]] = {
        "fuse": "merge the link with links rigidly connected to it where that makes a body, which changes no "
        "equation of motion; else as nearest",
        "nearest": "put the nearest tensor that a body can have in its place",
        "keep": "leave the numbers, and give them after loading to the engines that take them",
    }

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links whose tensor has the fault, static ones too: MuJoCo refuses the file for them."""
        kept = self.chosen(case) == "keep" and case.calls.issuperset(NUMBERS_OF_THE_FILE)
        groups = rigid_groups(case)
        for link in case.model.links:
            inertial = link.inertial
            if inertial is None or fault_beyond_rounding(inertial) != self.fault:
                continue
            if kept and (groups[link.name].static or _has_largest_on_y(inertial)):
                continue
            message = self._message(inertial) + (
                ", held still by the world" if groups[link.name].static else ""
            )
            yield Detection(link.name, None, line_of(case, link.name, "inertia"), message)

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Merge, replace or keep, as chosen; the default merges where that is enough."""
        names = links_of(detections)
        decision, chosen = self.decision(case), self.chosen(case)
        if chosen == "keep":
            moving = [name for name in names if not rigid_groups(case)[name].static]
            rotated = {name: _with_largest_on_y(found) for name in moving if (found := case.inertials[name])}
            mended = with_inertials(case, rotated).with_calls(*NUMBERS_OF_THE_FILE)
            return Remedy(mended, "gave engines the numbers of the file after loading", decision)
        merged: list[str] = []
        if chosen == "fuse":
            for name in names:
                bodies = _merge_link(case, rigid_groups(case)[name], name)
                if bodies is not None:
                    case = with_inertials(case, bodies)
                    merged.append(name)
        replaced: dict[str, Inertial] = {}
        for name in names:
            inertial = case.inertials[name]
            if inertial is not None and fault_beyond_rounding(inertial) == self.fault:
                replaced[name] = _nearest_inertial(case, inertial, name)
        case = with_inertials(case, replaced)
        parts = []
        if merged:
            parts.append(
                f"merged the inertia of {_listed(merged)} with that of links rigidly connected to it"
            )
        if replaced:
            parts.append(f"put the nearest that a body can have for the tensor of {_listed(replaced)}")
        return Remedy(case, " and ".join(parts), decision, changes_physics=bool(replaced))

    def _message(self, inertial: Inertial) -> str:
        small, middle, large = (float(value) for value in principal_moments(inertial))
        if self.fault == "negative":
            return f"the principal moment {small:.6g} is negative"
        return f"the principal moment {large:.6g} exceeds the sum of the others, {small:.6g} and {middle:.6g}"


def _merge_link(case: Case, group: RigidGroup, name: str) -> dict[str, Inertial] | None:
    """Merge the link with its parent, its descendants, or its whole group: the first that gives a physical
    inertia; None where none does."""
    attempts: list[tuple[tuple[str, ...], str]] = []
    if name in group.parents:
        parent = group.parents[name]
        attempts.append(((parent, name), parent))
    if below := group.below(name):
        attempts.append(((name, *below), name))
    if len(group.links) > 1:
        attempts.append((group.links, group.head))
    for links, into in attempts:
        # Another rule is about links without mass, and must still find them.
        if not case.model.inertial(into).mass > 0.0:
            continue
        bodies = merged_inertials(case, group, links, into)
        new = bodies[into]
        if new.mass > 0.0 and fault_beyond_rounding(new) is None:
            root = into == case.model.root
            if is_borderline(new, root=root, on_fixed_joint=into in group.parents):
                bodies[into] = with_raised_moments(new)
            return bodies
    return None


def _nearest_inertial(case: Case, inertial: Inertial, name: str) -> Inertial:
    body = CentralInertia.of(inertial)
    moments, axes = body.principal(inertial.origin.rpy)
    near = body.about(nearest_moments(moments), axes)
    if case.base == "fixed" and name == case.model.root:
        near = CentralInertia.of(near).aligned()
    return with_raised_moments(near, ACCEPTED_MOMENT)


def _with_largest_on_y(inertial: Inertial) -> Inertial:
    """Return the tensor in principal form with the largest moment about y: the only one that Bullet's inverse
    dynamics does not compare with the sum of the others."""
    body = CentralInertia.of(inertial)
    moments, axes = body.principal(inertial.origin.rpy)
    largest = int(np.argmax(moments))
    order = [(largest + shift) % 3 for shift in (-1, 0, 1)]
    return body.about(moments[order], axes[:, order])


def _has_largest_on_y(inertial: Inertial) -> bool:
    products = inertial.ixy or inertial.ixz or inertial.iyz
    return not products and inertial.iyy == max(inertial.ixx, inertial.iyy, inertial.izz)


def _listed(names: Iterable[str]) -> str:
    found = list(names)
    shown = ", ".join(found[:5])
    return shown if len(found) <= 5 else f"{shown} and {len(found) - 5} more"
