"""DX507 velocity-limit-zero: The velocity limit of a joint is zero, which says that it must stand still.

``velocity="0"`` is mostly written because URDF wants the attribute. It says that the joint must stand still.

Planners that time a path (MoveIt, TOPP-RA, Ruckig) divide by it or report that there is no trajectory.
Pinocchio and Drake store the zero, PyBullet stores it as ``maxVelocity`` and does not apply it, MuJoCo does
not read it. Dynamics is the same with all.

The true limit is not in the file, so there is no remedy by edit.
"""

from collections.abc import Iterable

from dynx.rules import Case, Detection, Rule


class VelocityLimitZero(Rule):
    kind = "practice"
    advice = 'Write the largest speed [rad/s or m/s] of the joint, or type="fixed" if it never moves.'

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Moving joints with a coordinate of their own and a velocity limit of exactly zero."""
        return [
            Detection(None, joint.name, joint.line, "the velocity limit is 0, so the joint must stand still")
            for joint in case.model.coordinate_joints
            if joint.limits.velocity == 0.0
        ]
