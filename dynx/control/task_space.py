"""The error of a frame of the robot, on which the task-space controllers act."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dynx.backends import Backend
from dynx.control.base import ControllerState, Measurement, ModelBased
from dynx.model import Model
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

    def __init__(self, model: Model, frame: str, backend: str | Backend) -> None:
        super().__init__(model, backend)
        model.frame_index(frame)
        self._set(frame=frame)

    def _error(self, measurement: Measurement, setpoint: Setpoint) -> FrameMotionError:
        dynamics, frame = self.dynamics, self.frame
        J = dynamics.jacobian(measurement.q, frame)
        wanted = dynamics.forward_kinematics(setpoint.q, frame)
        linear, angular = pose_error(wanted, dynamics.forward_kinematics(measurement.q, frame))
        wanted_twist = dynamics.jacobian(setpoint.q, frame) @ setpoint.v
        return FrameMotionError(np.concatenate([linear, angular]), wanted_twist - J @ measurement.v, J)
