"""PID control of positions with anti-windup."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dynx.control.base import Measurement, gain, parameter
from dynx.control.gains import checked_gain
from dynx.control.joint_space import JointSpace
from dynx.control.pd import pd_torque
from dynx.control.saturation import checked_limit
from dynx.model import Model
from dynx.model.numbers import positive_seconds
from dynx.spatial.scalar import Floats, clamp
from dynx.trajectory.base import Setpoint


@dataclass(frozen=True)
class PID(JointSpace[Floats], pure=True):
    """tau = kp e + kd e' + z with z' = ki e, saturated at the effort limits.

    Anti-windup by back-calculation (Astrom and Murray, Feedback Systems, section 11.4): the torque beyond the
    limits is fed back into z with the time constant `tracking_time`, so z stays within the range of the
    motors. The state is z (n,) [N m or N], the integral part of the torque.
    """

    kp: Floats = gain("N m/rad or N/m")
    ki: Floats = gain("N m/(rad s) or N/(m s)")
    kd: Floats = gain("N m s/rad or N s/m")
    control_dt: float = parameter("s")
    tracking_time: float = parameter("s")
    limit: Floats = parameter("N m or N")

    def __init__(
        self,
        model: Model,
        *,
        kp: ArrayLike,
        ki: ArrayLike,
        kd: ArrayLike,
        control_dt: float,
        tracking_time: float | None = None,
        limit: ArrayLike | None = None,
    ) -> None:
        """`control_dt` [s] is the step of the integral, the control step.

        `limit` (n,) or one number [N m or N] is by default the model's effort
        limits; `tracking_time` [s] is by default ten control steps. Raises GainError, ArgumentError, and
        LimitError for a limit of 0.
        """
        super().__init__(model)
        gains = {"kp": kp, "ki": ki, "kd": kd}
        n, per = self.n_joints, "one for each joint"
        self._set(**{name: checked_gain(name, value, n, per=per) for name, value in gains.items()})
        dt = positive_seconds("control_dt", control_dt)
        span = 10.0 * dt if tracking_time is None else positive_seconds("tracking_time", tracking_time)
        self._set(control_dt=dt, tracking_time=span, limit=checked_limit(model, limit)[self.v_joints])

    def initial_state(self) -> Floats:
        """Return the integral part 0."""
        return np.zeros(self.n_joints)

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: Floats) -> tuple[Floats, Floats]:
        """Return the torque (nv,) within the limits, and the next integral part."""
        q, v, q_wanted, v_wanted = self.joint_states(measurement, setpoint)
        error = q_wanted - q
        wanted = state + pd_torque(q, v, q_wanted, v_wanted, self.kp, self.kd)
        tau = clamp(wanted, self.limit)
        # A factor above 1 would overcompensate the torque beyond the limits.
        share = min(1.0, self.control_dt / self.tracking_time)
        integral = state + self.control_dt * self.ki * error + share * (tau - wanted)
        return self.all_torques(tau), integral
