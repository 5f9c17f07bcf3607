"""Joints that mimic others."""

from __future__ import annotations

import math
from collections.abc import Iterable

from dynx.errors import escaped, shown
from dynx.model.elements import Joint
from dynx.model.xml.source import Edit, SourceElement
from dynx.rules import (
    Case,
    Correction,
    Detection,
    EditingRule,
    Rule,
    correction,
    found_at,
    measured_on,
)
from dynx.rules.attributes import meant_name, orientation_edits, renaming
from dynx.rules.joints import SINGLE, elements_in_joints
from dynx.rules.numbers_in_text import decimal


class MimicOfNothing(EditingRule):
    """DX208 mimic-of-nothing: A mimic joint names no joint that it can follow.

    There are four cases: ``<mimic>`` names no joint, ``<mimic>`` names a joint that the file does not have,
    ``<mimic>`` names its own joint, or ``<mimic>`` belongs to a fixed joint.

    - Drake 1.51 refuses the file in all four cases, and names the line.
    - Pinocchio 4.1 and MuJoCo 4.0 refuse a ``<mimic>`` without the attribute ``joint``. MuJoCo also refuses a
      joint that mimics itself.
    - In the other cases MuJoCo prints a warning, and the joint moves freely. In Pinocchio and PyBullet 3.2.7
      every mimic joint moves freely by default.

    In dynx, a joint that follows a missing joint moves freely. dynx refuses a joint that follows itself.

    What to do: name the joint to follow, or remove ``<mimic>``. ``dynx doctor --fix`` corrects a misspelled
    attribute, such as ``<mimic jiont="finger"/>``. Otherwise it removes ``<mimic>``. The joint then moves
    freely, as in the engines that load the file.
    """

    stage = "reading"
    advice = "Name the joint to follow, or remove <mimic>."
    engines = measured_on("pinocchio", "mujoco", "drake")
    changed = "removed <mimic> from joints that had nothing to follow"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the first ``<mimic>`` of every joint."""
        for joint, mimic in elements_in_joints(case, "mimic"):
            message = _why_nothing(case, joint, mimic)
            meant = _misspelled_joint(case, joint, mimic)
            if meant is not None:
                text = f"{message}; its joint is {shown(mimic.attributes[meant])} in {escaped(meant)}"
                edits = renaming(case, mimic, meant, "joint")
                yield Correction(found_at(mimic, text), edits, ("joint",), whole=True)
            elif message is not None:
                edits = tuple(case.source.removal(each) for each in joint.all("mimic"))
                yield correction(mimic, message, *edits)


def _misspelled_joint(case: Case, joint: SourceElement, mimic: SourceElement) -> str | None:
    """Return the attribute of a ``<mimic>`` without ``joint`` that names a joint which follows none."""
    if "joint" in mimic.attributes or joint.attributes.get("type") not in SINGLE:
        return None
    others = {name for name, other in case.joints.items() if other.first("mimic") is None}
    names = (name for name, text in mimic.attributes.items() if text in others)
    return next((name for name in names if meant_name(name, ("joint",), ())), None)


def _why_nothing(case: Case, joint: SourceElement, mimic: SourceElement) -> str | None:
    followed = mimic.attributes.get("joint")
    if not followed:
        return "<mimic> names no joint"
    if followed == joint.attributes.get("name"):
        return "the joint mimics itself"
    if followed not in case.joints:
        return f"the joint mimics {shown(followed)}, which does not exist"
    if joint.attributes.get("type") not in SINGLE:
        return f"the joint mimics {shown(followed)} and is {joint.attributes.get('type', 'of no type')}"
    return None


class MimicOfFixedJoint(EditingRule):
    """DX209 mimic-of-fixed-joint: A mimic joint follows a joint that cannot move.

    Usually someone made the leading joint fixed, for example in a gripper that is not used, and forgot its
    mimic joints. A mimic joint that follows a fixed joint cannot move: by the definition of ``<mimic>``, its
    position is the offset.

    - Drake 1.51 refuses the file: a joint with one coordinate cannot mimic a joint without coordinates.
    - MuJoCo 4.0 prints a warning, and the joint moves freely.
    - In Pinocchio 4.1 and PyBullet 3.2.7 every mimic joint moves freely by default. With ``mimic=True``
      Pinocchio refuses the file.

    dynx reads the joint as fixed at its offset. The effect: in the other engines, every vector and matrix has
    one coordinate more.

    What to do: make the joint fixed. ``dynx doctor --fix`` makes it fixed, and moves its origin by the
    offset. If the joint should move by itself, ``--choose DX209=free`` removes ``<mimic>`` instead.
    """

    advice = "Make the follower fixed, too."
    engines = measured_on("drake")
    choices = {
        "fixed": "make the follower of a fixed joint fixed at its offset",
        "free": "let the follower of a fixed joint move freely",
    }
    changed = "made joints that mimic a fixed one fixed or free"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield joints whose type is one that moves and whose ``<mimic>`` lets dynx read them as fixed."""
        known = {joint.name: joint for joint in case.model.joints}
        for element, mimic in elements_in_joints(case, "mimic", SINGLE):
            joint = known[element.attributes["name"]]
            if not joint.moves:
                message = f"the joint mimics {shown(mimic.attributes['joint'])}, which cannot move"
                yield correction(mimic, message, *self._edits(case, element, joint))

    def _edits(self, case: Case, element: SourceElement, joint: Joint) -> Iterable[Edit]:
        source = case.source
        for mimic in element.all("mimic"):
            yield source.removal(mimic)
        if self.chosen(case) == "free":
            return
        yield source.attribute_edit(element, "type", "fixed")
        if not joint.locked_at:
            return
        texts = {name: " ".join(map(decimal, getattr(joint.origin, name))) for name in ("xyz", "rpy")}
        origin = element.first("origin")
        if origin is None:
            words = " ".join(f'{name}="{text}"' for name, text in texts.items())
            yield source.insertion(element, f"<origin {words}/>", first=True)
        else:
            yield source.attribute_edit(origin, "xyz", texts["xyz"])
            yield from orientation_edits(source, origin, joint.origin.rpy)


