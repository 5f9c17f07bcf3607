"""Control of velocities: tau = kd (v* - v), which lets positions drift."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dynx.control.base import Measurement
from dynx.control.gains import checked_gain
from dynx.control.joint_space import JointSpace
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint


class Velocity(JointSpace[None]):
    """A damper from each joint to its wanted speed; what positions do is left to chance."""

    def __init__(self, model: Model, *, kd: ArrayLike) -> None:
        """`kd` [N m s/rad or N s/m]: one number, or one for each joint."""
        super().__init__(model)
        self.kd = checked_gain("kd", kd, self._n_joints, per="one for each joint")

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        """The torque (nv,)."""
        rates = self._v_joints
        return self._of_all(self.kd * (setpoint.v[rates] - measurement.v[rates])), None
