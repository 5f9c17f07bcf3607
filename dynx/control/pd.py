"""Proportional-derivative control of positions: tau = kp (q* - q) + kd (v* - v)."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dynx.control.base import Measurement
from dynx.control.gains import checked_gain
from dynx.control.joint_space import JointSpace
from dynx.model import Model
from dynx.spatial.scalar import Array, Floats
from dynx.trajectory.base import Setpoint


class PD(JointSpace[None]):
    """A spring and a damper from each joint to its setpoint; it needs no model of the masses.

    Under gravity an arm hangs by g / kp below its setpoint.
    """

    def __init__(self, model: Model, *, kp: ArrayLike, kd: ArrayLike) -> None:
        """`kp` [N m/rad or N/m] and `kd` [N m s/rad or N s/m]: one number, or one for each joint."""
        super().__init__(model)
        self.kp = checked_gain("kp", kp, self._n_joints, per="one for each joint")
        self.kd = checked_gain("kd", kd, self._n_joints, per="one for each joint")

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        """The torque (nv,)."""
        joints, rates = self._q_joints, self._v_joints
        tau = pd_torque(
            measurement.q[joints],
            measurement.v[rates],
            setpoint.q[joints],
            setpoint.v[rates],
            self.kp,
            self.kd,
        )
        return self._of_all(tau), None


def pd_torque(q: Array, v: Array, q_wanted: Array, v_wanted: Array, kp: Array, kd: Array) -> Array:
    """kp (q* - q) + kd (v* - v), for arrays of any scalar."""
    tau: Array = kp * (q_wanted - q) + kd * (v_wanted - v)
    return tau
