"""A frame of the robot and where it is wanted: what the laws in the space of a task share."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dynx.backends import Backend
from dynx.control.base import ControllerState, Measurement, ModelBased
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import pose_error
from dynx.trajectory.base import Setpoint


class TaskError(NamedTuple):
    """What is left to the wanted motion of a frame: linear, then angular, along the world's axes."""

    pose: Floats
    """(6,): metres, then a rotation vector [rad]."""
    twist: Floats
    """(6,): metres and radians per second."""
    jacobian: Floats
    """J (6, nv) of the frame where it is."""


class TaskSpace(ModelBased[ControllerState]):
    """A law about one frame. The setpoint is in joint space as for every law: what it wants of the frame is
    the pose, the velocity and the acceleration that the frame has there."""

    def __init__(self, model: Model, frame: str, backend: str | Backend) -> None:
        super().__init__(model, backend)
        model.frame_index(frame)
        self.frame = frame

    @property
    def _engine(self) -> Backend:
        return self._dynamics.backend

    def _error(self, measurement: Measurement, setpoint: Setpoint) -> TaskError:
        engine, frame = self._engine, self.frame
        J = engine.jacobian(measurement.q, frame)
        wanted = engine.forward_kinematics(setpoint.q, frame)
        linear, angular = pose_error(wanted, engine.forward_kinematics(measurement.q, frame))
        wanted_twist = engine.jacobian(setpoint.q, frame) @ setpoint.v
        return TaskError(np.concatenate([linear, angular]), wanted_twist - J @ measurement.v, J)
