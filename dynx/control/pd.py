"""Proportional-derivative control of positions: tau = kp (q* - q) + kd (v* - v)."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike

from dynx.control.base import Measurement, gain
from dynx.control.gains import checked_gain
from dynx.control.joint_space import JointSpace
from dynx.model import Model
from dynx.spatial.scalar import Array, Floats
from dynx.trajectory.base import Setpoint


@dataclass(frozen=True)
class PD(JointSpace[None], pure=True):
    """A spring and a damper from each joint to its setpoint; it needs no model of the masses.

    Under gravity an arm hangs by g / kp below its setpoint.
    """

    kp: Floats = gain("N m/rad or N/m")
    kd: Floats = gain("N m s/rad or N s/m")

    def __init__(self, model: Model, *, kp: ArrayLike, kd: ArrayLike) -> None:
        """`kp` [N m/rad or N/m] and `kd` [N m s/rad or N s/m]: one number, or one for each joint."""
        super().__init__(model)
        n, per = self.n_joints, "one for each joint"
        self._set(kp=checked_gain("kp", kp, n, per=per), kd=checked_gain("kd", kd, n, per=per))

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        states = self.joint_states(measurement, setpoint)
        return self.all_torques(pd_torque(*states, self.kp, self.kd)), None


def pd_torque(q: Array, v: Array, q_wanted: Array, v_wanted: Array, kp: Array, kd: Array) -> Array:
    """Return kp (q* - q) + kd (v* - v), for arrays of any scalar."""
    tau: Array = kp * (q_wanted - q) + kd * (v_wanted - v)
    return tau
