"""DX512 mimic-beyond-limits: A mimic joint leaves its own limits while the joint it follows stays within its
own.

The leader has a range, the follower goes where multiplier and offset put it, and the follower's own
``<limit>`` says that it may not go all the way. One of the four numbers is wrong.

An engine that keeps the limits and the coupling as constraints (MuJoCo, Drake in discrete time) stops the
leader short of its own limit, with the two constraints pushing against each other; one that only computes
dynamics goes on. The equations of motion are the same with all.

Which of the numbers is wrong is not in the file, so there is no remedy by edit.
"""

import math
from collections.abc import Iterable

from dynx.rules import Case, Detection, Rule

_ROUNDING = 1e-3
"""Of the range it goes through: limits are often written with three digits."""


class MimicBeyondLimits(Rule):
    kind = "practice"
    advice = "Give the follower the range that multiplier and offset make of the leader's."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Followers with limits that the leader's range, where it has one, does not respect."""
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
