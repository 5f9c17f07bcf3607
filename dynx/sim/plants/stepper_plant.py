"""A robot alone in an engine's own stepper as a plant: the engine's algorithm and its integration scheme.

Friction, pushes and armature are torques that dynx computes, so that they are the same in every plant. They
are exact, because nothing touches the robot.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dynx.backends import Backend, backend
from dynx.backends.dynamics import EngineDynamics
from dynx.control.bullet import BulletMotor
from dynx.errors import UnsupportedFeatureError
from dynx.model import Model
from dynx.sim.plants.disturbances import Disturbances
from dynx.sim.plants.plant import Plant, StepResult
from dynx.spatial.plain import Vector3, minus, minus_cross, rotate, rotate_back, rotation_rows
from dynx.spatial.scalar import Floats
from dynx.steppers.forces import EngineCommand, Forces
from dynx.steppers.layout import EMPTY, RobotLayout
from dynx.steppers.stepper import Stepper


class StepperPlant(Plant):
    """One robot in a scene of its own, without limits, stepped by an engine."""

    def __init__(
        self, kind: type[Stepper], model: Model, disturbances: Disturbances, dt: float, *, substeps: int = 1
    ) -> None:
        """Raises the errors of the engine for a robot that it cannot represent."""
        super().__init__(model, disturbances, dt, substeps=substeps)
        self.motor_commands = kind.commands
        settings = {name: setting.default for name, setting in kind.settings.items()}
        n = len(model.mechanism.bodies)
        far, nothing = np.full(n, np.inf), np.zeros(n)
        robot = RobotLayout(
            model.name, model, model.neutral(), np.zeros(model.nv), -far, far, nothing, nothing, nothing
        )
        layout = replace(EMPTY, name=model.name, gravity=np.array(model.gravity), robots=(robot,))
        self._stepper = kind(layout, self._h, settings)
        self._outside = disturbances.sticks or disturbances.has_armature
        if self._outside:
            self._joints = disturbances.implicit_joints(self._h)
        x, y, z = model.mechanism.root_center.tolist()
        self._center: Vector3 = (float(x), float(y), float(z))
        self._joints_of_q = slice(7 if model.floating else 0, None)
        self._joints_of_v = slice(6 if model.floating else 0, None)

    @cached_property
    def _backend(self) -> Backend:
        """Mass matrix, bias and Jacobians by dynx, because some engines take longer for them than for a step;
        opened when it is first needed, which a robot without disturbances never does."""
        return backend("compiled", self.model, validate=False)

    @cached_property
    def _dynamics(self) -> EngineDynamics:
        return EngineDynamics(self._backend)

    def reset(self, q: Floats, v: Floats) -> None:
        self._q, self._v = q, v
        self._stepper.set_robot_state(0, q, v)

    def step(self, t: float, tau: Floats) -> StepResult:
        first = self._substep(t, tau)
        for k in range(1, self.substeps):
            self._substep(t + k * self._h, tau)
        return StepResult(self._q, self._v, first, tau)

    def step_motors(self, t: float, command: EngineCommand) -> StepResult:
        """Take one step with the engine's motors.

        The torque (nv,) of the motors in the first sub-step follows from the acceleration, by inverse
        dynamics minus the disturbances, because Bullet's own report does not include PD_CONTROL.
        """
        q, v = self._q, self._v
        first, disturbance = self._motor_substep(t, command)
        tau = self._dynamics.inverse_dynamics(q, v, first) - disturbance
        for k in range(1, self.substeps):
            self._motor_substep(t + k * self._h, command)
        return StepResult(self._q, self._v, first, tau)

    def refuse(self, controller: object) -> None:
        """Raise UnsupportedFeatureError for an engine motor with armature or dry friction that sticks."""
        super().refuse(controller)
        if isinstance(controller, BulletMotor) and self.disturbances.has_armature:
            raise UnsupportedFeatureError(
                f"{controller.name} is a motor inside PyBullet, without armature; use a torque controller"
            )
        sticks = self.disturbances.sticks and self.disturbances.friction.dry.any()
        if isinstance(controller, BulletMotor) and sticks:
            raise UnsupportedFeatureError(
                f"{controller.name} is a motor inside PyBullet, whose torque is unknown before the step, so "
                "that joints cannot stick: give friction_slip above 0, or use a torque controller"
            )

    def close(self) -> None:
        self._stepper.close()
        if "_backend" in vars(self):
            self._backend.close()

    # -- one step -----------------------------------------------------------------------------

    def _substep(self, t: float, tau: Floats) -> Floats:
        """Take one step of the engine; return the acceleration (nv,)."""
        q, v, sticking = self._q, self._v, None
        if self.disturbances.has_torque:
            tau = self.disturbances.added_to(tau, self._backend, t, q, v)
        if self._outside:
            _, moves = self._joints.step(*self._dynamics.mass_matrix_and_bias(q, v), tau, v)
            # The torque that the engine's own dynamics need for this acceleration.
            tau = self._joints.net_torque
            if 0.0 in moves.tolist():
                sticking = moves[self._joints_of_v] == 0.0
        return self._advance(Forces([(0, tau)]), sticking)

    def _motor_substep(self, t: float, command: EngineCommand) -> tuple[Floats, Floats]:
        """Return the acceleration, and the torque of the disturbances (nv,)."""
        disturbance: Floats = np.zeros(self.model.nv)
        if self.disturbances.has_torque:
            disturbance = self.disturbances.torque(self._backend, t, self._q, self._v)
        if self.disturbances.sticks:
            disturbance = disturbance - self.disturbances.friction(self._v)
        return self._advance(Forces([(0, disturbance)], commands={0: command})), disturbance

    def _advance(self, forces: Forces, sticking: NDArray[np.bool_] | None = None) -> Floats:
        """Take one step under forces and read the state; return the acceleration (nv,).

        What rounding moved joints that are `sticking` is undone.
        """
        q, v = self._q, self._v
        self._stepper.step(1, forces)
        self._q, self._v = self._stepper.robot_state(0)
        if sticking is not None:
            np.copyto(self._q[self._joints_of_q], q[self._joints_of_q], where=sticking)
            np.copyto(self._v[self._joints_of_v], 0.0, where=sticking)
        if sticking is not None or self.model.floating:
            # The engine is set to the reported state, rounding of the conversion included, so that a rollout
            # resumed from its record continues bit for bit.
            self._stepper.set_robot_state(0, self._q, self._v)
        a = (self._v - v) / self._h
        if self.model.floating:
            a[:6] = _base_acceleration(
                q.tolist(), v.tolist(), self._q.tolist(), self._v.tolist(), self._h, self._center
            )
        return a


def _base_acceleration(
    q: list[float], v: list[float], q_next: list[float], v_next: list[float], h: float, center: Vector3
) -> list[float]:
    """Return the acceleration (6,) of a floating base at the beginning of a step, from the states around it.

    It follows from that of the root's centre of mass and from the angular acceleration, in axes of the world.
    """
    R, R_next = rotation_rows(*q[3:7]), rotation_rows(*q_next[3:7])
    w, w_next = v[3:6], v_next[3:6]
    at, at_next = minus_cross(v[:3], center, w), minus_cross(v_next[:3], center, w_next)
    alpha = [x / h for x in rotate_back(R, minus(rotate(R_next, w_next), rotate(R, w)))]
    rising = [x / h for x in rotate_back(R, minus(rotate(R_next, at_next), rotate(R, at)))]
    return [*minus_cross(minus_cross(rising, alpha, center), w, at), *alpha]
