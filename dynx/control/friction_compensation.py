"""Compensation of joint friction: the torque of another controller plus that of friction."""

from __future__ import annotations

from dataclasses import dataclass, field

from dynx.control.base import Controller, ControllerState, Measurement, Wrapper, parameter
from dynx.control.friction import SLIP, Coefficients, JointFriction
from dynx.control.gains import checked_gain
from dynx.errors import ArgumentError, shown
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint

SPEEDS = ("measured", "setpoint")


@dataclass(frozen=True)
class FrictionCompensation(Wrapper[ControllerState], pure=True):
    """tau = inner torque + d v + f tanh(v / slip), with v measured or of the setpoint.

    With the measured speed the friction of a plant cancels exactly, if the coefficients are those of the
    plant; with noise, or with friction overestimated, the joint may become unstable. With the speed of the
    setpoint it cannot.
    """

    damping: bool | Floats = parameter("N m s/rad or N s/m")
    friction: bool | Floats = parameter("N m or N")
    slip: float = parameter("rad/s or m/s")
    speed: str = parameter("")
    losses: JointFriction = field(init=False, repr=False)

    def __init__(
        self,
        inner: Controller[ControllerState],
        *,
        damping: Coefficients = True,
        friction: Coefficients = True,
        slip: float = SLIP,
        speed: str = "measured",
    ) -> None:
        """Coefficients as those of `JointFriction`: by default those of the model's description."""
        if speed not in SPEEDS:
            raise ArgumentError(f"speed is {shown(speed)}; wanted one of {', '.join(SPEEDS)}")
        super().__init__(inner)
        self._set(
            damping=_coefficients(inner.model, "damping", damping),
            friction=_coefficients(inner.model, "friction", friction),
            slip=float(slip),
            speed=speed,
            losses=JointFriction(inner.model, damping, friction, slip),
        )

    def torque(
        self, measurement: Measurement, setpoint: Setpoint, state: ControllerState
    ) -> tuple[Floats, ControllerState]:
        """Return the torque (nv,) of the inner controller plus that of friction."""
        tau, state = self.inner.torque(measurement, setpoint, state)
        return tau + self.losses(measurement.v if self.speed == "measured" else setpoint.v), state

    @property
    def name(self) -> str:
        """Name of the inner controller, and that friction is compensated."""
        return f"{self.inner.name}, friction compensated"


def _coefficients(model: Model, name: str, given: Coefficients) -> bool | Floats:
    """True or False as given, numbers as an array with one for each joint."""
    return given if isinstance(given, bool) else checked_gain(name, given, len(model.joint_names))
