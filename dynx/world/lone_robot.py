"""The only robot of a world, stepped by a loop that checks what it applies and reads itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dynx.spatial.scalar import Floats
from dynx.steppers.forces import EngineCommand, ExternalForce, Forces
from dynx.steppers.integrators import MeanAcceleration
from dynx.steppers.stepper import Stepper
from dynx.world.commands import RobotLoads

Acting = Sequence[tuple[str, ExternalForce, float]]
"""External forces on frames, each with the share of the step in which it acts."""


class LoneRobot:
    """A robot that neither contacts nor constraints can reach, in the stepper of its world.

    A step checks nothing, because the checks of `World.step` take as long as a step of some engines. It
    depends on q, v and what acts in it alone: the engine is set to the state that it reported where that is
    rounded, so that a motion continues bit for bit from a recorded state.
    """

    def __init__(self, stepper: Stepper, loads: RobotLoads) -> None:
        self._stepper, self._loads = stepper, loads
        self._joints = loads.joints
        robot = stepper.layout.robots[0]
        self._acceleration = MeanAcceleration(robot.model, stepper.dt)
        self._floating = robot.model.floating
        self._joints_of_q = slice(7 if self._floating else 0, None)
        self._joints_of_v = slice(6 if self._floating else 0, None)
        self.q, self.v = stepper.robot_state(0)

    def set_state(self, q: Floats, v: Floats) -> None:
        """Make q (nq,), v (nv,) the state."""
        self.q, self.v = q, v
        self._stepper.set_robot_state(0, q, v)

    def step(self, tau: Floats, forces: Acting = ()) -> Floats:
        """Take one step of the engine under the torque `tau` (nv,); return the acceleration (nv,)."""
        stuck = None
        if forces or self._joints is not None:
            tau = self._loads.torque(self.q, self.v, tau, forces)
        if self._joints is not None:
            moves = self._joints.moves[self._joints_of_v]
            stuck = moves == 0.0 if 0.0 in moves.tolist() else None
        return self._advance(Forces([(0, tau)]), stuck)

    def step_motors(self, command: EngineCommand, tau: Floats, forces: Acting = ()) -> tuple[Floats, Floats]:
        """Take one step under the engine's own motors and the torque `tau` (nv,) beside them.

        Return the acceleration and the torque of the motors (nv,). The latter follows from the acceleration
        by inverse dynamics, because Bullet's own report does not include PD_CONTROL.
        """
        q, v, loads = self.q, self.v, self._loads
        beside = loads.torque_beside_motors(q, v, tau, forces)
        a = self._advance(Forces([(0, beside)], commands={0: command}))
        return a, loads.dynamics.inverse_dynamics(q, v, a) - beside

    def refuse_engine_motors(self, motors: str) -> None:
        """Raise UnsupportedFeatureError for joint dynamics that the engine's own motors cannot have."""
        self._loads.refuse_engine_motors(motors)

    def _advance(self, forces: Forces, stuck: NDArray[np.bool_] | None = None) -> Floats:
        """Take one step under forces and read the state; return the acceleration (nv,).

        What rounding moved joints that are `stuck` is undone.
        """
        q, v = self.q, self.v
        self._stepper.step(1, forces)
        self.q, self.v = self._stepper.robot_state(0)
        if stuck is not None:
            np.copyto(self.q[self._joints_of_q], q[self._joints_of_q], where=stuck)
            np.copyto(self.v[self._joints_of_v], 0.0, where=stuck)
        if stuck is not None or self._floating:
            self._stepper.set_robot_state(0, self.q, self.v)
        return self._acceleration(q, v, self.q, self.v)
