"""Controllers of the joints of a robot, without the six degrees of freedom of a floating base.

PD                    tau = kp (q* - q) + kd (v* - v)
PID                   with anti-windup
velocity              tau = kd (v* - v), which lets positions drift
gravity compensation  tau = g(q) + kp (q* - q) + kd (v* - v)
feed-forward          tau = ID(q*, v*, a*)

`dynx.control.ball_setpoints` has the differences q* - q and v* - v of ball joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.backends import Backend
from dynx.control.ball_setpoints import in_present_axes, position_error
from dynx.control.base import (
    Controller,
    ControllerState,
    Measurement,
    ModelBased,
    gain,
    parameter,
    require_state,
)
from dynx.control.saturation import checked_limit
from dynx.model import Model
from dynx.model.numbers import checked_gain, positive_seconds
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.scalar import Array, Floats, clamp
from dynx.trajectory.base import Setpoint


@checks_types
@dataclass(frozen=True)
class JointSpace(Controller[ControllerState]):
    """A controller that reads and moves joints alone; it commands no force on a floating base."""

    model: Model

    @property
    def n_joints(self) -> int:
        """Number of coordinates of the joints, in v: three of a ball joint."""
        return len(self.model.coordinate_names)

    @cached_property
    def balls(self) -> tuple[int, ...]:
        """Indices in the positions of the joints at which the quaternions of ball joints begin."""
        return tuple(place - 7 * self.model.floating for place in self.model.ball_places)

    @cached_property
    def q_joints(self) -> slice:
        """Entries of the joints in a configuration."""
        return slice(7 if self.model.floating else 0, None)

    @cached_property
    def v_joints(self) -> slice:
        """Entries of the joints in a velocity."""
        return slice(6 if self.model.floating else 0, None)

    @checks_types
    def joint_states(self, measurement: Measurement, setpoint: Setpoint) -> tuple[Array, Array, Array, Array]:
        """Return q and v of the joints as measured, and as the setpoint has them."""
        q, v = self.q_joints, self.v_joints
        return measurement.q[q], measurement.v[v], setpoint.q[q], setpoint.v[v]

    def all_torques(self, joint_torque: Any) -> Any:
        """Return the torque (nv,) whose joint part is `joint_torque` (n,)."""
        return np.concatenate([np.zeros(6), joint_torque]) if self.model.floating else joint_torque


@checks_types
@dataclass(frozen=True)
class PD(JointSpace[None], pure=True):
    """A spring and a damper from each joint to its setpoint; it needs no model of the masses.

    Under gravity an arm hangs by g / kp below its setpoint.
    """

    kp: Floats = gain("N m/rad or N/m")
    kd: Floats = gain("N m s/rad or N s/m")

    def __init__(self, model: Model, *, kp: ArrayLike, kd: ArrayLike) -> None:
        """`kp` [N m/rad or N/m] and `kd` [N m s/rad or N s/m]: one number, or one for each joint."""
        super().__init__(model)
        n, per = self.n_joints, "one for each joint"
        self._set(kp=checked_gain("kp", kp, n, per=per), kd=checked_gain("kd", kd, n, per=per))

    @checks_types
    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        states = self.joint_states(measurement, setpoint)
        return self.all_torques(pd_torque(*states, self.kp, self.kd, self.balls)), None


def pd_torque(
    q: Array,
    v: Array,
    q_wanted: Array,
    v_wanted: Array,
    kp: Array,
    kd: Array,
    balls: Sequence[int] = (),
) -> Array:
    """Return kp (q* - q) + kd (v* - v), for arrays of any scalar, with the errors of ball joints that
    `dynx.control.ball_setpoints` defines; their quaternions begin at `balls`."""
    v_wanted, _ = in_present_axes(q, v, q_wanted, v_wanted, v_wanted, balls)
    tau: Array = kp * position_error(q, q_wanted, balls) + kd * (v_wanted - v)
    return tau


@checks_types
@dataclass(frozen=True)
class Velocity(JointSpace[None], pure=True):
    """A damper from each joint to its velocity setpoint; positions are not controlled."""

    kd: Floats = gain("N m s/rad or N s/m")

    def __init__(self, model: Model, *, kd: ArrayLike) -> None:
        """`kd` [N m s/rad or N s/m]: one number, or one for each joint."""
        super().__init__(model)
        self._set(kd=checked_gain("kd", kd, self.n_joints, per="one for each joint"))

    @checks_types
    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        rates = self.v_joints
        return self.all_torques(self.kd * (setpoint.v[rates] - measurement.v[rates])), None


@checks_types
@dataclass(frozen=True)
class PID(JointSpace[Floats], pure=True):
    """tau = kp e + kd e' + z with z' = ki e, saturated at the effort limits.

    Here e is the position error, and z (n,) [N m or N] is the integral part of the torque: the controller
    state. Anti-windup is by back-calculation (Astrom and Murray, Feedback Systems, section 11.4): the torque
    beyond the limits is fed back into z with the time constant `tracking_time`. So z stays within the range
    of the motors.
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

    @checks_types
    def torque(self, measurement: Measurement, setpoint: Setpoint, state: Floats) -> tuple[Floats, Floats]:
        """Return the torque (nv,) within the limits, and the next integral part."""
        require_state(state, self.n_joints, self.n_joints)
        q, v, q_wanted, v_wanted = self.joint_states(measurement, setpoint)
        error = position_error(q, q_wanted, self.balls)
        wanted = state + pd_torque(q, v, q_wanted, v_wanted, self.kp, self.kd, self.balls)
        tau = clamp(wanted, self.limit)
        # A factor above 1 would overcompensate the torque beyond the limits.
        share = min(1.0, self.control_dt / self.tracking_time)
        integral = state + self.control_dt * self.ki * error + share * (tau - wanted)
        return self.all_torques(tau), integral


