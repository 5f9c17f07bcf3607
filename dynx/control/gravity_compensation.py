"""PD control with gravity compensation: tau = g(q) + kp (q* - q) + kd (v* - v)."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike

from dynx.backends import Backend
from dynx.control.base import Measurement, ModelBased, gain
from dynx.control.gains import checked_gain
from dynx.control.pd import pd_torque
from dynx.model import Model
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint


@dataclass(frozen=True)
class GravityCompensatedPD(ModelBased[None], pure=True):
    """PD control with gravity compensation, so that there is no error at rest.

    Globally asymptotically stable for a constant setpoint (Takegaki and Arimoto 1981; Siciliano et al.,
    Robotics, section 8.5.1).
    """

    kp: Floats = gain("N m/rad or N/m")
    kd: Floats = gain("N m s/rad or N s/m")

    def __init__(
        self, model: Model, *, kp: ArrayLike, kd: ArrayLike, backend: str | Backend = DEFAULT_ENGINE
    ) -> None:
        """Gains are those of `PD`."""
        super().__init__(model, backend)
        self._set(kp=checked_gain("kp", kp, model.nv), kd=checked_gain("kd", kd, model.nv))

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        weight = self.dynamics.gravity_torque(measurement.q)
        return weight + pd_torque(
            measurement.q, measurement.v, setpoint.q, setpoint.v, self.kp, self.kd
        ), None
