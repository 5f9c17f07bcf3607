"""PD control on top of the weight: tau = g(q) + kp (q* - q) + kd (v* - v)."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dynx.backends import Backend
from dynx.control.base import Measurement, ModelBased
from dynx.control.gains import checked_gain
from dynx.control.pd import pd_torque
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint


class GravityCompensatedPD(ModelBased[None]):
    """PD control that need not hold the arm up: it rests at its setpoint without an error.

    Globally asymptotically stable for a constant setpoint (Takegaki and Arimoto 1981; Siciliano et al.,
    Robotics, section 8.5.1).
    """

    def __init__(
        self, model: Model, *, kp: ArrayLike, kd: ArrayLike, backend: str | Backend = "pinocchio"
    ) -> None:
        """Gains as those of `PD`."""
        super().__init__(model, backend)
        self.kp = checked_gain("kp", kp, model.nv)
        self.kd = checked_gain("kd", kd, model.nv)

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        """The torque (nv,)."""
        weight = self._dynamics.gravity_torque(measurement.q)
        return weight + pd_torque(
            measurement.q, measurement.v, setpoint.q, setpoint.v, self.kp, self.kd
        ), None
