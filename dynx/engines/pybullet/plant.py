"""PyBullet's own stepper as a plant: its articulated-body algorithm and its integration scheme only.

The robot is a scene of one in `dynx.engines.pybullet.stepper`, without limits. Friction, pushes and armature
are torques from `dynx.sim.plants.disturbances`, so that they are the same in every plant.
"""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from dynx.backends import backend
from dynx.backends.dynamics import EngineDynamics
from dynx.control.bullet import BulletMotor
from dynx.engines.pybullet.backend import PyBulletBackend
from dynx.engines.pybullet.canonical_urdf import ballast_for
from dynx.engines.pybullet.motors import BulletMotorCommand
from dynx.engines.pybullet.stepper import BulletStepper
from dynx.errors import EngineLimitError, UnsupportedFeatureError
from dynx.model import Model
from dynx.sim.plants.disturbances import Disturbances
from dynx.sim.plants.plant import Plant, StepResult
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross, rotate_back, rotation_from_quat
from dynx.steppers.forces import Forces
from dynx.steppers.implicit_joints import ImplicitJoints
from dynx.steppers.layout import Layout, RobotLayout
from dynx.steppers.robot_step import RobotStep

Mask = NDArray[np.bool_]


class BulletPlant(Plant):
    """One robot in its own Bullet world, stepped by Bullet.

    Bullet has no armature, and no joint friction that is exact in each step. With them the acceleration is
    solved from mass matrix and bias, and the stepper applies the torque that causes it: a torque of friction
    from dynx's own matrices, that of armature from Bullet's.
    """

    motor_commands: ClassVar[tuple[type, ...]] = (BulletMotorCommand,)

    def __init__(self, model: Model, disturbances: Disturbances, dt: float, *, substeps: int = 1) -> None:
        """Raises EngineLimitError for a robot with an inertia that Bullet's stepper does not accept."""
        super().__init__(model, disturbances, dt, substeps=substeps)
        mechanism = model.extended_mechanism
        ballast = ballast_for(mechanism)
        if any(load.mass or load.rotational for load in ballast):
            raise EngineLimitError(
                f"{model.name} has an inertia that Bullet's stepper does not accept (see dynx "
                "doctor); the plant of another engine does"
            )
        self._floating = model.floating
        self._base_nq, self._base_nv = (7, 6) if model.floating else (0, 0)
        self._coupled = model.mechanism.coupling is not None
        self._sticks = disturbances.sticks
        settings = {name: setting.default for name, setting in BulletStepper.settings.items()}
        self._stepper = BulletStepper(_scene_of_one(model), self._h, settings)
        self._robot = self._stepper.robots[0]

    @cached_property
    def _engine(self) -> PyBulletBackend:
        """The backend for bias and mass matrix, made at first use because it opens a client of its own."""
        return PyBulletBackend(self.model, validate=False)

    @cached_property
    def _friction(self) -> ImplicitJoints:
        return self.disturbances.implicit_joints(self._h)

    @cached_property
    def _dynamics(self) -> EngineDynamics:
        """Mass matrix and bias by dynx, because Bullet takes longer for its mass matrix than for a step."""
        return EngineDynamics(backend("compiled", self.model, validate=False))

    @cached_property
    def _accelerate(self) -> RobotStep:
        load = self.disturbances.load_on(self._engine)
        return RobotStep(self._engine, self.disturbances.joints, self._h, add_load=load)

    def reset(self, q: Floats, v: Floats) -> None:
        self._q, self._v = q, v
        self._robot.set_state(q, v)

    def step(self, t: float, tau: Floats) -> StepResult:
        first = self._substep(t, tau)
        for k in range(1, self.substeps):
            self._substep(t + k * self._h, tau)
        return StepResult(self._q, self._v, first, tau)

    def step_motors(self, t: float, command: BulletMotorCommand) -> StepResult:
        """Take one step with Bullet's motors.

        The torque (nv,) of the motors in the first sub-step is computed by inverse dynamics minus the
        disturbances, because Bullet's own report does not include PD_CONTROL.
        """
        q, v = self._q, self._v
        first, disturbance = self._motor_substep(t, command)
        tau = self._engine.inverse_dynamics(q, v, first) - disturbance
        for k in range(1, self.substeps):
            self._motor_substep(t + k * self._h, command)
        return StepResult(self._q, self._v, first, tau)

    def refuse(self, controller: object) -> None:
        """Raise UnsupportedFeatureError for an engine motor with armature or dry friction that sticks."""
        if isinstance(controller, BulletMotor) and self.disturbances.has_armature:
            raise UnsupportedFeatureError(
                f"{controller.name} is a motor inside PyBullet, without armature; use a torque controller"
            )
        if isinstance(controller, BulletMotor) and self._sticks and self.disturbances.friction.dry.any():
            raise UnsupportedFeatureError(
                f"{controller.name} is a motor inside PyBullet, whose torque is unknown before the step, so "
                "that joints cannot stick: give friction_slip above 0, or use a torque controller"
            )

    def close(self) -> None:
        self._stepper.close()
        if "_engine" in self.__dict__:
            self._engine.close()
        if "_dynamics" in self.__dict__:
            self._dynamics.backend.close()

    # -- one step -----------------------------------------------------------------------------

    def _substep(self, t: float, tau: Floats) -> Floats:
        q, v, moves = self._q, self._v, None
        if self._sticks:
            if self.disturbances.has_torque:
                tau = tau + self.disturbances.torque(self._engine, t, q, v)
            _, moves = self._friction.step(*self._dynamics.mass_matrix_and_bias(q, v), tau, v)
            # The torque that Bullet's own dynamics need for this acceleration.
            tau = self._friction.net_torque
        elif self.disturbances.has_armature:
            tau = self._engine.inverse_dynamics(q, v, self._accelerate.acceleration(q, v, tau, t))
        elif self.disturbances.has_torque:
            tau = tau + self.disturbances.torque(self._engine, t, q, v)
        return self._advance(Forces([(0, tau)]), moves)

    def _motor_substep(self, t: float, command: BulletMotorCommand) -> tuple[Floats, Floats]:
        """Return the acceleration, and the torque of the disturbances (nv,)."""
        disturbance: Floats = np.zeros(self.model.nv)
        if self.disturbances.has_torque or self._sticks:
            disturbance = self.disturbances.torque(self._engine, t, self._q, self._v)
            if self._sticks:
                disturbance = disturbance - self.disturbances.friction(self._v)
        return self._advance(Forces([(0, disturbance)], commands={0: command})), disturbance

    def _advance(self, forces: Forces, moves: Floats | None = None) -> Floats:
        """Take one step under forces and read the state; return the acceleration (nv,).

        Joints where `moves` is 0 stick: what rounding moved them is undone.
        """
        v, h = self._v, self._h
        sticking = None
        if moves is not None and 0.0 in moves.tolist():
            sticking = moves[self._base_nv :] == 0.0
        before = self._robot.placed
        self._stepper.step(1, forces)
        joints, rates = self._joints(sticking)
        if before is None:
            self._read(joints, rates, sticking)
            return (rates - v) / h
        R = rotation_from_quat(self._q[3:7])
        after, root = self._robot.object.base_state(), self._robot.object.root
        # The acceleration at the beginning of the step follows from that of the root's centre of mass.
        c = root.center
        alpha = rotate_back(R, np.subtract(after.angular, before.angular) / h)
        acceleration = rotate_back(R, np.subtract(after.linear, before.linear) / h)
        w = v[3:6]
        linear = acceleration - cross(alpha, c) - cross(w, cross(w, c)) - cross(w, v[:3])
        a = np.concatenate([linear, alpha, (rates - v[6:]) / h])
        # Bullet may change the sign of the quaternion; the sign nearer to the previous one is kept.
        base_q, base_v = root.coordinates(after, self._q[3:7].tolist())
        self._read(np.concatenate([base_q, joints]), np.concatenate([base_v, rates]))
        return a

    # -- between Bullet's state and dynx's ------------------------------------------------------

    def _joints(self, sticking: Mask | None) -> tuple[Floats, Floats]:
        """Return the positions and rates of the joints that own a coordinate."""
        positions, rates = self._robot.joint_state()
        if sticking is not None:
            np.copyto(positions, self._q[self._base_nq :], where=sticking)
            np.copyto(rates, 0.0, where=sticking)
        return positions, rates

    def _read(self, q: Floats, v: Floats, sticking: Mask | None = None) -> None:
        self._q, self._v = q, v
        # Bullet is set to the reported state, rounding of the conversion included, so that a rollout resumed
        # from its record continues bit for bit.
        if self._floating or (self._coupled and sticking is not None):
            self._robot.set_state(q, v)
        elif sticking is not None:
            joints = np.flatnonzero(sticking)
            self._robot.object.place_joints(q[joints].tolist(), [0.0] * len(joints), joints.tolist())


def _scene_of_one(model: Model) -> Layout:
    """Return a scene of a robot alone, without limits, damping and friction."""
    n = len(model.mechanism.bodies)
    unlimited = np.full(n, np.inf)
    robot = RobotLayout(
        model.name,
        model,
        model.neutral(),
        np.zeros(model.nv),
        -unlimited,
        unlimited,
        np.zeros(n),
        np.zeros(n),
        np.zeros(n),
    )
    gravity = np.array(model.gravity)
    return Layout(model.name, gravity, (robot,), (), (), np.zeros((0, 0), dtype=bool), ())
