"""Operational-space control: a frame tracks its reference with linear error dynamics, and the remaining
freedom keeps a posture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends import Backend
from dynx.control.base import Measurement, gain, parameter
from dynx.control.computed_torque import commanded_acceleration
from dynx.control.gains import checked_gain, feedback_gains
from dynx.control.task_space import TaskSpace
from dynx.model import Model
from dynx.rbd.elimination import solve_mass_matrix
from dynx.rbd.linear import solve_columns
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint


@dataclass(frozen=True)
class OperationalSpace(TaskSpace[None], pure=True):
    """Computed torque in the space of a frame (Khatib 1987; Siciliano et al., Robotics, section 8.6.2).

    The frame's error e obeys e'' + kd e' + kp e = 0. Joint accelerations that do not accelerate the frame
    move the posture to the setpoint, by the projector of the dynamically consistent inverse J# = M^-1 J' (J
    M^-1 J' + damping^2)^-1. `damping` keeps the torque finite near singular postures, and causes an error.
    """

    kp: Floats = gain("1/s^2")
    kd: Floats = gain("1/s")
    posture_kp: Floats = gain("1/s^2")
    posture_kd: Floats = gain("1/s")
    damping: float = parameter("")

    def __init__(
        self,
        model: Model,
        frame: str,
        *,
        kp: ArrayLike | None = None,
        kd: ArrayLike | None = None,
        natural_frequency: ArrayLike | None = None,
        damping_ratio: ArrayLike = 1.0,
        posture_kp: ArrayLike = 0.0,
        posture_kd: ArrayLike = 1.0,
        damping: float = 1e-3,
        backend: str | Backend = DEFAULT_ENGINE,
    ) -> None:
        """Gains of the frame (6,), linear then angular, or one number; of the posture (nv,).

        Units as those of `ComputedTorque`. Raises GainError, UnknownNameError for the frame.
        """
        super().__init__(model, frame, backend)
        kp, kd = feedback_gains(6, kp, kd, natural_frequency, damping_ratio)
        self._set(
            kp=kp,
            kd=kd,
            posture_kp=checked_gain("posture_kp", posture_kp, model.nv),
            posture_kd=checked_gain("posture_kd", posture_kd, model.nv),
            damping=float(checked_gain("damping", damping, 1, per="")[0]),
        )

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        _, q, v = measurement
        dynamics, frame = self.dynamics, self.frame
        error = self._error(measurement, setpoint)
        wanted = dynamics.frame_acceleration(*setpoint, frame) + self.kd * error.twist + self.kp * error.pose
        left = wanted - dynamics.jacobian_derivative(q, v, frame) @ v
        posture = commanded_acceleration(q, v, *setpoint, self.posture_kp, self.posture_kd)
        J = error.jacobian
        inverse = solve_mass_matrix(self.model.mechanism, dynamics.mass_matrix(q), J.T)
        a = (
            posture
            + inverse
            @ solve_columns(J @ inverse + self.damping**2 * np.eye(6), (left - J @ posture)[:, None])[:, 0]
        )
        return dynamics.inverse_dynamics(q, v, a), None
