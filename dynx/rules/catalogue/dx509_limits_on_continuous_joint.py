"""DX509 limits-on-continuous-joint: a joint without end has a lower or an upper limit

``type="continuous"`` means a joint that turns for ever; its ``lower`` and ``upper`` have no meaning.
Pinocchio and MuJoCo pass them over, PyBullet reports them in ``getJointInfo`` and does not apply them, and
Drake 1.51 makes them the limits of the joint. The equations of motion are the same with all, and somebody
who reads the file believes the range.

What to do: if the joint does have ends, write ``type="revolute"`` and keep them. Else take the two attributes
away, so that every engine has a joint without end; ``dynx doctor --fix`` does so with
``--choose DX509=drop``, and by default leaves them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

from dynx.rules.case import Case
from dynx.rules.rule import Detection, Kind, Remedy, Rule

_RANGE = ("lower", "upper")


class LimitsOnContinuousJoint(Rule):
    """DX509."""

    id = "DX509"
    name = "limits-on-continuous-joint"
    title = "A continuous joint has a lower or an upper limit, which has no meaning there."
    kind: ClassVar[Kind] = "practice"
    advice = 'Take the range away, or write type="revolute" if the joint does have ends.'

    choices: ClassVar[Mapping[str, str]] = {
        "keep": "leave the limits of continuous joints, which mean nothing",
        "drop": "take the lower and upper limits of continuous joints away",
    }

    def detect(self, case: Case) -> Sequence[Detection]:
        """Continuous joints with `lower` or `upper`."""
        found = []
        for name, joint in case.joints.items():
            limit = joint.first("limit")
            if joint.attributes.get("type") != "continuous" or limit is None:
                continue
            written = [f'{end}="{limit.attributes[end]}"' for end in _RANGE if end in limit.attributes]
            if written:
                message = f"{' and '.join(written)} on a joint that turns for ever"
                found.append(Detection(None, name, limit.line, message))
        return found

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """The two attributes taken away, if that was chosen."""
        if self.chosen(case) == "keep":
            return None
        edits = []
        for detection in detections:
            limit = case.joints[detection.joint or ""].first("limit")
            assert limit is not None
            edits += [case.source.removing_attribute(limit, end) for end in _RANGE if end in limit.places]
        return Remedy(
            case.with_source(case.source.edited(*edits)),
            "took the lower and upper limits of continuous joints away",
            self.decision(case),
        )
