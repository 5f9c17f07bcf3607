"""Compensation of joint friction, which adds the torque of friction to that of another controller."""

from __future__ import annotations

from dataclasses import dataclass, field

from dynx.argument_types import checks_types
from dynx.backends.joint_friction import SLIP, Coefficients, JointFriction, coefficients_by_joint
from dynx.control.base import Controller, ControllerState, Measurement, Wrapper, parameter
from dynx.errors import ArgumentError, shown
from dynx.model import Model
from dynx.model.numbers import checked_gain
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint

SPEEDS = ("measured", "setpoint")


@dataclass(frozen=True)
class FrictionCompensation(Wrapper[ControllerState], pure=True):
    """Torque of another controller plus d v + f tanh(v / slip), where v is measured or that of the setpoint.

    By default v is the measured velocity. If the coefficients equal those of the plant, the compensation
    cancels the friction of a moving joint. Noise or overestimated friction may make the joint unstable. A
    joint that sticks gets no compensation, because its velocity is 0.

    With ``speed="setpoint"`` v is the velocity of the setpoint. The compensation cannot make the joint
    unstable, and moves a joint that sticks. With ``slip=0`` it does so as soon as the setpoint moves.
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
        damping: Coefficients | None = None,
        friction: Coefficients | None = None,
        slip: float = SLIP,
        speed: str = "measured",
    ) -> None:
        """The coefficients are as in `JointFriction`. If you give neither, both are those of the description.
        If you give only one, the other is 0.
        """
        if damping is None and friction is None:
            damping = friction = True
        damping, friction = (False if each is None else each for each in (damping, friction))
        if not isinstance(speed, str) or speed not in SPEEDS:
            raise ArgumentError(f"speed is {shown(speed)}; wanted one of {', '.join(SPEEDS)}")
        super().__init__(inner)
        losses = JointFriction(inner.model, damping, friction, slip)
        self._set(
            damping=kept_coefficients(inner.model, "damping", damping),
            friction=kept_coefficients(inner.model, "friction", friction),
            slip=losses.slip,
            speed=speed,
            losses=losses,
        )

    @checks_types
    def torque(
        self, measurement: Measurement, setpoint: Setpoint, state: ControllerState
    ) -> tuple[Floats, ControllerState]:
        """Return the torque (nv,) of the inner controller plus the friction torque."""
        tau, state = self.inner.torque(measurement, setpoint, state)
        return tau + self.losses(measurement.v if self.speed == "measured" else setpoint.v), state

    @property
    def name(self) -> str:
        """Name of the inner controller, followed by a word for the compensation."""
        return f"{self.inner.name}, friction compensated"


def kept_coefficients(model: Model, name: str, given: Coefficients) -> bool | Floats:
    """Return coefficients as an object keeps them: True or False as given, numbers as an array with one for
    each joint. Raises GainError and UnknownNameError for invalid ones."""
    if isinstance(given, bool):
        return given
    return checked_gain(name, coefficients_by_joint(model, name, given), len(model.coordinate_names))
