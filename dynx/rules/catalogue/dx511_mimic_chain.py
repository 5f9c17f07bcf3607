"""DX511 mimic-chain: A mimic joint follows a joint that is itself a mimic joint.

``<mimic>`` is meant to name a joint that moves by itself. Where it names a follower, dynx multiplies the
factors along the chain, as the definition says, and so does joint_state_publisher. Pinocchio 4.1 refuses such
a file with ``mimic=True`` ("Mimicking and mimicked configuration spaces have different sizes"); without it,
as by default, and in PyBullet all the joints are free. MuJoCo makes one equality constraint for each
follower, which its solver satisfies only approximately.

What to do: let each follower name the first joint of its chain, with the product of the multipliers and the
offsets carried along: value = m2 (m1 x + b1) + b2 = (m2 m1) x + (m2 b1 + b2). It is the same robot. ``dynx
doctor --fix`` does so with ``--choose DX511=direct``, and by default leaves the chain.
"""

from collections.abc import Iterable

from dynx.rules import Case, Correction, OptionalEditingRule, correction
from dynx.rules.numbers_in_text import decimal


class MimicChain(OptionalEditingRule):
    advice = "Let every mimic joint name the joint that is driven."
    choices = {
        "keep": "keep followers of a follower",
        "direct": "let every follower name the joint that is driven, with the factors multiplied",
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
