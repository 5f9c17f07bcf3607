"""PyBullet's own stepper as a plant: its articulated-body algorithm and its integration scheme only.

`dynx.engines.pybullet.plant` lists the features that are switched off, and why. Friction, pushes and
armature are torques from `dynx.sim.plants.disturbances`, so that they are the same in every plant.

**The trap.** Bullet gives every joint of a loaded robot a velocity motor that holds it at speed 0, and
POSITION_CONTROL or VELOCITY_CONTROL leave one active when they are no longer called. A torque that is
commanded afterwards is added to that of the motor, which cancels it: the arm does not move, and there is no
message. A motor is released by VELOCITY_CONTROL with a force of 0; `BulletClient` does so when it opens, and
`SteppingClient.apply` whenever torques follow a motor. Bullet also damps the base (0.04 of its speed per
second), damps joints as in the URDF, and limits speeds to 100: dynx switches all of that off.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from types import ModuleType
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from dynx.backends import backend
from dynx.control.bullet import BulletMotor
from dynx.control.dynamics import EngineDynamics
from dynx.engines.pybullet.backend import PyBulletBackend
from dynx.engines.pybullet.build import BaseState, RootFrame
from dynx.engines.pybullet.canonical_urdf import BulletTree, ballast_for, bullet_tree
from dynx.engines.pybullet.client import CanonicalClient, Reals
from dynx.engines.pybullet.library import bullet
from dynx.engines.pybullet.motors import BulletMotorCommand
from dynx.errors import EngineLimitError, UnsupportedFeatureError
from dynx.model import Model
from dynx.sim.plants.disturbances import Disturbances, DisturbedAcceleration
from dynx.sim.plants.friction_solver import FrictionSolver
from dynx.sim.plants.plant import Plant, StepResult
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross, rotate_back, rotation_from_quat


class SteppingClient(CanonicalClient):
    """A Bullet world in which one robot moves, in steps of `dt` [s]."""

    def __init__(
        self, engine: ModuleType, tree: BulletTree, robot: str, *, gravity: Reals, dt: float
    ) -> None:
        """Raises as `CanonicalClient` does. `gravity` (3,) [m/s^2] is in the axes of the world."""
        self._world_gravity = gravity
        self._dt = dt
        self._motors_hold = False
        super().__init__(engine, tree, robot)

    def place(self, joints: Reals, velocities: Reals, base: BaseState | None) -> None:
        """Set the state; `base` is None where the base is fixed."""
        self.reset_joints(joints, velocities)
        if base is not None:
            self.check(base.linear, base.angular)
            self.place_base(base.position, base.quat_xyzw)
            self.call(self.engine.resetBaseVelocity, self.body, base.linear, base.angular)

    def stop_joints(self, joints: list[int], positions: Reals) -> None:
        """Set some joints to rest at the given positions."""
        self.call(
            self.engine.resetJointStatesMultiDof,
            self.body,
            joints,
            [[x] for x in positions],
            [[0.0]] * len(joints),
        )

    def apply(self, torques: Reals) -> None:
        """Apply joint torques alone during the next step; motors are released."""
        if self._motors_hold:
            self.release_motors()
            self._motors_hold = False
        self.add_torques(torques)

    def command(self, command: BulletMotorCommand) -> None:
        """Set the motors of all joints, which stay active until the next command or `apply`."""
        options = command.options()
        self.check(*options.values())
        if command.mode == "TORQUE_CONTROL":
            self.apply(command.forces or [])
            return
        self.control_motors(getattr(self.engine, command.mode), **options)
        self._motors_hold = True

    def advance(self) -> None:
        """Take one step of Bullet's stepper."""
        self.call(self.engine.stepSimulation)

    def joint_states(self) -> tuple[Reals, Reals]:
        """Return the positions and velocities of all joints."""
        if not self.links:
            return [], []
        states = self.call(self.engine.getJointStates, self.body, self.links)
        return [state[0] for state in states], [state[1] for state in states]

    def base_state(self) -> BaseState:
        """Return the state of the root's inertial frame."""
        linear, angular = self.call(self.engine.getBaseVelocity, self.body)
        return BaseState(*self.base_pose(), list(linear), list(angular))

    def _load(self) -> None:
        super()._load()
        self.call(self.engine.setPhysicsEngineParameter, fixedTimeStep=self._dt, numSubSteps=0)
        self.set_gravity(self._world_gravity)
        self._motors_hold = False


