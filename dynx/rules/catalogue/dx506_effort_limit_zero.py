"""DX506 effort-limit-zero: The effort limit of a joint is zero, which says that its motor can do nothing.

``effort="0"`` is mostly written because URDF wants the attribute. It says that the motor can do nothing.

Pinocchio and PyBullet store the zero, and whoever clips torques to it clips them to nothing. Gazebo and
ros_control hold such a joint limp. MuJoCo takes 0 for "no limit" (no ``actfrcrange``), Drake for "no
actuator" where a transmission names the joint. Dynamics is the same with all; the limit is not.

A joint that is moved by nothing (a passive wheel, a tendon's idler) has its zero by right, and a mimic
joint, which needs no motor, is not reported. The true limit is not in the file, so there is no remedy.
"""

from collections.abc import Iterable

from dynx.rules import Case, Detection, Rule


class EffortLimitZero(Rule):
    kind = "practice"
    advice = "Write the largest torque [N m] or force [N] that the motor gives at the joint."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Moving joints with a coordinate of their own and an effort limit of exactly zero."""
        return [
            Detection(None, joint.name, joint.line, "the effort limit is 0, so no torque is allowed")
            for joint in case.model.coordinate_joints
            if joint.limits.effort == 0.0
        ]
