"""Friction given back: another law's torque, plus what the joints lose."""

from __future__ import annotations

from typing import Any

from dynx.backends import Backend
from dynx.control.base import Controller, ControllerState, Measurement
from dynx.control.friction import SLIP, Coefficients, JointFriction
from dynx.errors import ArgumentError, shown
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint

SPEEDS = ("measured", "setpoint")


class FrictionCompensation(Controller[ControllerState]):
    """tau = inner law + d v + f tanh(v / slip), with v measured or wanted.

    From the measured speed a plant's own friction cancels exactly, if the coefficients are its own; with
    noise, or with friction overrated, that can drive the joint by itself. The wanted speed cannot.
    """

    def __init__(
        self,
        inner: Controller[ControllerState],
        *,
        damping: Coefficients = True,
        friction: Coefficients = True,
        slip: float = SLIP,
        speed: str = "measured",
    ) -> None:
        """Coefficients as those of `JointFriction`: by default what the model's description says."""
        if speed not in SPEEDS:
            raise ArgumentError(f"speed is {shown(speed)}; wanted one of {', '.join(SPEEDS)}")
        self.inner = inner
        self.model = inner.model
        self.lead, self.control_dt = inner.lead, inner.control_dt
        self.needs_setpoint = inner.needs_setpoint
        self.losses = JointFriction(inner.model, damping, friction, slip)
        self._measured = speed == "measured"
        self._recipe = {"damping": damping, "friction": friction, "slip": slip, "speed": speed}

    def initial_state(self) -> Any:
        """As the inner law starts."""
        return self.inner.initial_state()

    def torque(
        self, measurement: Measurement, setpoint: Setpoint, state: ControllerState
    ) -> tuple[Floats, ControllerState]:
        """The inner law's torque (nv,) and what is lost."""
        tau, state = self.inner.torque(measurement, setpoint, state)
        return tau + self.losses(measurement.v if self._measured else setpoint.v), state

    def on(self, engine: str | Backend) -> FrictionCompensation[ControllerState]:
        """The same with the inner law on another backend."""
        options: Any = self._recipe
        return FrictionCompensation(self.inner.on(engine), **options)

    @property
    def name(self) -> str:
        """That of the law, and that friction is compensated."""
        return f"{self.inner.name}, friction compensated"
