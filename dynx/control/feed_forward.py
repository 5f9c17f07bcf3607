"""Feed-forward torque of the reference: tau = ID(q*, v*, a*)."""

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
class FeedForward(ModelBased[None], pure=True):
    """Inverse dynamics of the setpoint, and with gains PD control of the remaining error.

    Without gains there is no feedback: errors are not corrected, and gravity makes them grow.
    """

    kp: Floats = gain("N m/rad or N/m")
    kd: Floats = gain("N m s/rad or N s/m")

    def __init__(
        self,
        model: Model,
        *,
        kp: ArrayLike = 0.0,
        kd: ArrayLike = 0.0,
        backend: str | Backend = DEFAULT_ENGINE,
    ) -> None:
        """Gains `kp` and `kd` are those of `PD`; by default there are none."""
        super().__init__(model, backend)
        self._set(kp=checked_gain("kp", kp, model.nv), kd=checked_gain("kd", kd, model.nv))

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        tau = self.dynamics.inverse_dynamics(*setpoint)
        return tau + pd_torque(measurement.q, measurement.v, setpoint.q, setpoint.v, self.kp, self.kd), None
