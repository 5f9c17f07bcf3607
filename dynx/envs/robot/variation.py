"""A robot on a backend with the parameters that each episode draws."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from dynx.backends import Backend, backend
from dynx.compiled.parametric import ParametricDynamics, parametric
from dynx.control.dynamics import EngineDynamics
from dynx.envs.robot.step import ForwardDynamics
from dynx.envs.robot.varied_robot import VariedRobot
from dynx.spatial.scalar import Array, Floats

COMPILED = "compiled"


class RobotVariation:
    """Forward dynamics of a robot with drawn parameters, and the actions that act after a delay.

    An engine loads the robot anew for each episode in which masses differ; the backend `compiled`, which
    would compile it anew, has a kernel with masses as inputs.
    """

    def __init__(self, robot: VariedRobot, nominal: Backend) -> None:
        self.robot = robot
        """The parameters and what they change."""
        self._nominal = nominal
        self._own: Backend | None = None
        self._parametric: ParametricDynamics | None = None
        if robot.changes_masses and nominal.name == COMPILED:
            self._parametric = parametric(
                nominal.model, links=robot.link_names, point_payload=robot.payload_frame
            )
        self._values: Floats = np.zeros(0)
        self._earlier: list[Array] = []

    def forward_dynamics(self, values: Floats) -> ForwardDynamics:
        """Return the acceleration of q, v, tau with these values (k,), which hold until the next call."""
        self._values = values
        rigid = self._rigid_dynamics(values)
        robot = self.robot
        return lambda q, v, tau: rigid(q, v, tau + robot.joint_torque(values, v))

    def _rigid_dynamics(self, values: Floats) -> Callable[..., Any]:
        if not self.robot.changes_masses:
            return EngineDynamics(self._nominal).forward_dynamics
        if self._parametric is not None:
            dynamics = self._parametric
            parameters = self.robot.parametric_values(values, dynamics.parameters.defaults)
            return lambda q, v, tau: dynamics.forward_dynamics(q, v, tau, parameters)
        self.close()
        self._own = backend(self._nominal.name, self.robot.model(values), validate=False)
        return EngineDynamics(self._own).forward_dynamics

    def acting_actions(self, action: Array, *, first: bool) -> list[Array]:
        """Return the action that acts in each step of the integrator; the `first` of an episode acts until
        a later one does."""
        if first:
            self._earlier = [action] * self.robot.delayed_actions
        acting = self.robot.acting_actions(self._values, action, self._earlier)
        self._earlier = [action, *self._earlier][: self.robot.delayed_actions]
        return acting

    def close(self) -> None:
        """Release the engine of the last episode."""
        if self._own is not None:
            self._own.close()
            self._own = None
