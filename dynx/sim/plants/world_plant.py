"""A robot in a world of an engine as a plant: the world's steps, with contacts."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dynx.errors import EngineError
from dynx.model import Model
from dynx.model.elements import JointDynamics
from dynx.model.geometry import Geometry
from dynx.sim.plants.disturbances import Disturbances
from dynx.sim.plants.plant import Plant, StepResult
from dynx.sim.plants.scene_plant import ScenePlant
from dynx.spatial.scalar import Floats
from dynx.steppers.state import WorldState
from dynx.world import Contact, World
from dynx.world.scene import Scene
from dynx.world.snapshot import Snapshot
from dynx.world.surroundings import ContactTable, Surroundings


class Memory(NamedTuple):
    """All that a world plant needs, besides q and v, to continue: the world, and the record so far."""

    snapshot: Snapshot
    contacts: tuple[tuple[Contact, ...], ...]
    states: tuple[WorldState, ...]


class WorldPlant(Plant):
    """A robot of a scene in `dynx.world.World`.

    Armature, joint damping, and dry friction without a slip speed, are those of the world; friction with a
    slip speed is a torque, as in the other plants. Pushes act in each step of the engine. Contacts and the
    motion of the surroundings are recorded.
    """

    def __init__(
        self, place: ScenePlant, model: Model, disturbances: Disturbances, dt: float, *, substeps: int = 1
    ) -> None:
        """Raises the errors of `World`."""
        super().__init__(model, disturbances, dt, substeps=substeps)
        assert place.robot is not None
        self._robot = place.robot
        self._world = World(
            _scene_of(place, model, disturbances),
            place.engine,
            dt,
            substeps=substeps,
            joint_limits=place.joint_limits,
            joint_damping=disturbances.sticks,
            joint_friction=disturbances.sticks,
            **dict(place.settings),
        )
        self._forces = tuple(replace(push, on=f"{self._robot}/{push.on}") for push in disturbances.pushes)
        self._others = tuple(robot.name for robot in place.scene.robots if robot.name != place.robot)
        self._moving = tuple(body.name for body in place.scene.bodies if not body.fixed)
        self._contacts: list[tuple[Contact, ...]] = []
        self._states: list[WorldState] = []

    def reset(self, q: Floats, v: Floats) -> None:
        """Put the scene at its start, and the robot at q, v."""
        self._world.reset()
        self._world.set_state(robots={self._robot: (q, v)})
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
        world, friction = self._world, self.disturbances.friction
        before = self._states[-1].robots[self._robot].v
        acting = tau - friction(before) if friction.smooth else tau
        world.step(1, {self._robot: acting}, forces=self._forces)
        state, contacts = world.state, world.contacts()
        self._states.append(state)
        self._contacts.append(contacts)
        q, v = state.robots[self._robot]
        return StepResult(q, v, (v - before) / self.dt, tau, contacts)

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
        )

    def close(self) -> None:
        self._world.close()


def _scene_of(place: ScenePlant, model: Model, disturbances: Disturbances) -> Scene:
    """Return the scene with the robot's masses and joint dynamics as the simulation has them."""
    friction, base = disturbances.friction, 6 if model.floating else 0
    own = place.scene_robot.model
    joints = [joint for joint in model.joints if joint.moves]
    # Coefficients of the description belong to all moving joints, given ones to those with a coordinate.
    owners = joints if friction.to_tree is not None else list(model.coordinate_joints)
    pairs = zip(friction.damping[base:].tolist(), friction.friction[base:].tolist(), strict=True)
    laws = {
        joint.name: JointDynamics(damping=damping, friction=dry)
        for joint, (damping, dry) in zip(owners, pairs, strict=True)
    }
    rotors = zip(model.coordinate_joints, disturbances.armature.diagonal()[base:].tolist(), strict=True)
    for joint, armature in rotors:
        laws[joint.name] = replace(laws.get(joint.name, JointDynamics()), armature=armature)
    moved = tuple(replace(joint, dynamics=laws.get(joint.name, JointDynamics())) for joint in model.joints)
    # A payload is a link more, without shapes.
    geometry = Geometry(own.geometry.links).for_links(link.name for link in model.links)
    simulated = replace(place.scene_robot, model=replace(model, joints=moved, geometry=geometry))
    robots = tuple(simulated if robot.name == place.robot else robot for robot in place.scene.robots)
    return replace(place.scene, robots=robots)
