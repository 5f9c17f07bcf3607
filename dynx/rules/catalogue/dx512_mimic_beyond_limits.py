"""DX512 mimic-beyond-limits: A mimic joint leaves its own limits while the joint it follows stays within its
own.

The leader has a range, multiplier and offset map it to a range of the follower, and the follower's own
``<limit>`` is smaller. One of the four numbers is wrong.

An engine that keeps the limits and the coupling as constraints (MuJoCo, Drake in discrete time) stops the
leader short of its own limit, where the two constraints oppose each other; one that only computes dynamics
has no stop. The equations of motion are the same with all.

The file does not say which of the numbers is wrong, so no edit removes the cause.
"""

import math
from collections.abc import Iterable

from dynx.rules import Case, Detection, Rule

_ROUNDING = 1e-3
"""Tolerance relative to the follower's range, since limits are often written with three digits."""


class MimicBeyondLimits(Rule):
    kind = "practice"
    advice = "Give the follower the range that multiplier and offset make of the leader's."

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
            allowed = _ROUNDING * (high - low)
            if low < lower - allowed or high > upper + allowed:
                message = (
                    f"goes from {low:.6g} to {high:.6g} while {leader.name} moves within its limits; "
                    f"its own are {lower:.6g} to {upper:.6g}"
                )
                yield Detection(None, joint.name, joint.line, message)
