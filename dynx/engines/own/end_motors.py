"""Motors whose law holds at the end of a step, in the step of a robot."""

from __future__ import annotations

import numpy as np

from dynx.rbd.contact_step import ServoJoints, motor_law
from dynx.spatial.scalar import Floats
from dynx.steppers.forces import JointLaw

BLOCK_CORRECTIONS = 8
"""Number of corrections after which motors at their limits stay there, so that corrections end."""

ROUNDING = 1e-12
"""Part of the largest torque by which a torque may exceed it, so that rounding does not decide."""


class MotorsOfStep:
    """Motors of a robot in one step from `positions` and `rates` (n,) of the joints, of length `h` [s].

    At the acceleration a of its joint a motor has the torque b - K a (`dynx.rbd.contact_step.motor_law`), and
    the largest torque in its direction where that exceeds it. So a motor is an inertia K and a torque b, or a
    torque alone. Which it is follows from the velocities at the end of the step: solve, `correct`, and solve
    again until nothing changes.
    """

    def __init__(self, motors: JointLaw, h: float, positions: Floats, rates: Floats) -> None:
        zero = np.zeros(len(rates))
        joints = ServoJoints(motors.kp, motors.kd, zero, zero)
        b, self._K = motor_law(joints, h, positions, rates, motors.target)
        self._b: Floats = b + motors.kd * motors.velocity + motors.torque
        self._most, self._h, self._rates = motors.max_force, h, rates
        self._limited = bool(np.isfinite(motors.max_force).any())
        self._held = zero
        """Sign of the limit at which a motor is (n,), 0 for those within."""
        self._corrections = 0

    @property
    def torque(self) -> Floats:
        """Torque (n,) of the motors without acceleration."""
        return np.where(self._held == 0.0, self._b, np.copysign(self._most, self._held))

    @property
    def inertia(self) -> Floats:
        """Inertia (n,) [kg m^2 or kg] that the motors add to the joints."""
        return np.where(self._held == 0.0, self._K, 0.0)

    def torque_at(self, rates: Floats) -> Floats:
        """Return the torque (n,) in the step that ends with these velocities (n,) of the joints."""
        return self.torque - self.inertia * (rates - self._rates) / self._h

    def correct(self, rates: Floats) -> bool:
        """Correct which motors are at their limits, if the step ends with these velocities (n,); return
        whether any was wrong."""
        if not self._limited:
            return False
        wanted = self._b - self._K * (rates - self._rates) / self._h
        most = self._most * (1.0 + ROUNDING)
        held = np.where(wanted > most, 1.0, np.where(wanted < -most, -1.0, 0.0))
        # A motor goes from one limit to the other by way of its law.
        held = self._held + np.clip(held - self._held, -1.0, 1.0)
        if self._corrections >= BLOCK_CORRECTIONS:
            held = np.where(self._held == 0.0, held, self._held)
        changed = bool((held != self._held).any())
        self._held, self._corrections = held, self._corrections + 1
        return changed