class MimicChain(EditingRule):
    """DX511 mimic-chain: A mimic joint follows a joint that is itself a mimic joint.

    A *follower* is a mimic joint. ``<mimic>`` should name a joint that moves by itself. Here it names another
    follower:

    - dynx and joint_state_publisher multiply the factors along the chain, as the definition of ``<mimic>``
      says.
    - Pinocchio 4.1 with ``mimic=True`` refuses the file ("Mimicking and mimicked configuration spaces have
      different sizes"). By default all these joints are free in Pinocchio.
    - In PyBullet all these joints are free.
    - MuJoCo adds an equality constraint for each follower. Its solver satisfies the constraint only
      approximately.

    What to do: let each follower name the first joint of its chain, with the product of the multipliers and
    the combined offset. The position is m2 (m1 x + b1) + b2 = (m2 m1) x + (m2 b1 + b2), so the robot is the
    same. By default ``dynx doctor --fix`` leaves the chain. With ``--choose DX511=direct`` it writes these
    numbers.
    """

    kind = "practice"
    advice = "Let every mimic joint name the joint that moves by itself."
    choices = {
        "keep": "keep chains of mimic joints",
        "direct": (
            "let every follower name the joint that moves by itself, with the product of the multipliers"
        ),
    }
    changed = "let mimic joints follow the driven joint directly, with the factors multiplied"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield mimic joints that follow a mimic joint, with the factors of the whole chain."""
        for joint in case.model.joints:
            resolved, mimic = joint.mimic, case.joints[joint.name].first("mimic")
            if resolved is None or mimic is None:
                continue
            leader = mimic.attributes.get("joint", "")
            if leader != resolved.joint:
                message = f"follows {leader}, which follows {resolved.joint} in the end"
                edits = (
                    case.source.attribute_edit(mimic, "joint", resolved.joint),
                    case.source.attribute_edit(mimic, "multiplier", decimal(resolved.multiplier)),
                    case.source.attribute_edit(mimic, "offset", decimal(resolved.offset)),
                )
                yield correction(mimic, message, *edits)


_ROUNDING_OF_RANGE = 1e-3
"""Tolerance relative to the follower's range, since limits are often written with three digits."""


class MimicBeyondLimits(Rule):
    """DX512 mimic-beyond-limits: A mimic joint leaves its limits although the joint that it follows is within
    its limits.

    The multiplier and the offset map the range of the leading joint to a range of the mimic joint. This range
    is larger than the mimic joint's own ``<limit>``. So one of these numbers is wrong: a limit, the
    multiplier or the offset.

    In MuJoCo, and in Drake's discrete-time simulation, the limits and the coupling are constraints. In these
    engines the limit of the mimic joint stops the leading joint before its own limit. The equations of motion
    are the same in all engines.

    The file does not say which number is wrong, so no edit removes the cause.
    """

    kind = "practice"
    advice = "Give the follower the range that follows from the leading joint's range, multiplier and offset."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield followers with limits that the leader's range violates."""
        for joint in case.model.joints:
            if joint.mimic is None or joint.type == "continuous":
                continue
            leader = case.model.joint(joint.mimic.joint)
            ends = (leader.limits.lower, leader.limits.upper)
            if not all(map(math.isfinite, ends)) or leader.type == "continuous":
                continue
            low, high = sorted(joint.mimic.multiplier * end + joint.mimic.offset for end in ends)
            lower, upper = sorted((joint.limits.lower, joint.limits.upper))
            allowed = _ROUNDING_OF_RANGE * (high - low)
            if low < lower - allowed or high > upper + allowed:
                message = (
                    f"goes from {low:.6g} to {high:.6g} while {leader.name} moves within its limits; "
                    f"its own are {lower:.6g} to {upper:.6g}"
                )
                yield Detection(None, joint.name, joint.line, message)
