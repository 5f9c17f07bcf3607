"""DX510 zero-outside-limits: the configuration of zeros is not allowed

Nearly every tool starts at zero: PyBullet after loadURDF, RViz, MuJoCo's ``qpos0``, ``pinocchio.neutral``,
Drake's default context. Where zero is outside the range of a joint, the first step of a simulation begins
with a push back into it, planners call the start state invalid, and a check of self-collision at "home"
looks at a pose that the robot cannot take.

It is legal and sometimes wanted (an elbow that cannot be stretched), so this is only told, not mended: moving
the zero means other numbers in every program that uses the robot.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from dynx.rules.case import Case
from dynx.rules.rule import Detection, Kind, Rule


class ZeroOutsideLimits(Rule):
    """DX510."""

    id = "DX510"
    name = "zero-outside-limits"
    title = "Zero lies outside the range of a joint, and nearly every tool starts there."
    kind: ClassVar[Kind] = "practice"
    advice = "Give your programs a start configuration inside the limits."

    def detect(self, case: Case) -> Sequence[Detection]:
        """Joints with a coordinate of their own whose range does not hold zero."""
        found = []
        for joint in case.model.coordinate_joints:
            lower, upper = sorted((joint.limits.lower, joint.limits.upper))
            if not lower <= 0.0 <= upper:
                message = f"the range {lower:.6g} to {upper:.6g} does not hold 0"
                found.append(Detection(None, joint.name, joint.line, message))
        return found
