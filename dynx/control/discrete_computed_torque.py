"""Computed torque for a plant that moves in steps: the inverse of its integration step."""

from __future__ import annotations

from dataclasses import dataclass

from dynx.backends import Backend
from dynx.control.base import Measurement, ModelBased, parameter
from dynx.control.gains import positive_seconds
from dynx.model import Model
from dynx.spatial.scalar import Array, Floats
from dynx.trajectory.base import Setpoint


@dataclass(frozen=True)
class DiscreteComputedTorque(ModelBased[None], pure=True):
    """The torque with which one step of semi-implicit Euler ends at the next setpoint, exactly.

    The step v' = v + dt a, q' = q + dt v', which Bullet takes and dynx by default, is solved for a:
    a = ((q* - q) / dt - v) / dt with q* wanted at the end of the step. The tracking error is round-off;
    an error that was there is gone after one step, with whatever torque that takes, and speeds follow
    the secants of the reference.

    It is exact while the control step is the physics step, and for rigid bodies: with friction wrap it in
    `FrictionCompensation`. Another plant (RK4, sub-steps) leaves an error of the order of dt.
    """

    control_dt: float = parameter("s")

    lead = 1

    def __init__(self, model: Model, *, control_dt: float, backend: str | Backend = "pinocchio") -> None:
        """`control_dt` [s] is the plant's step. Raises ArgumentError if it is not positive."""
        super().__init__(model, backend)
        self._set(control_dt=positive_seconds("control_dt", control_dt))

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        """Return the torque (nv,); the setpoint is that of the end of the step."""
        _, q, v = measurement
        a = one_step_acceleration(q, v, setpoint.q, self.control_dt)
        return self.dynamics.inverse_dynamics(q, v, a), None


def one_step_acceleration(q: Array, v: Array, q_next: Array, dt: Array | float) -> Array:
    """Return the a with q + dt (v + dt a) = q_next, for arrays of any scalar."""
    a: Array = ((q_next - q) / dt - v) / dt
    return a