@checks_types
@dataclass(frozen=True)
class GravityCompensatedPD(ModelBased[None], pure=True):
    """PD control with gravity compensation, without an error at rest.

    The closed loop is globally asymptotically stable for a constant setpoint (Takegaki and Arimoto 1981;
    Siciliano et al., Robotics, section 8.5.1). With `joint_dynamics` the controller also compensates the
    torque of springs, and damping and friction at the setpoint's velocity.
    """

    kp: Floats = gain("N m/rad or N/m")
    kd: Floats = gain("N m s/rad or N s/m")

    def __init__(
        self,
        model: Model,
        *,
        kp: ArrayLike,
        kd: ArrayLike,
        joint_dynamics: bool = False,
        backend: str | Backend = DEFAULT_ENGINE,
    ) -> None:
        """Gains are those of `PD`."""
        super().__init__(model, backend, joint_dynamics)
        self._set(kp=checked_gain("kp", kp, model.nv), kd=checked_gain("kd", kd, model.nv))

    @checks_types
    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        weight = self.dynamics.gravity_torque(measurement.q)
        weight = self.with_joint_dynamics(weight, measurement.q, setpoint.v, 0.0 * setpoint.a, setpoint.v)
        return weight + pd_torque(
            measurement.q,
            measurement.v,
            setpoint.q,
            setpoint.v,
            self.kp,
            self.kd,
            self.model.ball_places,
        ), None


@checks_types
@dataclass(frozen=True)
class FeedForward(ModelBased[None], pure=True):
    """Inverse dynamics of the setpoint; if gains are given, also PD control of the error.

    Without gains no feedback corrects errors, and gravity makes them grow.
    """

    kp: Floats = gain("N m/rad or N/m")
    kd: Floats = gain("N m s/rad or N s/m")

    def __init__(
        self,
        model: Model,
        *,
        kp: ArrayLike = 0.0,
        kd: ArrayLike = 0.0,
        joint_dynamics: bool = False,
        backend: str | Backend = DEFAULT_ENGINE,
    ) -> None:
        """Gains `kp` and `kd` are those of `PD`; by default there are none."""
        super().__init__(model, backend, joint_dynamics)
        self._set(kp=checked_gain("kp", kp, model.nv), kd=checked_gain("kd", kd, model.nv))

    @checks_types
    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        tau = self.dynamics.inverse_dynamics(*setpoint)
        tau = self.with_joint_dynamics(tau, setpoint.q, setpoint.v, setpoint.a, setpoint.v)
        (_, q, v), balls = measurement, self.model.ball_places
        return tau + pd_torque(q, v, setpoint.q, setpoint.v, self.kp, self.kd, balls), None
