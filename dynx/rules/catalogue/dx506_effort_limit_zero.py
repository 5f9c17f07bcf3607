"""DX506 effort-limit-zero: The effort limit of a joint is zero, so its motor can apply no force.

``effort="0"`` is mostly written because URDF requires the attribute. It states that the motor can apply no
force.

Pinocchio and PyBullet store the zero, so torques that are clipped to it become zero. Gazebo and ros_control
leave such a joint without force. MuJoCo reads 0 as "no limit" (no ``actfrcrange``), Drake as "no actuator"
where a transmission names the joint. Dynamics is the same with all; the limit is not.

For a passive joint (a wheel, a tendon's idler) zero is correct; a mimic joint, which needs no motor, is not
reported. The file does not contain the true limit, so there is no remedy.
"""

from collections.abc import Iterable

from dynx.rules import Case, Detection, Rule


class EffortLimitZero(Rule):
    kind = "practice"
    advice = "Write the largest torque [N m] or force [N] that the motor gives at the joint."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield moving joints with a coordinate of their own and an effort limit of exactly zero."""
        for joint in case.model.coordinate_joints:
            if joint.limits.effort == 0.0:
                yield Detection(
                    None, joint.name, joint.line, "the effort limit is 0, so no torque is allowed"
                )
