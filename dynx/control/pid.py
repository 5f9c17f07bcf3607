"""PID control of positions, with an integral that stops growing while the motors are at their limit."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dynx.control.base import Measurement
from dynx.control.gains import checked_gain
from dynx.control.joint_space import JointSpace
from dynx.control.pd import pd_torque
from dynx.control.saturation import checked_limit
from dynx.errors import ArgumentError, shown
from dynx.model import Model
from dynx.spatial.scalar import Floats, clamp
from dynx.trajectory.base import Setpoint


class PID(JointSpace[Floats]):
    """tau = kp e + kd e' + z with z' = ki e, cut to the effort limits.

    Anti-windup by back-calculation (Astrom and Murray, Feedback Systems, section 11.4): what the limits
    cut off runs back into z with the time constant `tracking_time`, so that z never holds more than the
    motors can give. The state is z (n,) [N m or N], the integral part of the torque.
    """

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
        """`control_dt` [s] is the step of the integral: that at which the law is asked.

        `limit` (n,) or one number [N m or N] is where torques are cut, by default the model's effort
        limits; `tracking_time` [s] is by default ten control steps. Raises GainError, ArgumentError, and
        LimitError for a limit of 0.
        """
        super().__init__(model)
        per = "one for each joint"
        self.kp = checked_gain("kp", kp, self._n_joints, per=per)
        self.ki = checked_gain("ki", ki, self._n_joints, per=per)
        self.kd = checked_gain("kd", kd, self._n_joints, per=per)
        self.control_dt = self._dt = _positive("control_dt", control_dt)
        span = 10.0 * self._dt if tracking_time is None else _positive("tracking_time", tracking_time)
        # A share above 1 would overshoot what was cut off.
        self._share = min(1.0, self._dt / span)
        self.limit = checked_limit(model, limit)[self._v_joints]

    def initial_state(self) -> Floats:
        """No integral yet."""
        return np.zeros(self._n_joints)

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: Floats) -> tuple[Floats, Floats]:
        """The torque (nv,) within the limits, and the next integral part."""
        joints, rates = self._q_joints, self._v_joints
        error = setpoint.q[joints] - measurement.q[joints]
        wanted = state + pd_torque(
            measurement.q[joints],
            measurement.v[rates],
            setpoint.q[joints],
            setpoint.v[rates],
            self.kp,
            self.kd,
        )
        tau = clamp(wanted, self.limit)
        integral = state + self._dt * self.ki * error + self._share * (tau - wanted)
        return self._of_all(tau), integral


def _positive(name: str, seconds: float) -> float:
    if not isinstance(seconds, int | float) or not 0.0 < seconds < np.inf:
        raise ArgumentError(f"{name} is {shown(seconds)}; wanted a positive number of seconds")
    return float(seconds)
