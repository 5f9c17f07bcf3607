"""Motors that follow a torque late, and encoders of finite resolution, between a controller and the robot."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.control.base import Controller, Measurement, Wrapper, parameter, require_state
from dynx.errors import ArgumentError, UnsupportedFeatureError, shown
from dynx.model.ball_joints import refuse_ball_joints
from dynx.model.numbers import checked_gain, is_real, positive_seconds, real_array
from dynx.spatial.scalar import Array, Floats, arctan2
from dynx.trajectory.base import Setpoint

MAX_DELAY_STEPS = 10_000
"""Largest number of control steps by which a torque is delayed."""


@dataclass(frozen=True)
class _StatefulWrapper(Wrapper[Floats]):
    """A wrapper with a state of its own, which precedes that of the inner controller."""

    def _with_step(self, inner: Controller[Any], control_dt: float) -> float:
        """Wrap `inner` and return the control step [s]; raise ArgumentError if `inner` has another."""
        Wrapper.__init__(self, inner)
        state = inner.initial_state()
        if not (state is None or (isinstance(state, np.ndarray) and state.ndim == 1)):
            raise UnsupportedFeatureError(
                f"{inner.name} has a state of type {type(state).__name__}; {type(self).__name__} takes a "
                "controller without one, or with an array (n,)"
            )
        dt = positive_seconds("control_dt", control_dt)
        if inner.control_dt is not None and inner.control_dt != dt:
            raise ArgumentError(
                f"control_dt is {dt:g} s, but {inner.name} has steps of {inner.control_dt:g} s"
            )
        return dt

    def _joined(self, *own: Array) -> Floats:
        """Return the initial state: its own parts, and that of the inner controller."""
        inner = self.inner.initial_state()
        return np.concatenate([*own, *([] if inner is None else [inner])])

    def _inner_torque(
        self, measurement: Measurement, setpoint: Setpoint, state: Floats
    ) -> tuple[Floats, list[Floats]]:
        """Return the torque of the inner controller and its next state, in a list that may be empty."""
        inner: Controller[Any] = self.inner
        tau, after = inner.torque(measurement, setpoint, state if len(state) else None)
        return tau, [] if after is None else [after]


@dataclass(frozen=True)
class MotorLag(_StatefulWrapper, pure=True):
    """Another controller whose torque acts through motors: `delay` later, with a lag of first order.

    The torque y of the motor obeys dy/dt = (u - y) / time_constant. Here u is the delayed torque of the inner
    controller, which is constant in a control step. The plant gets the mean of y over each step, so the
    impulse is exact. The controller state has the torques that are delayed (delay / control_dt, nv), and y.
    """

    control_dt: float = parameter("s")
    time_constant: Floats = parameter("s")
    delay: float = parameter("s")
    initial: Floats = parameter("N m or N")

    def __init__(
        self,
        inner: Controller[Any],
        *,
        control_dt: float,
        time_constant: ArrayLike = 0.0,
        delay: float = 0.0,
        initial: ArrayLike | None = None,
    ) -> None:
        """`control_dt` [s] is the control step, `time_constant` [s] one number or one for each coordinate
        (nv,), `delay` [s] a multiple of `control_dt`; `initial` (nv,) is the torque at the start, 0 by
        default.

        Raises GainError for an invalid time constant, and ArgumentError for a delay that is no multiple.
        """
        dt = self._with_step(inner, control_dt)
        if not is_real(delay) or not 0.0 <= delay <= MAX_DELAY_STEPS * dt:
            most = f"{MAX_DELAY_STEPS * dt:g} s ({MAX_DELAY_STEPS} control steps)"
            raise ArgumentError(f"delay is {shown(delay)}; wanted 0 to {most}")
        if abs(delay / dt - round(delay / dt)) > 1e-6:
            raise ArgumentError(f"delay is {delay:g} s; wanted a multiple of control_dt = {dt:g} s")
        nv = inner.model.nv
        start = np.zeros(nv) if initial is None else real_array("initial", initial)
        if start.shape != (nv,) or not np.isfinite(start).all():
            raise ArgumentError(f"initial is {shown(initial)}; wanted {nv} finite torques")
        self._set(
            control_dt=dt,
            time_constant=checked_gain("time_constant", time_constant, nv),
            delay=float(delay),
            initial=start,
        )

    def initial_state(self) -> Floats:
        """Return the state before the first step: delayed torques and motor torques are `initial`."""
        return self._joined(np.tile(self.initial, self._steps + 1))

    @checks_types
    def torque(self, measurement: Measurement, setpoint: Setpoint, state: Floats) -> tuple[Floats, Floats]:
        """Return the mean torque (nv,) of the motor in this step."""
        nv, k = self.model.nv, self._steps
        require_state(state, (k + 1) * nv)
        way, motor = state[: k * nv], state[k * nv : (k + 1) * nv]
        tau, after = self._inner_torque(measurement, setpoint, state[(k + 1) * nv :])
        way = np.concatenate([way, tau])
        wanted = way[:nv]
        # Over a step y - u decays from its value at the beginning by `left`, and is `mean` of it on average.
        ratio = self.control_dt / np.maximum(self.time_constant, 1e-300)
        left = np.where(self.time_constant > 0.0, np.exp(-ratio), 0.0)
        mean = np.where(self.time_constant > 0.0, (1.0 - left) / ratio, 0.0)
        lag = motor - wanted
        return wanted + mean * lag, np.concatenate([way[nv:], wanted + left * lag, *after])

    @property
    def name(self) -> str:
        """Name of the inner controller, followed by a word for the motors."""
        return f"{self.inner.name}, with motor lag"

    @property
    def _steps(self) -> int:
        return round(self.delay / self.control_dt)


@dataclass(frozen=True)
class Encoders(_StatefulWrapper, pure=True):
    """Another controller that measures by encoders: positions are whole multiples of `resolution`.

    A velocity is the difference of two such positions, divided by `control_dt`; in the first step it is 0.
    The simulation applies its noise and delay before the encoders round. The controller state has the last
    position (n,) in multiples of `resolution`, and whether a last position exists. Encoders do not measure
    the pose and the twist of a floating base.
    """

    control_dt: float = parameter("s")
    resolution: Floats = parameter("rad or m")

    def __init__(self, inner: Controller[Any], *, resolution: ArrayLike, control_dt: float) -> None:
        """`resolution` [rad or m] is one number or one for each joint (n,): 2 pi / counts of an encoder on
        the side of the joint; `control_dt` [s] is the control step.

        Raises GainError for a resolution that is not above 0, ArgumentError for an invalid control step.
        """
        dt = self._with_step(inner, control_dt)
        refuse_ball_joints(inner.model, "control.Encoders")
        n = len(inner.model.joint_names)
        steps = checked_gain("resolution", resolution, n, per="one for each joint")
        if not steps.all():
            raise ArgumentError("resolution is 0; wanted a position above 0 [rad or m]")
        self._set(control_dt=dt, resolution=steps)

    def initial_state(self) -> Floats:
        """Return the state before the first step: zeros, and 0 because there is no last position."""
        return self._joined(np.zeros(len(self.resolution) + 1))

    @checks_types
    def torque(self, measurement: Measurement, setpoint: Setpoint, state: Floats) -> tuple[Floats, Floats]:
        """Return the torque (nv,) of the inner controller for the positions that the encoders show."""
        n = len(self.resolution)
        require_state(state, n + 1)
        t, q, v = measurement
        base_q, base_v = len(q) - n, len(v) - n
        counts = _rounded(q[base_q:] / self.resolution)
        rate = state[n] * (counts - state[:n]) * (self.resolution / self.control_dt)
        seen = Measurement(
            t,
            np.concatenate([q[:base_q], counts * self.resolution]),
            np.concatenate([v[:base_v], rate]),
        ).with_random(measurement.random)
        tau, after = self._inner_torque(seen, setpoint, state[n + 1 :])
        return tau, np.concatenate([counts, np.ones(1), *after])

    @property
    def name(self) -> str:
        """Name of the inner controller, followed by a word for the encoders."""
        return f"{self.inner.name}, by encoders"


def _rounded(x: Array) -> Any:
    """Round to whole numbers, with an error of some 1e-16 |x|: kernels have no operation for it."""
    sine, cosine = np.sin(math.tau * x), np.cos(math.tau * x)
    return x - arctan2(sine, cosine) / math.tau
