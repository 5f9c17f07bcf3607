"""The motors that PyBullet has of its own, as controllers that only its plant understands.

They are constraints of its solver and not laws of torque: how hard a motor pulls follows from the step
itself. So they give a `MotorCommand`, and their `torque` refuses.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dynx.control.base import Controller, Measurement
from dynx.control.gains import checked_gain
from dynx.control.saturation import checked_limit
from dynx.errors import UnsupportedFeatureError
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint

AMPLE = 1e30
"""What stands for no limit [N m or N]: Bullet multiplies it by the time step, and infinity makes NaN."""


class MotorCommand(NamedTuple):
    """What `setJointMotorControlArray` is told: one number per joint each, None for the engine's default."""

    mode: str
    positions: list[float] | None = None
    velocities: list[float] | None = None
    forces: list[float] | None = None
    position_gains: list[float] | None = None
    velocity_gains: list[float] | None = None


class EngineMotor(Controller[None]):
    """A motor mode of PyBullet; ``plant="pybullet"`` takes it, no other plant can."""

    def __init__(self, model: Model) -> None:
        if model.mechanism.coupling is not None:
            raise UnsupportedFeatureError(
                f"PyBullet's motors know nothing of the mimic joints of {model.name}; lock them, or use a law"
            )
        self.model = model
        base = 6 if model.floating else 0
        self._n_joints = model.nv - base
        self._q_joints = slice(base + 1 if base else 0, None)
        self._v_joints = slice(base, None)

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        """Raises UnsupportedFeatureError: the engine's solver finds the torque, within its step."""
        raise UnsupportedFeatureError(
            f"{self.name} is a motor inside PyBullet, so it runs with plant='pybullet' only"
        )

    @abstractmethod
    def command(self, measurement: Measurement, setpoint: Setpoint) -> MotorCommand:
        """What the motors of all joints are told."""

    def _per_joint(self, name: str, number: ArrayLike) -> list[float]:
        gains: list[float] = checked_gain(name, number, self._n_joints, per="one for each joint").tolist()
        return gains

    def _forces(self, force: ArrayLike | None) -> list[float] | None:
        """The most the motors may pull, the engine's default (which is ample) where none is given."""
        if force is None:
            return None
        limits = checked_limit(self.model, force)[self._v_joints]
        full: list[float] = np.minimum(limits, AMPLE).tolist()
        return full


class PositionMotor(EngineMotor):
    """POSITION_CONTROL: each step ends at v = kd v* + kp (q* - q) / dt, if the force suffices.

    `position_gain` and `velocity_gain` are fractions of an error that one step removes, with the engine's
    defaults 0.1 and 1.
    """

    def __init__(
        self,
        model: Model,
        *,
        position_gain: ArrayLike = 0.1,
        velocity_gain: ArrayLike = 1.0,
        force: ArrayLike | None = None,
    ) -> None:
        """`force` [N m or N] is the most a motor gives; the engine's default if None."""
        super().__init__(model)
        self._position_gain = self._per_joint("position_gain", position_gain)
        self._velocity_gain = self._per_joint("velocity_gain", velocity_gain)
        self._force = self._forces(force)

    def command(self, measurement: Measurement, setpoint: Setpoint) -> MotorCommand:
        """Position and velocity of the setpoint."""
        return MotorCommand(
            "POSITION_CONTROL",
            positions=setpoint.q[self._q_joints].tolist(),
            velocities=setpoint.v[self._v_joints].tolist(),
            forces=self._force,
            position_gains=self._position_gain,
            velocity_gains=self._velocity_gain,
        )


class VelocityMotor(EngineMotor):
    """VELOCITY_CONTROL: each step ends at the wanted velocity, if the force suffices."""

    def __init__(self, model: Model, *, force: ArrayLike | None = None) -> None:
        """`force` [N m or N] is the most a motor gives; the engine's default if None."""
        super().__init__(model)
        self._force = self._forces(force)

    def command(self, measurement: Measurement, setpoint: Setpoint) -> MotorCommand:
        """Velocity of the setpoint."""
        velocities = setpoint.v[self._v_joints].tolist()
        return MotorCommand("VELOCITY_CONTROL", velocities=velocities, forces=self._force)


class PDMotor(EngineMotor):
    """PD_CONTROL: tau = kp (q* - q) + kd (v* - v), computed inside the engine."""

    def __init__(self, model: Model, *, kp: ArrayLike, kd: ArrayLike, force: ArrayLike | None = None) -> None:
        """`kp` [N m/rad] and `kd` [N m s/rad], one number or one for each joint; `force` the most."""
        super().__init__(model)
        self._kp = self._per_joint("kp", kp)
        self._kd = self._per_joint("kd", kd)
        self._force = self._forces(force)

    def command(self, measurement: Measurement, setpoint: Setpoint) -> MotorCommand:
        """Position and velocity of the setpoint, and the gains."""
        return MotorCommand(
            "PD_CONTROL",
            positions=setpoint.q[self._q_joints].tolist(),
            velocities=setpoint.v[self._v_joints].tolist(),
            forces=self._force,
            position_gains=self._kp,
            velocity_gains=self._kd,
        )


class TorqueMotor(EngineMotor):
    """TORQUE_CONTROL: the torque of another law, given to the engine's motors as it stands.

    It is what the plant does with any law; the class is there so that all four modes have a name.
    """

    def __init__(self, inner: Controller[None]) -> None:
        """`inner` is a controller without a state of its own."""
        super().__init__(inner.model)
        self.inner = inner
        self.lead, self.control_dt = inner.lead, inner.control_dt
        self.needs_setpoint = inner.needs_setpoint

    def command(self, measurement: Measurement, setpoint: Setpoint) -> MotorCommand:
        """The inner law's joint torques."""
        tau, _ = self.inner.torque(measurement, setpoint, None)
        return MotorCommand("TORQUE_CONTROL", forces=tau[self._v_joints].tolist())