Mask = NDArray[np.bool_]


class BulletPlant(Plant):
    """One robot in its own Bullet world, stepped by Bullet.

    Bullet's stepper has no mimic joints, no armature, and no joint friction that is exact in each step. With
    them the acceleration is solved from mass matrix and bias, and the stepper applies the torque that causes
    it: a torque of friction from dynx's own matrices, all else from Bullet's.
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
        tree = bullet_tree(mechanism, ballast, 0)
        self._unit = tree.unit
        self._floating = model.floating
        self._base_nq, self._base_nv = (7, 6) if model.floating else (0, 0)
        self._coupling = model.mechanism.coupling
        self._S = np.eye(0) if self._coupling is None else self._coupling.matrix()
        self._owners = np.flatnonzero([joint.mimic is None for joint in model.joints if joint.moves])
        self._solves = self._coupling is not None or disturbances.has_armature
        self._sticks = disturbances.sticks
        self._root = RootFrame(tree.root)
        self._client = SteppingClient(bullet(), tree, model.name, gravity=list(model.gravity), dt=self._h)

    @cached_property
    def _engine(self) -> PyBulletBackend:
        """The backend for bias and mass matrix, made at first use because it opens a client of its own."""
        return PyBulletBackend(self.model, validate=False)

    @cached_property
    def _tree(self) -> PyBulletBackend:
        """The backend of the robot with its mimic joints free, as in Bullet's stepper."""
        joints = tuple(replace(joint, mimic=None) for joint in self.model.joints)
        return PyBulletBackend(replace(self.model, joints=joints), validate=False)

    @cached_property
    def _friction(self) -> FrictionSolver:
        return self.disturbances.friction_solver(self._h)

    @cached_property
    def _dynamics(self) -> EngineDynamics:
        """Mass matrix and bias by dynx, because Bullet takes longer for its mass matrix than for a step."""
        return EngineDynamics(backend("compiled", self.model, validate=False))

    @cached_property
    def _accelerate(self) -> DisturbedAcceleration:
        return DisturbedAcceleration(self._engine, self.disturbances)

    def reset(self, q: Floats, v: Floats) -> None:
        self._q, self._v = q, v
        self._place()

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
        command = command.in_units(self._unit)
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
        self._client.close()
        for made in ("_engine", "_tree"):
            if made in self.__dict__:
                self.__dict__[made].close()
        if "_dynamics" in self.__dict__:
            self._dynamics.backend.close()

    # -- one step -----------------------------------------------------------------------------

    def _substep(self, t: float, tau: Floats) -> Floats:
        q, v, moves = self._q, self._v, None
        if self._sticks:
            if self.disturbances.has_torque:
                tau = tau + self.disturbances.torque(self._engine, t, q, v)
            a, moves = self._friction.step(*self._dynamics.mass_matrix_and_bias(q, v), tau, v)
            # The torque that Bullet's own dynamics need for this acceleration.
            solved = self._coupling is not None
            tau = self._tree_torque(q, v, a) if solved else self._friction.net_torque
        elif self._solves:
            tau = self._tree_torque(q, v, self._accelerate(q, v, tau, t))
        elif self.disturbances.has_torque:
            tau = tau + self.disturbances.torque(self._engine, t, q, v)
        torques = tau[self._base_nv :] if self._floating else tau
        self._client.apply((torques / self._unit if self._unit != 1.0 else torques).tolist())
        return self._advance(tau, moves)

    def _motor_substep(self, t: float, command: BulletMotorCommand) -> tuple[Floats, Floats]:
        """Return the acceleration, and the torque of the disturbances (nv,)."""
        self._client.command(command)
        disturbance: Floats = np.zeros(self.model.nv)
        if self.disturbances.has_torque or self._sticks:
            disturbance = self.disturbances.torque(self._engine, t, self._q, self._v)
            if self._sticks:
                disturbance = disturbance - self.disturbances.friction(self._v)
            self._client.add_torques((disturbance[self._base_nv :] / self._unit).tolist())
        return self._advance(disturbance), disturbance

    def _tree_torque(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """Return the torque of every joint of the tree, mimic joints too, that gives acceleration `a`."""
        coupling = self._coupling
        if coupling is None:
            return self._engine.inverse_dynamics(q, v, a)
        S = self._S
        return self._tree.inverse_dynamics(coupling.expand_q(q), S @ v, S @ a)

    def _advance(self, tau: Floats, moves: Floats | None = None) -> Floats:
        """Apply the wrench of the base, take one step and read the state; return the acceleration (nv,).

        Joints where `moves` is 0 stick: what rounding moved them is undone.
        """
        v, h = self._v, self._h
        sticking = None
        if moves is not None and 0.0 in moves.tolist():
            sticking = moves[self._base_nv :] == 0.0
        if not self._floating:
            self._client.advance()
            joints, rates = self._joints(sticking)
            self._read(joints, rates, sticking)
            return (rates - v) / h
        R, c, before = rotation_from_quat(self._q[3:7]), self._root.center, self._base
        force, moment = R @ tau[:3], R @ (tau[3:6] - cross(c, tau[:3]))
        self._client.push_base((force / self._unit).tolist(), (moment / self._unit).tolist(), before.position)
        self._client.advance()
        after = self._client.base_state()
        joints, rates = self._joints(sticking)
        # The acceleration at the beginning of the step follows from that of the root's centre of mass.
        alpha = rotate_back(R, np.subtract(after.angular, before.angular) / h)
        acceleration = rotate_back(R, np.subtract(after.linear, before.linear) / h)
        w = v[3:6]
        linear = acceleration - cross(alpha, c) - cross(w, cross(w, c)) - cross(w, v[:3])
        a = np.concatenate([linear, alpha, (rates - v[6:]) / h])
        self._read(*self._base_coordinates(after, joints, rates))
        return a

    # -- between Bullet's state and dynx's ------------------------------------------------------

    def _joints(self, sticking: Mask | None) -> tuple[Floats, Floats]:
        """Return the positions and rates of the joints that own a coordinate."""
        angles, speeds = self._client.joint_states()
        positions, rates = np.array(angles), np.array(speeds)
        if self._coupling is not None:
            positions, rates = positions[self._owners], rates[self._owners]
        if sticking is not None:
            np.copyto(positions, self._q[self._base_nq :], where=sticking)
            np.copyto(rates, 0.0, where=sticking)
        return positions, rates

    def _base_coordinates(self, base: BaseState, joints: Floats, rates: Floats) -> tuple[Floats, Floats]:
        # Bullet may change the sign of the quaternion; the sign nearer to the previous one is kept.
        base_q, base_v = self._root.coordinates(base, self._q[3:7].tolist())
        return np.concatenate([base_q, joints]), np.concatenate([base_v, rates])

    def _read(self, q: Floats, v: Floats, sticking: Mask | None = None) -> None:
        self._q, self._v = q, v
        # Bullet is set to the reported state, rounding of the conversion included, so that a rollout resumed
        # from its record continues bit for bit.
        if self._floating or self._coupling is not None:
            self._place()
        elif sticking is not None:
            joints = np.flatnonzero(sticking)
            self._client.stop_joints(joints.tolist(), q[joints].tolist())

    def _place(self) -> None:
        q, v = self._q, self._v
        if self._coupling is not None:
            q, v = self._coupling.expand_q(q), self._S @ v
        base = None
        if self._floating:
            base = self._base = self._root.base_state(q, v)
        self._client.place(q[self._base_nq :].tolist(), v[self._base_nv :].tolist(), base)
