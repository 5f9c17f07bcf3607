"""The motors inside PyBullet, as controllers for its plant alone.

They are constraints of PyBullet's solver, which determines their torque during the step. So they return a
`BulletMotorCommand`, and their `torque` raises an error.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.control.base import Controller, Measurement, gain, parameter, refuse_other_than_controller
from dynx.control.joint_space import JointSpace
from dynx.control.saturation import checked_limit
from dynx.engines.pybullet.motors import BulletMotorCommand, refuse_mimic_joints
from dynx.errors import UnsupportedFeatureError
from dynx.model import Model
from dynx.model.numbers import checked_gain
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint

__all__ = [
    "BulletMotor",
    "BulletMotorCommand",
    "BulletPDMotor",
    "BulletPositionMotor",
    "BulletTorqueMotor",
    "BulletVelocityMotor",
]

UNLIMITED_FORCE = 1e30
"""Force of a motor without a limit [N m or N]; an infinite one becomes NaN in Bullet."""


@dataclass(frozen=True)
class BulletMotor(JointSpace[None]):
    """A motor mode of PyBullet, for ``plant="pybullet"`` alone."""

    def __init__(self, model: Model) -> None:
        refuse_mimic_joints(model, "lock them, or use a controller that computes torques")
        super().__init__(model)

    @checks_types
    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        """Raise UnsupportedFeatureError: the engine's solver determines the torque during the step."""
        raise UnsupportedFeatureError(
            f"{self.name} is a motor inside PyBullet, so it runs with plant='pybullet' only, and inside no "
            "other controller"
        )

    @abstractmethod
    def command(self, measurement: Measurement, setpoint: Setpoint) -> BulletMotorCommand:
        """Return the command to the motors of all joints."""

    def _per_joint(self, name: str, number: ArrayLike) -> Floats:
        return checked_gain(name, number, self.n_joints, per="one for each joint")

    def _limits(self, force: ArrayLike | None) -> Floats | None:
        return None if force is None else checked_limit(self.model, force, "force")[self.v_joints]


def _forces(limits: Floats | None) -> list[float] | None:
    """Convert the limits of the motors to the form that the engine takes; None for its default."""
    if limits is None:
        return None
    finite: list[float] = np.minimum(limits, UNLIMITED_FORCE).tolist()
    return finite


@checks_types
@dataclass(frozen=True)
class BulletPositionMotor(BulletMotor):
    """PyBullet's POSITION_CONTROL: each step ends at v = kd v* + kp (q* - q) / dt, if the force suffices.

    `position_gain` and `velocity_gain` are the fractions of the errors that one step removes; the engine's
    defaults are 0.1 and 1.
    """

    position_gain: Floats = gain("")
    velocity_gain: Floats = gain("")
    force: Floats | None = parameter("N m or N")

    def __init__(
        self,
        model: Model,
        *,
        position_gain: ArrayLike = 0.1,
        velocity_gain: ArrayLike = 1.0,
        force: ArrayLike | None = None,
    ) -> None:
        """`force` [N m or N] is the largest force of a motor; None is the engine's default."""
        super().__init__(model)
        self._set(
            position_gain=self._per_joint("position_gain", position_gain),
            velocity_gain=self._per_joint("velocity_gain", velocity_gain),
            force=self._limits(force),
        )

    def command(self, measurement: Measurement, setpoint: Setpoint) -> BulletMotorCommand:
        """Return the position and velocity of the setpoint."""
        return BulletMotorCommand(
            "POSITION_CONTROL",
            positions=setpoint.q[self.q_joints].tolist(),
            velocities=setpoint.v[self.v_joints].tolist(),
            forces=_forces(self.force),
            position_gains=self.position_gain.tolist(),
            velocity_gains=self.velocity_gain.tolist(),
        )


@checks_types
@dataclass(frozen=True)
class BulletVelocityMotor(BulletMotor):
    """PyBullet's VELOCITY_CONTROL: each step ends at the velocity of the setpoint, if the force suffices."""

    force: Floats | None = parameter("N m or N")

    def __init__(self, model: Model, *, force: ArrayLike | None = None) -> None:
        """`force` [N m or N] is the largest force of a motor; None is the engine's default."""
        super().__init__(model)
        self._set(force=self._limits(force))

    def command(self, measurement: Measurement, setpoint: Setpoint) -> BulletMotorCommand:
        """Return the velocity of the setpoint."""
        velocities = setpoint.v[self.v_joints].tolist()
        return BulletMotorCommand("VELOCITY_CONTROL", velocities=velocities, forces=_forces(self.force))


@checks_types
@dataclass(frozen=True)
class BulletPDMotor(BulletMotor):
    """PyBullet's PD_CONTROL: tau = kp (q* - q) + kd (v* - v), computed inside the engine."""

    kp: Floats = gain("N m/rad or N/m")
    kd: Floats = gain("N m s/rad or N s/m")
    force: Floats | None = parameter("N m or N")

    def __init__(self, model: Model, *, kp: ArrayLike, kd: ArrayLike, force: ArrayLike | None = None) -> None:
        """`kp` [N m/rad] and `kd` [N m s/rad] are one number or one for each joint; `force` [N m or N] is
        the largest force of a motor."""
        super().__init__(model)
        kp, kd = self._per_joint("kp", kp), self._per_joint("kd", kd)
        self._set(kp=kp, kd=kd, force=self._limits(force))

    def command(self, measurement: Measurement, setpoint: Setpoint) -> BulletMotorCommand:
        """Return the position and velocity of the setpoint, and the gains."""
        return BulletMotorCommand(
            "PD_CONTROL",
            positions=setpoint.q[self.q_joints].tolist(),
            velocities=setpoint.v[self.v_joints].tolist(),
            forces=_forces(self.force),
            position_gains=self.kp.tolist(),
            velocity_gains=self.kd.tolist(),
        )


@dataclass(frozen=True)
class BulletTorqueMotor(BulletMotor):
    """PyBullet's TORQUE_CONTROL: the torque of another controller, passed to the engine's motors unchanged.

    The plant ``pybullet`` applies the torque of any controller in this way. The class exists to give all four
    modes a name.
    """

    model: Model = field(init=False)
    inner: Controller[None] = field()

    def __init__(self, inner: Controller[None]) -> None:
        """`inner` is a controller without a state; UnsupportedFeatureError for one that has a state."""
        refuse_other_than_controller("the inner controller", inner)
        super().__init__(inner.model)
        self._wrap(inner)
        if inner.initial_state() is not None:
            raise UnsupportedFeatureError(
                f"{inner.name} has a state, and BulletTorqueMotor takes a controller without one; "
                "plant='pybullet' applies the torque of any controller without BulletTorqueMotor"
            )

    def command(self, measurement: Measurement, setpoint: Setpoint) -> BulletMotorCommand:
        """Return the joint torques of the inner controller."""
        tau, _ = self.inner.torque(measurement, setpoint, None)
        return BulletMotorCommand("TORQUE_CONTROL", forces=tau[self.v_joints].tolist())
