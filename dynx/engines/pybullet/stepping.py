"""A robot that moves in Bullet's world: state in, one step of Bullet's stepper, state out.

As in `dynx.engines.pybullet.connection` everything is in Bullet's conventions, but here a floating base moves
through the world. Its state is the pose of the root's inertial frame C, and the velocity of C's origin and of
C, along the axes of the world.

**The trap.** Bullet gives every joint of a loaded robot a velocity motor that holds it at speed 0, and
POSITION_CONTROL or VELOCITY_CONTROL leave one active when they are no longer called. A torque that is
commanded afterwards is added to that of the motor, which cancels it: the arm does not move, and there is no
message. A motor is released by VELOCITY_CONTROL with a force of 0; `BulletClient` does so when it opens, and
`SteppingClient.apply` whenever torques follow a motor. Bullet also damps the base (0.04 of its speed per
second), damps joints as in the URDF, and limits speeds to 100: dynx switches all of that off.
"""

from __future__ import annotations

from types import ModuleType

from dynx.engines.pybullet.canonical_urdf import BulletTree
from dynx.engines.pybullet.client import BulletClient
from dynx.engines.pybullet.connection import Reals
from dynx.engines.pybullet.motors import BulletMotorCommand
from dynx.engines.pybullet.root_frame import BaseState


class SteppingClient(BulletClient):
    """A Bullet world in which one robot moves, in steps of `dt` [s]."""

    def __init__(
        self, engine: ModuleType, tree: BulletTree, robot: str, *, gravity: Reals, dt: float
    ) -> None:
        """Raises as `BulletClient` does. `gravity` (3,) [m/s^2] is in the axes of the world."""
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
