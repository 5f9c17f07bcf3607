"""Controllers of the joints of a robot, without the six degrees of freedom of a floating base."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from dynx.control.base import Controller, ControllerState, Measurement
from dynx.model import Model
from dynx.model.model import refuse_other_than_model
from dynx.spatial.scalar import Array
from dynx.trajectory.base import Setpoint


@dataclass(frozen=True)
class JointSpace(Controller[ControllerState]):
    """A controller that reads and moves joints alone; it commands no force on a floating base."""

    model: Model

    def __post_init__(self) -> None:
        refuse_other_than_model(self.model)

    @property
    def n_joints(self) -> int:
        """Number of joints with a coordinate."""
        return len(self.model.joint_names)

    @cached_property
    def q_joints(self) -> slice:
        """Entries of the joints in a configuration."""
        return slice(7 if self.model.floating else 0, None)

    @cached_property
    def v_joints(self) -> slice:
        """Entries of the joints in a velocity."""
        return slice(6 if self.model.floating else 0, None)

    def joint_states(self, measurement: Measurement, setpoint: Setpoint) -> tuple[Array, Array, Array, Array]:
        """Return q and v of the joints as measured, and as the setpoint has them (n,)."""
        q, v = self.q_joints, self.v_joints
        return measurement.q[q], measurement.v[v], setpoint.q[q], setpoint.v[v]

    def all_torques(self, joint_torque: Any) -> Any:
        """Return the torque (nv,) whose joint part is `joint_torque` (n,)."""
        return np.concatenate([np.zeros(6), joint_torque]) if self.model.floating else joint_torque
