"""Computed torque: inverse dynamics of an acceleration that makes the error converge to zero, and for a plant
in discrete time the inverse of its integration step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.backends import Backend
from dynx.control.ball_setpoints import in_present_axes, position_error
from dynx.control.base import Measurement, ModelBased, gain, parameter
from dynx.control.gains import feedback_gains
from dynx.model import Model
from dynx.model.numbers import positive_seconds
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.scalar import Array, Floats
from dynx.trajectory.base import Setpoint


@checks_types
@dataclass(frozen=True)
class ComputedTorque(ModelBased[None], pure=True):
    """tau = ID(q, v, a* + kd (v* - v) + kp (q* - q)).

    ID is inverse dynamics; q*, v* and a* are the setpoint. If the model is exact, the error e of each
    coordinate obeys e'' + kd e' + kp e = 0, independent of the other coordinates (Spong, Hutchinson and
    Vidyasagar, Robot Modeling and Control, section 8.3). In discrete time an error of about
    dt a* kd / (2 kp) remains; `DiscreteComputedTorque` avoids this error. With `joint_dynamics` ID includes
    the joint dynamics of the description.
    """

    kp: Floats = gain("1/s^2")
    kd: Floats = gain("1/s")

    def __init__(
        self,
        model: Model,
        *,
        kp: ArrayLike | None = None,
        kd: ArrayLike | None = None,
        natural_frequency: ArrayLike | None = None,
        damping_ratio: ArrayLike = 1.0,
        joint_dynamics: bool = False,
        backend: str | Backend = DEFAULT_ENGINE,
    ) -> None:
        """Gains `kp` [1/s^2] and `kd` [1/s], or `natural_frequency` [rad/s] and `damping_ratio`.

        One number, or one for each coordinate. Raises GainError.
        """
        super().__init__(model, backend, joint_dynamics)
        kp, kd = feedback_gains(model.nv, kp, kd, natural_frequency, damping_ratio)
        self._set(kp=kp, kd=kd)

    @checks_types
    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        _, q, v = measurement
        a = commanded_acceleration(q, v, *setpoint, self.kp, self.kd, self.model.ball_places)
        return self.with_joint_dynamics(self.dynamics.inverse_dynamics(q, v, a), q, v, a, setpoint.v), None


def commanded_acceleration(
    q: Array,
    v: Array,
    q_wanted: Array,
    v_wanted: Array,
    a_wanted: Array,
    kp: Array,
    kd: Array,
    balls: Sequence[int] = (),
) -> Array:
    """Return a* + kd (v* - v) + kp (q* - q), for arrays of any scalar; `dynx.control.ball_setpoints` has the
    errors of ball joints, whose quaternions begin at `balls`."""
    v_wanted, a_wanted = in_present_axes(q, v, q_wanted, v_wanted, a_wanted, balls)
    a: Array = a_wanted + kd * (v_wanted - v) + kp * position_error(q, q_wanted, balls)
    return a


@checks_types
@dataclass(frozen=True)
class DiscreteComputedTorque(ModelBased[None], pure=True):
    """Torque with which one step of semi-implicit Euler ends exactly at the next setpoint.

    The step of Bullet, and dynx's default, is v' = v + dt a, q' = q + dt v'. The controller solves these
    equations for a = ((q* - q) / dt - v) / dt, where q* is the setpoint at the end of the step. Only rounding
    errors remain. The controller removes an initial error in one step, however large the torque.

    The controller is exact under two conditions. The control step equals the step of the plant. The plant has
    no joint dynamics, or the controller knows them (`joint_dynamics`). With another plant (RK4, sub-steps) an
    error of the order of dt remains.
    """

    control_dt: float = parameter("s")

    lead = 1

    def __init__(
        self,
        model: Model,
        *,
        control_dt: float,
        joint_dynamics: bool = False,
        backend: str | Backend = DEFAULT_ENGINE,
    ) -> None:
        """`control_dt` [s] is the control step, equal to the step of the plant.

        Raises ArgumentError if it is not positive.
        """
        super().__init__(model, backend, joint_dynamics)
        self._set(control_dt=positive_seconds("control_dt", control_dt))

    @checks_types
    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        """Return the torque (nv,); `setpoint` is the setpoint at the end of the step."""
        _, q, v = measurement
        dt = self.control_dt
        balls, tau_of = self.model.ball_places, self.dynamics.inverse_dynamics
        a = one_step_acceleration(q, v, setpoint.q, dt, balls)
        v_next = position_error(q, setpoint.q, balls) / dt
        return self.with_joint_dynamics(tau_of(q, v, a), q, v, a, v_next, dt), None


def one_step_acceleration(
    q: Array, v: Array, q_next: Array, dt: Array | float, balls: Sequence[int] = ()
) -> Array:
    """Solve q + dt (v + dt a) = q_next for a, for arrays of any scalar type; a ball joint, whose quaternion
    begins at one of `balls`, turns by the rotation vector dt (v + dt a)."""
    a: Array = (position_error(q, q_next, balls) / dt - v) / dt
    return a
