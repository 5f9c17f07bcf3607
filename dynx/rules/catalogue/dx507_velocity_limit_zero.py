"""DX507 velocity-limit-zero: The velocity limit of a joint is zero, so it must not move.

``velocity="0"`` is mostly written because URDF requires the attribute. It states that the joint must not
move.

Planners that time a path (MoveIt, TOPP-RA, Ruckig) divide by it or report that there is no trajectory.
Pinocchio and Drake store the zero, PyBullet stores it as ``maxVelocity`` and does not apply it, MuJoCo does
not read it. Dynamics is the same with all.

The file does not contain the true limit, so no edit removes the cause.
"""

from collections.abc import Iterable

from dynx.rules import Case, Detection, Rule


class VelocityLimitZero(Rule):
    kind = "practice"
    advice = 'Write the largest speed [rad/s or m/s] of the joint, or type="fixed" if it never moves.'

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield moving joints with a coordinate of their own and a velocity limit of exactly zero."""
        message = "the velocity limit is 0, so the joint must not move"
        for joint in case.model.coordinate_joints:
            if joint.limits.velocity == 0.0:
                yield Detection(None, joint.name, joint.line, message)
