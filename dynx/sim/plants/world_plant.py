"""A robot in a world of an engine as a plant: alone, or in a scene with contacts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.control.bullet import BulletMotor
from dynx.errors import EngineError, UnsupportedFeatureError, shown
from dynx.model import Model
from dynx.model.elements import Joint, JointDynamics
from dynx.model.geometry import Geometry
from dynx.sim.plants.disturbances import Disturbances
from dynx.sim.plants.plant import Plant, StepResult
from dynx.sim.plants.scene_plant import ScenePlant
from dynx.spatial.scalar import Floats
from dynx.steppers.forces import EngineCommand, ExternalForce, Forces
from dynx.steppers.registry import world_class
from dynx.steppers.state import WorldState
from dynx.world import Contact, Scene, SceneRobot, World
from dynx.world.last_step import MeanAcceleration
from dynx.world.snapshot import Snapshot
from dynx.world.surroundings import ContactTable, Surroundings


class LoneRobotPlant(Plant):
    """A robot alone in a world of an engine, without limits: the engine's algorithm and integration scheme.

    Joint dynamics are those of the world, exact because nothing can reach the robot. Pushes act in each
    sub-step, and so does friction with a slip speed, a torque as in the other plants.
    """

    def __init__(
        self, engine: str, model: Model, disturbances: Disturbances, dt: float, *, substeps: int = 1
    ) -> None:
        """Raises the errors of the engine for a robot that it cannot represent."""
        super().__init__(model, disturbances, dt, substeps=substeps)
        self.motor_commands = world_class(engine).commands
        robot = SceneRobot("robot", with_joint_dynamics(model, disturbances))
        scene = Scene("robot alone", robots=(robot,), gravity=model.gravity)
        self._world = World(scene, engine, self._h, collisions=False, joint_limits=False)
        # Stepped directly, because the checks of `World.step` take as long as a step of some engines.
        self._stepper, self._loads = self._world.stepper_and_loads("robot")
        self._joints = self._loads.joints
        self._acceleration = MeanAcceleration(model, self._h)
        self._joints_of_q = slice(7 if model.floating else 0, None)
        self._joints_of_v = slice(6 if model.floating else 0, None)
        self._slips = disturbances.friction.smooth

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
        dynamics minus all other torques, because Bullet's own report does not include PD_CONTROL.
        """
        q, v = self._q, self._v
        first, beside = self._motor_substep(t, command)
        tau = self._loads.dynamics.inverse_dynamics(q, v, first) - beside
        for k in range(1, self.substeps):
            self._motor_substep(t + k * self._h, command)
        return StepResult(self._q, self._v, first, tau)

    def refuse(self, controller: object) -> None:
        super().refuse(controller)
        if isinstance(controller, BulletMotor):
            self._loads.refuse_engine_motors(controller.name)

    def close(self) -> None:
        self._world.close()

    # -- one step of the engine -----------------------------------------------------------------

    def _substep(self, t: float, tau: Floats) -> Floats:
        """Take one step of the engine under the torque `tau` (nv,); return the acceleration (nv,)."""
        stuck, pushes = None, self._acting(t)
        if self._slips:
            tau = tau - self.disturbances.friction(self._v)
        if pushes or self._joints is not None:
            tau = self._loads.torque(self._q, self._v, tau, pushes)
        if self._joints is not None:
            moves = self._joints.moves[self._joints_of_v]
            stuck = moves == 0.0 if 0.0 in moves.tolist() else None
        return self._advance(Forces([(0, tau)]), stuck)

    def _motor_substep(self, t: float, command: EngineCommand) -> tuple[Floats, Floats]:
        """Return the acceleration, and the torque beside that of the motors (nv,)."""
        tau = -self.disturbances.friction(self._v) if self._slips else None
        beside = self._loads.torque_beside_motors(self._q, self._v, tau, self._acting(t))
        return self._advance(Forces([(0, beside)], commands={0: command})), beside

    def _positions(self, stuck: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return the positions of joints in q that stay, for coordinates (n,) that are `stuck`.

        The quaternion of a ball joint stays if all three are.
        """
        if not self.model.ball_joints:
            return stuck
        masks, first = [], 0
        for joint in self.model.coordinate_joints:
            masks.append(np.full(joint.n_positions, stuck[first : first + joint.n_rates].all()))
            first += joint.n_rates
        return np.concatenate(masks)

    def _acting(self, t: float) -> Sequence[tuple[str, ExternalForce, float]]:
        """Return the pushes with their shares of the step of the engine at `t`."""
        if not self.disturbances.pushes:
            return ()
        shares = ((push, push.share(t, self._h)) for push in self.disturbances.pushes)
        return [(push.on, push, share) for push, share in shares if share]

    def _advance(self, forces: Forces, stuck: NDArray[np.bool_] | None = None) -> Floats:
        """Take one step under forces and read the state; return the acceleration (nv,).

        What rounding moved joints that are `stuck` is undone.
        """
        q, v = self._q, self._v
        self._stepper.step(1, forces)
        self._q, self._v = self._stepper.robot_state(0)
        if stuck is not None:
            np.copyto(self._q[self._joints_of_q], q[self._joints_of_q], where=self._positions(stuck))
            np.copyto(self._v[self._joints_of_v], 0.0, where=stuck)
        if stuck is not None or self.model.floating:
            # The engine is set to the reported state, rounding of the conversion included, so that a rollout
            # resumed from its record continues bit for bit.
            self._stepper.set_robot_state(0, self._q, self._v)
        return self._acceleration(q, v, self._q, self._v)


class Memory(NamedTuple):
    """All that a world plant needs, besides q and v, to continue: the world, and the record so far."""

    snapshot: Snapshot
    contacts: tuple[tuple[Contact, ...], ...]
    states: tuple[WorldState, ...]


class WorldPlant(Plant):
    """A robot of a scene in `dynx.world.World`.

    Armature, springs, joint damping, and dry friction without a slip speed, are those of the world; friction
    with a slip speed is a torque, as in the other plants. Pushes act in each step of the engine. Contacts and
    the motion of the surroundings are recorded.
    """

    def __init__(
        self,
        place: ScenePlant,
        model: Model,
        disturbances: Disturbances,
        dt: float,
        *,
        substeps: int = 1,
        joint_limits: bool = True,
    ) -> None:
        """Raises the errors of `World`."""
        super().__init__(model, disturbances, dt, substeps=substeps)
        assert place.robot is not None
        self._robot = place.robot
        self._world = World(
            _scene_of(place, model, disturbances),
            place.engine,
            self._h,
            joint_limits=joint_limits,
            **dict(place.settings),
        )
        self._acceleration = MeanAcceleration(model, self._h)
        self._forces = tuple(replace(push, on=f"{self._robot}/{push.on}") for push in disturbances.pushes)
        self._others = tuple(robot.name for robot in place.scene.robots if robot.name != place.robot)
        self._moving = tuple(body.name for body in place.scene.bodies if not body.fixed)
        self._notes = self._world.notes
        self._contacts: list[tuple[Contact, ...]] = []
        self._states: list[WorldState] = []

    def reset(self, q: Floats, v: Floats) -> None:
        """Put the scene at its start, and the robot at q, v."""
        self._world.reset()
        start = self._world.state.robots[self._robot]
        self._world.set_state(robots={self._robot: (q, v)})
        as_in_scene = np.array_equal(start.q, q) and np.array_equal(start.v, v)
        self._notes = self._world.notes if as_in_scene else self._world.notes_on_present_state()
        self._contacts, self._states = [], [self._world.state]

    def recover(self, q: Floats, v: Floats) -> None:
        """Stay in the state q, v of the last complete step.

        Raises EngineError if the world is in another state, because q and v do not determine the rest.
        """
        now = self._world.state.robots[self._robot]
        if not (np.array_equal(now.q, q) and np.array_equal(now.v, v)):
            raise EngineError(
                "the world was interrupted in the middle of a step: Simulation.reset starts again, "
                "Simulation.restore returns to what was saved"
            )

    def step(self, t: float, tau: Floats) -> StepResult:
        before = self._states[-1].robots[self._robot]
        q, v = self._substep(before.v, tau)
        first = self._acceleration(*before, q, v)
        for _ in range(1, self.substeps):
            q, v = self._substep(v, tau)
        contacts = self._world.contacts()
        self._states.append(self._world.state)
        self._contacts.append(contacts)
        return StepResult(q, v, first, tau, contacts)

    def _substep(self, v: Floats, tau: Floats) -> tuple[Floats, Floats]:
        """Take one step of the engine from velocity `v` (nv,); return q and v after it."""
        friction = self.disturbances.friction
        acting = tau - friction(v) if friction.smooth else tau
        self._world.step(1, {self._robot: acting}, forces=self._forces)
        return self._world.state.robots[self._robot]

    def save(self) -> Memory:
        return Memory(self._world.save(), tuple(self._contacts), tuple(self._states))

    def restore(self, memory: Memory) -> None:
        self._world.restore(memory.snapshot)
        self._contacts, self._states = list(memory.contacts), list(memory.states)

    def surroundings(self, n: int) -> Surroundings:
        states = self._states[: n + 1]
        return Surroundings(
            ContactTable.of(self._contacts[:n], self._world.scene.parts),
            {name: np.array([each.bodies[name].T_world_body for each in states]) for name in self._moving},
            {name: np.array([each.robots[name].q for each in states]) for name in self._others},
            self._notes,
        )

    def close(self) -> None:
        self._world.close()


def _scene_of(place: ScenePlant, model: Model, disturbances: Disturbances) -> Scene:
    """Return the scene with the robot's masses and joint dynamics as the simulation has them, and without
    sensors, whose readings follow from the record."""
    # A payload is a link more, without shapes.
    geometry = Geometry(place.scene_robot.model.geometry.links).for_links(link.name for link in model.links)
    moved = replace(with_joint_dynamics(model, disturbances), geometry=geometry)
    robots = tuple(
        replace(robot, model=moved) if robot.name == place.robot else robot for robot in place.scene.robots
    )
    return replace(place.scene, robots=robots, sensors=())


def with_joint_dynamics(model: Model, disturbances: Disturbances) -> Model:
    """Return a model whose joints have the armature and springs of a simulation, and the damping and dry
    friction that are solved for (`Disturbances.sticks`)."""
    friction, base = disturbances.friction, 6 if model.floating else 0
    laws: dict[str, JointDynamics] = {}
    if disturbances.sticks:
        # Coefficients of the description belong to all moving joints, given ones to those with a coordinate.
        moving = [joint for joint in model.joints if joint.moves]
        owners = moving if friction.to_tree is not None else list(model.coordinate_joints)
        pairs = zip(friction.damping[base:].tolist(), friction.friction[base:].tolist(), strict=True)
        laws = {
            joint.name: JointDynamics(damping=damping, friction=dry)
            for joint, (damping, dry) in _by_joint(model, owners, list(pairs))
        }
    rotors = disturbances.armature.diagonal()[base:].tolist()
    for joint, armature in _by_joint(model, model.coordinate_joints, rotors):
        laws[joint.name] = replace(laws.get(joint.name, JointDynamics()), armature=armature)
    for joint in model.joints if disturbances.springs is not None else ():
        own = joint.dynamics
        spring = {"stiffness": own.stiffness, "spring_reference": own.spring_reference}
        laws[joint.name] = replace(laws.get(joint.name, JointDynamics()), **spring)
    joints = tuple(replace(joint, dynamics=laws.get(joint.name, JointDynamics())) for joint in model.joints)
    return model if joints == model.joints else replace(model, joints=joints)


def _by_joint(model: Model, joints: Sequence[Joint], values: list[Any]) -> Iterator[tuple[Joint, Any]]:
    """Yield each joint with its value, of those of the coordinates; an engine has one for a ball joint.

    Raises UnsupportedFeatureError for a ball joint whose three coordinates have different values.
    """
    first = 0
    for joint in joints:
        own = values[first : first + joint.n_rates]
        if any(each != own[0] for each in own):
            raise UnsupportedFeatureError(
                f"{shown(joint.name)} of {model.name} is a ball joint, of which an engine has one damping, "
                f"friction and armature about all axes; got {shown(own)}"
            )
        first += joint.n_rates
        yield joint, own[0]
