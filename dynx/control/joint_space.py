"""The part of a robot that has motors: its joints, without the six freedoms of a floating base."""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.control.base import Controller, ControllerState
from dynx.model import Model
from dynx.spatial.scalar import Floats


class JointSpace(Controller[ControllerState]):
    """A law that looks at joints alone; on a floating base it commands no force."""

    def __init__(self, model: Model) -> None:
        self.model = model
        base = 6 if model.floating else 0
        self._n_joints = model.nv - base
        self._q_joints = slice(base + 1 if base else 0, None)
        self._v_joints = slice(base, None)
        self._no_force: Floats = np.zeros(base)

    def _of_all(self, joint_torque: Any) -> Floats:
        """The torque (nv,) whose joint part is `joint_torque` (n,)."""
        return np.concatenate([self._no_force, joint_torque]) if self._no_force.size else joint_torque
