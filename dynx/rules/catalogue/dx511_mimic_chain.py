"""DX511 mimic-chain: a joint follows a joint that follows another

``<mimic>`` is meant to name a joint that moves by itself. Where it names a follower, dynx multiplies the
factors along the chain, which is what the words say, and so does joint_state_publisher. Pinocchio 4.1
refuses such a file with ``mimic=True`` ("Mimicking and mimicked configuration spaces have different
sizes"); without it, as by default, and in PyBullet all the joints are free. MuJoCo makes one equality
constraint for each follower, which its solver satisfies softly, one on top of the other.

What to do: let each follower name the first joint of its chain, with the product of the multipliers and the
offsets carried along: value = m2 (m1 x + b1) + b2 = (m2 m1) x + (m2 b1 + b2). It is the same robot.
``dynx doctor --fix`` does so with ``--choose DX511=direct``, and by default leaves the chain.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

from dynx.rules.case import Case
from dynx.rules.number_text import decimal
from dynx.rules.rule import Detection, Kind, Remedy, Rule


class MimicChain(Rule):
    """DX511."""

    id = "DX511"
    name = "mimic-chain"
    title = "A mimic joint follows a joint that is itself a mimic joint."
    kind: ClassVar[Kind] = "practice"
    advice = "Let every mimic joint name the joint that is driven."

    choices: ClassVar[Mapping[str, str]] = {
        "keep": "leave followers that follow a follower",
        "direct": "let every follower name the joint that is driven, with the factors multiplied",
    }

    def detect(self, case: Case) -> Sequence[Detection]:
        """Mimic joints that name a mimic joint."""
        found = []
        for joint in case.model.joints:
            if joint.mimic is None:
                continue
            mimic = case.joints[joint.name].first("mimic")
            leader = "" if mimic is None else mimic.attributes.get("joint", "")
            if mimic is not None and leader != joint.mimic.joint:
                message = f"follows {leader}, which follows {joint.mimic.joint} in the end"
                found.append(Detection(None, joint.name, mimic.line, message))
        return found

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Every follower named after the joint that is driven, if that was chosen."""
        if self.chosen(case) == "keep":
            return None
        edits = []
        for detection in detections:
            resolved = case.model.joint(detection.joint or "").mimic
            mimic = case.joints[detection.joint or ""].first("mimic")
            assert resolved is not None
            assert mimic is not None
            edits.append(case.source.setting(mimic, "joint", resolved.joint))
            edits.append(case.source.setting(mimic, "multiplier", decimal(resolved.multiplier)))
            edits.append(case.source.setting(mimic, "offset", decimal(resolved.offset)))
        return Remedy(
            case.with_source(case.source.edited(*edits)),
            "let mimic joints follow the driven joint directly, with the factors multiplied",
            self.decision(case),
        )
