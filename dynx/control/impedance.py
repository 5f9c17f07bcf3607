"""Impedance control: a spring and a damper between a frame and its reference."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike

from dynx.backends import Backend
from dynx.control.base import Measurement, gain
from dynx.control.gains import checked_gain
from dynx.control.task_space import TaskSpace
from dynx.model import Model
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint


@dataclass(frozen=True)
class Impedance(TaskSpace[None], pure=True):
    """tau = J' (K e + D e') + g(q) - B v, without shaping the inertia.

    It is passive for a reference at rest: it supplies no energy to its environment (Hogan 1985; Siciliano et
    al., Robotics, section 9.2). A steady force F displaces the frame by F / K.
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
        backend: str | Backend = DEFAULT_ENGINE,
    ) -> None:
        """`stiffness` K [N/m, N m/rad] and `damping` D [N s/m, N m s/rad] along the world's axes.

        (6,), linear then angular, or one number; `joint_damping` B (nv,) damps motions that do not move the
        frame. Raises GainError, UnknownNameError for the frame.
        """
        super().__init__(model, frame, backend)
        per = "linear then angular"
        self._set(
            stiffness=checked_gain("stiffness", stiffness, 6, per=per),
            damping=checked_gain("damping", damping, 6, per=per),
            joint_damping=checked_gain("joint_damping", joint_damping, model.nv),
        )

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        error = self._error(measurement, setpoint)
        wrench = self.stiffness * error.pose + self.damping * error.twist
        weight = self.dynamics.gravity_torque(measurement.q)
        return weight + error.jacobian.T @ wrench - self.joint_damping * measurement.v, None
