"""Controllers of a frame of the robot: impedance control, a spring and a damper between the frame and its
reference, and operational-space control with linear error dynamics, where the remaining freedom keeps a
posture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.backends import Backend
from dynx.control.base import ControllerState, Measurement, ModelBased, gain, parameter
from dynx.control.computed_torque import commanded_acceleration
from dynx.control.gains import feedback_gains
from dynx.model import Model
from dynx.model.numbers import checked_gain
from dynx.rbd.elimination import solve_mass_matrix
from dynx.rbd.linear import solve_columns
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import pose_error
from dynx.trajectory.base import Setpoint


class FrameMotionError(NamedTuple):
    """Setpoint of a frame minus its measured motion: linear, then angular, along the world's axes."""

    pose: Floats
    """(6,): metres, then a rotation vector [rad]."""
    twist: Floats
    """(6,): metres and radians per second."""
    jacobian: Floats
    """J (6, nv) of the frame at the measured configuration."""


@dataclass(frozen=True)
class TaskSpace(ModelBased[ControllerState]):
    """A controller of one frame.

    The setpoint is in joint space, as for every controller. The setpoint of the frame follows from it by
    forward kinematics: pose, velocity and acceleration.
    """

    frame: str

    def __init__(self, model: Model, frame: str, backend: str | Backend, joint_dynamics: bool) -> None:
        super().__init__(model, backend, joint_dynamics)
        model.frame_index(frame)
        self._set(frame=frame)

    def _error(self, measurement: Measurement, setpoint: Setpoint) -> FrameMotionError:
        dynamics, frame = self.dynamics, self.frame
        J = dynamics.jacobian(measurement.q, frame)
        wanted = dynamics.forward_kinematics(setpoint.q, frame)
        linear, angular = pose_error(wanted, dynamics.forward_kinematics(measurement.q, frame))
        wanted_twist = dynamics.jacobian(setpoint.q, frame) @ setpoint.v
        return FrameMotionError(np.concatenate([linear, angular]), wanted_twist - J @ measurement.v, J)


@checks_types
@dataclass(frozen=True)
class Impedance(TaskSpace[None], pure=True):
    """tau = J' (K e + D e') + g(q) - B v, without shaping the inertia.

    e is the error of the frame, K the `stiffness`, D the `damping` and B the `joint_damping`. For a reference
    at rest the controller is passive: it supplies no energy to its environment (Hogan 1985; Siciliano et al.,
    Robotics, section 9.2). A steady force F displaces the frame by F / K. With `joint_dynamics` the
    controller compensates damping and friction at the setpoint's velocity.
    """

    stiffness: Floats = gain("N/m, N m/rad")
    damping: Floats = gain("N s/m, N m s/rad")
    joint_damping: Floats = gain("N m s/rad or N s/m")

    def __init__(
        self,
        model: Model,
        frame: str,
        *,
        stiffness: ArrayLike,
        damping: ArrayLike,
        joint_damping: ArrayLike = 0.0,
        joint_dynamics: bool = False,
        backend: str | Backend = DEFAULT_ENGINE,
    ) -> None:
        """`stiffness` K [N/m, N m/rad] and `damping` D [N s/m, N m s/rad] along the world's axes are (6,),
        linear then angular, or one number; `joint_damping` B (nv,) damps motions that do not move the frame.
        Raises GainError, UnknownNameError for the frame.
        """
        super().__init__(model, frame, backend, joint_dynamics)
        per = "linear then angular"
        self._set(
            stiffness=checked_gain("stiffness", stiffness, 6, per=per),
            damping=checked_gain("damping", damping, 6, per=per),
            joint_damping=checked_gain("joint_damping", joint_damping, model.nv),
        )

    @checks_types
    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        error = self._error(measurement, setpoint)
        wrench = self.stiffness * error.pose + self.damping * error.twist
        weight = self.dynamics.gravity_torque(measurement.q)
        weight = self.with_joint_dynamics(weight, measurement.q, setpoint.v, 0.0 * setpoint.a, setpoint.v)
        return weight + error.jacobian.T @ wrench - self.joint_damping * measurement.v, None


@checks_types
@dataclass(frozen=True)
class OperationalSpace(TaskSpace[None], pure=True):
    """Computed torque in the space of a frame (Khatib 1987; Siciliano et al., Robotics, section 8.6.2).

    The error e of the frame obeys e'' + kd e' + kp e = 0. Joint accelerations without effect on the frame
    move the posture to the setpoint. Their projector follows from the dynamically consistent inverse J# =
    M^-1 J' (J M^-1 J' + damping^2)^-1. `damping` keeps the torque finite near singular postures, but causes
    an error.
    """

    kp: Floats = gain("1/s^2")
    kd: Floats = gain("1/s")
    posture_kp: Floats = gain("1/s^2")
    posture_kd: Floats = gain("1/s")
    damping: float = parameter("")

    def __init__(
        self,
        model: Model,
        frame: str,
        *,
        kp: ArrayLike | None = None,
        kd: ArrayLike | None = None,
        natural_frequency: ArrayLike | None = None,
        damping_ratio: ArrayLike = 1.0,
        posture_kp: ArrayLike = 0.0,
        posture_kd: ArrayLike = 1.0,
        damping: float = 1e-3,
        joint_dynamics: bool = False,
        backend: str | Backend = DEFAULT_ENGINE,
    ) -> None:
        """Gains of the frame are (6,), linear then angular, or one number. Gains of the posture are (nv,).
        Units are as in `ComputedTorque`. Raises GainError, UnknownNameError for the frame.
        """
        super().__init__(model, frame, backend, joint_dynamics)
        kp, kd = feedback_gains(6, kp, kd, natural_frequency, damping_ratio)
        self._set(
            kp=kp,
            kd=kd,
            posture_kp=checked_gain("posture_kp", posture_kp, model.nv),
            posture_kd=checked_gain("posture_kd", posture_kd, model.nv),
            damping=float(checked_gain("damping", damping, 1)[0]),
        )

    @checks_types
    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        _, q, v = measurement
        dynamics, frame = self.dynamics, self.frame
        error = self._error(measurement, setpoint)
        wanted = dynamics.frame_acceleration(*setpoint, frame) + self.kd * error.twist + self.kp * error.pose
        left = wanted - dynamics.jacobian_derivative(q, v, frame) @ v
        posture = commanded_acceleration(q, v, *setpoint, self.posture_kp, self.posture_kd)
        J = error.jacobian
        M = dynamics.mass_matrix(q)
        if self.joints is not None:
            M = M + np.diag(self.joints.armature)
        inverse = solve_mass_matrix(self.model.mechanism, M, J.T)
        a = (
            posture
            + inverse
            @ solve_columns(J @ inverse + self.damping**2 * np.eye(6), (left - J @ posture)[:, None])[:, 0]
        )
        return self.with_joint_dynamics(dynamics.inverse_dynamics(q, v, a), q, v, a, setpoint.v), None
