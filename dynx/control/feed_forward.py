"""Torque that the wanted motion takes, whatever the robot does: tau = ID(q*, v*, a*)."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dynx.backends import Backend
from dynx.control.base import Measurement, ModelBased
from dynx.control.gains import checked_gain
from dynx.control.pd import pd_torque
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint


class FeedForward(ModelBased[None]):
    """Inverse dynamics of the setpoint; with gains, a PD law corrects what is left.

    Without gains nothing looks at the robot: an error, once there, grows as gravity pleases.
    """

    def __init__(
        self,
        model: Model,
        *,
        kp: ArrayLike = 0.0,
        kd: ArrayLike = 0.0,
        backend: str | Backend = "pinocchio",
    ) -> None:
        """Gains as those of `PD`; none by default."""
        super().__init__(model, backend)
        self.kp = checked_gain("kp", kp, model.nv)
        self.kd = checked_gain("kd", kd, model.nv)

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        """The torque (nv,)."""
        tau = self._dynamics.inverse_dynamics(*setpoint)
        return tau + pd_torque(measurement.q, measurement.v, setpoint.q, setpoint.v, self.kp, self.kd), None
