"""DX507 velocity-limit-zero: a joint that is not allowed to move

``velocity="0"`` is mostly written because URDF wants the attribute. It says that the joint must stand still.

Planners that time a path (MoveIt, TOPP-RA, Ruckig) divide by it or report that there is no trajectory.
Pinocchio and Drake store the zero, PyBullet stores it as ``maxVelocity`` and does not apply it, MuJoCo does
not read it. Dynamics is the same with all.

The true limit is not in the file, so there is no remedy by edit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from dynx.rules.case import Case
from dynx.rules.rule import Detection, Kind, Rule


class VelocityLimitZero(Rule):
    """DX507."""

    id = "DX507"
    name = "velocity-limit-zero"
    title = "The velocity limit of a joint is zero, which says that it must stand still."
    kind: ClassVar[Kind] = "practice"
    advice = 'Write the largest speed [rad/s or m/s] of the joint, or type="fixed" if it never moves.'

    def detect(self, case: Case) -> Sequence[Detection]:
        """Moving joints with a coordinate of their own and a velocity limit of exactly zero."""
        return [
            Detection(None, joint.name, joint.line, "the velocity limit is 0, so the joint must stand still")
            for joint in case.model.coordinate_joints
            if joint.limits.velocity == 0.0
        ]
