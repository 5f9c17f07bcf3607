"""DX510 zero-outside-limits: Zero lies outside the range of a joint, and nearly every tool starts there.

Nearly every tool starts at zero: PyBullet after loadURDF, RViz, MuJoCo's ``qpos0``, ``pinocchio.neutral``,
Drake's default context. Where zero is outside the range of a joint, a simulation begins with a force that
pushes the joint back, planners call the start state invalid, and a check of self-collision at "home" checks a
pose that the robot cannot reach.

It is legal and sometimes wanted (an elbow that cannot be stretched), so it is reported and not corrected:
another zero would change the numbers in every program that uses the robot.
"""

from collections.abc import Iterable

from dynx.rules import Case, Detection, Rule


class ZeroOutsideLimits(Rule):
    kind = "practice"
    advice = "Give your programs a start configuration inside the limits."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield joints with a coordinate of their own whose range does not contain zero."""
        for joint in case.model.coordinate_joints:
            lower, upper = sorted((joint.limits.lower, joint.limits.upper))
            if not lower <= 0.0 <= upper:
                message = f"the range {lower:.6g} to {upper:.6g} does not contain 0"
                yield Detection(None, joint.name, joint.line, message)
