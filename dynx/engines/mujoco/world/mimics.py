"""Torques that keep mimic joints coupled, so that they follow exactly where nothing touches the robot.

MuJoCo couples joints by soft equality constraints only. Here the torque of every joint is chosen so that the
acceleration of the tree is that of the coupled robot: with v_tree = S v and the equation of motion
M a = tau - b of the tree, the coupled robot has (S' M S) a = tau - S' b, and the tree needs the torque
M S a + b. The constraints are then idle, except where contacts and limits act on mimic joints.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.engines.mujoco.library import mujoco
from dynx.spatial.scalar import Floats
from dynx.steppers.layout import RobotLayout


class CoupledRobot:
    """A robot with mimic joints: its torque in coordinates of the model, and the torque of its tree."""

    def __init__(self, robot: RobotLayout, first: int, dt: float) -> None:
        """`first` is the index in MuJoCo's v at which the robot begins."""
        coupling = robot.model.mechanism.coupling
        if coupling is None:
            raise AssertionError("a robot without mimic joints")
        self._S = S = coupling.matrix()
        self._slice = slice(first, first + len(S))
        self._damping = np.concatenate([np.zeros(len(S) - len(robot.damping)), robot.damping])
        # Damping is taken at the end of the step, as MuJoCo's Euler does.
        self._damped = S.T @ (dt * self._damping[:, None] * S)
        self.tau: Floats = np.zeros(S.shape[1])
        """Torque in coordinates of the model, with the wrench on a floating base as in MuJoCo."""

    def apply(self, model: Any, data: Any) -> None:
        """Write the torque of the tree, between `mj_step1` and `mj_step2`."""
        part, S = self._slice, self._S
        M = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, M)
        M = M[part, part]
        bias = data.qfrc_bias[part] + self._damping * data.qvel[part]
        a = np.linalg.solve(S.T @ M @ S + self._damped, self.tau - S.T @ bias)
        data.qfrc_applied[part] = M @ (S @ a) + data.qfrc_bias[part]
