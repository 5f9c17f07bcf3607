"""Control of velocities: tau = kd (v* - v), which lets positions drift."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike

from dynx.control.base import Measurement, gain
from dynx.control.gains import checked_gain
from dynx.control.joint_space import JointSpace
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint


@dataclass(frozen=True)
class Velocity(JointSpace[None], pure=True):
    """A damper from each joint to its velocity setpoint; positions are not controlled."""

    kd: Floats = gain("N m s/rad or N s/m")

    def __init__(self, model: Model, *, kd: ArrayLike) -> None:
        """`kd` [N m s/rad or N s/m]: one number, or one for each joint."""
        super().__init__(model)
        self._set(kd=checked_gain("kd", kd, self.n_joints, per="one for each joint"))

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        rates = self.v_joints
        return self.all_torques(self.kd * (setpoint.v[rates] - measurement.v[rates])), None
