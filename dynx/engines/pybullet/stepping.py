"""One robot in a Bullet client that lets time run: state in, one step of Bullet's stepper, state out.

As in `dynx.engines.pybullet.client` everything is in Bullet's terms, and `pybullet` comes as an argument;
but here the world is the world, and a floating base moves through it. Its state is the pose of the inertial
frame C of the root, and the velocity of C's origin and of C, along the axes of the world.

**The trap.** Bullet gives every joint of a loaded robot a velocity motor that holds it at speed 0, and
POSITION_CONTROL or VELOCITY_CONTROL leave one behind when they are no longer called. Torque that is asked
for afterwards is added to that of the motor, which takes it all: the arm stands still, and the engine says
nothing. A motor is let go by VELOCITY_CONTROL with a force of 0; `BulletClient` does so when it opens, and
`SteppingClient.apply` whenever torques follow a motor. Bullet also damps the base (0.04 of its speed per
second), damps joints as the URDF says, and clamps speeds to 100: all of that is off.
"""

from __future__ import annotations

from types import ModuleType
from typing import NamedTuple

from dynx.control.engine_motors import MotorCommand
from dynx.engines.pybullet.canonical_urdf import BulletTree
from dynx.engines.pybullet.client import BulletClient, Reals
from dynx.errors import ArgumentError, shown
from dynx.model.mechanism import ROOT

MODES = ("POSITION_CONTROL", "VELOCITY_CONTROL", "TORQUE_CONTROL", "PD_CONTROL")
"""Control modes of the engine that a joint's motor takes."""


class BaseState(NamedTuple):
    """Pose of the root's inertial frame in the world, and its velocity along the world's axes."""

    position: Reals
    quat_xyzw: Reals
    linear: Reals
    angular: Reals


class SteppingClient(BulletClient):
    """A Bullet world in which one robot moves, in steps of `dt` [s]."""

    def __init__(
        self, engine: ModuleType, tree: BulletTree, robot: str, *, gravity: Reals, dt: float
    ) -> None:
        """Raises as `BulletClient` does. `gravity` (3,) [m/s^2] is in the axes of the world."""
        self._field = gravity
        self._dt = dt
        self._motors_hold = False
        super().__init__(engine, tree, robot)

    def place(self, joints: Reals, velocities: Reals, base: BaseState | None) -> None:
        """Make this the state; `base` where the base floats."""
        self._reset_joints(joints, velocities)
        if base is not None:
            self._check(*base)
            reset = self._engine.resetBasePositionAndOrientation
            self._ask(reset, self._body, base.position, base.quat_xyzw)
            self._ask(self._engine.resetBaseVelocity, self._body, base.linear, base.angular)

    def apply(self, torques: Reals) -> None:
        """Joint torques alone, for the next step, after which Bullet forgets them."""
        if self._motors_hold:
            self._release_motors()
        self.add(torques)

    def add(self, torques: Reals) -> None:
        """Joint torques for the next step, on top of what motors do."""
        self._check(torques)
        if torques:
            self._ask(
                self._engine.setJointMotorControlArray,
                self._body,
                self._links,
                self._engine.TORQUE_CONTROL,
                forces=torques,
            )

    def push_base(self, force: Reals, torque: Reals, at: Reals) -> None:
        """Force at the point `at` of the world and torque on the base, for the next step."""
        self._check(force, torque, at)
        frame = self._engine.WORLD_FRAME
        self._ask(self._engine.applyExternalForce, self._body, ROOT, force, at, frame)
        self._ask(self._engine.applyExternalTorque, self._body, ROOT, torque, frame)

    def command(self, command: MotorCommand) -> None:
        """Set the motors of all joints; they hold until the next command or `apply`."""
        if command.mode not in MODES:
            raise ArgumentError(f"mode is {shown(command.mode)}; wanted one of {', '.join(MODES)}")
        given = {
            "targetPositions": command.positions,
            "targetVelocities": command.velocities,
            "forces": command.forces,
            "positionGains": command.position_gains,
            "velocityGains": command.velocity_gains,
        }
        options = {name: numbers for name, numbers in given.items() if numbers is not None}
        self._check(*options.values())
        if command.mode == "TORQUE_CONTROL":
            self.apply(command.forces or [])
            return
        mode = getattr(self._engine, command.mode)
        self._ask(self._engine.setJointMotorControlArray, self._body, self._links, mode, **options)
        self._motors_hold = True

    def advance(self) -> None:
        """One step of Bullet's stepper."""
        self._ask(self._engine.stepSimulation)

    def joint_states(self) -> tuple[Reals, Reals]:
        """Positions and velocities of all joints."""
        if not self._links:
            return [], []
        states = self._ask(self._engine.getJointStates, self._body, self._links)
        return [state[0] for state in states], [state[1] for state in states]

    def base_state(self) -> BaseState:
        """Where the root's inertial frame is and how it moves."""
        position, quat = self._ask(self._engine.getBasePositionAndOrientation, self._body)
        linear, angular = self._ask(self._engine.getBaseVelocity, self._body)
        return BaseState(list(position), list(quat), list(linear), list(angular))

    def _release_motors(self) -> None:
        none = [0.0] * len(self._links)
        mode = self._engine.VELOCITY_CONTROL
        self._ask(self._engine.setJointMotorControlArray, self._body, self._links, mode, forces=none)
        self._motors_hold = False

    def _open(self) -> None:
        super()._open()
        self._ask(self._engine.setPhysicsEngineParameter, fixedTimeStep=self._dt, numSubSteps=0)
        self._set_gravity(self._field)
        self._motors_hold = False
