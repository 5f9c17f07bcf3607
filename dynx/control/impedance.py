"""Impedance control: the frame is tied to its reference by a spring and a damper, and may be pushed away."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dynx.backends import Backend
from dynx.control.base import Measurement
from dynx.control.gains import checked_gain
from dynx.control.task_space import TaskSpace
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint


class Impedance(TaskSpace[None]):
    """tau = J' (K e + D e') + g(q) - B v, without shaping the inertia.

    Passive with a reference at rest: whatever it touches, it cannot gain energy (Hogan 1985; Siciliano et
    al., Robotics, section 9.2). A steady force F displaces the frame by F / K.
    """

    def __init__(
        self,
        model: Model,
        frame: str,
        *,
        stiffness: ArrayLike,
        damping: ArrayLike,
        joint_damping: ArrayLike = 0.0,
        backend: str | Backend = "pinocchio",
    ) -> None:
        """`stiffness` K [N/m, N m/rad] and `damping` D [N s/m, N m s/rad] along the world's axes.

        (6,), linear then angular, or one number; `joint_damping` B (nv,) calms what the frame does not
        see. Raises GainError, UnknownNameError for the frame.
        """
        super().__init__(model, frame, backend)
        self.stiffness = checked_gain("stiffness", stiffness, 6, per="linear then angular")
        self.damping = checked_gain("damping", damping, 6, per="linear then angular")
        self.joint_damping = checked_gain("joint_damping", joint_damping, model.nv)

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        """The torque (nv,)."""
        error = self._error(measurement, setpoint)
        wrench = self.stiffness * error.pose + self.damping * error.twist
        weight = self._dynamics.gravity_torque(measurement.q)
        return weight + error.jacobian.T @ wrench - self.joint_damping * measurement.v, None
