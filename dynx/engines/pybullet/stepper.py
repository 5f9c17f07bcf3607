"""`BulletStepper`: a scene in PyBullet.

Robots are dynx's canonical mechanisms, stepped as `dynx.simulate(plant="pybullet")` steps them, without
motors, damping or limits that the scene does not have. Every link with shapes has a Bullet link of its own,
so that contacts are named by the links of the description.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from dynx.engines.pybullet.build import (
    SETTINGS,
    BulletObject,
    Place,
    ShapeFiles,
    bullet_materials,
    is_ground,
    load_ground,
    set_filters,
    set_parameters,
)
from dynx.engines.pybullet.client import BulletClient
from dynx.engines.pybullet.library import bullet, bullet_version
from dynx.engines.pybullet.motors import BulletMotorCommand
from dynx.engines.pybullet.robot import BulletBody, BulletRobot
from dynx.engines.silence import silence
from dynx.files.temporary import temporary_folder
from dynx.model.geometry import Ellipsoid
from dynx.model.geometry.triangulation import BALL_DEVIATION
from dynx.model.mechanism import ROOT
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_from_rotation
from dynx.steppers.forces import NO_COMMANDS, NO_FORCES, EngineCommand, Forces
from dynx.steppers.layout import WORLD, Anchor, Collider, ConstraintLayout, Layout
from dynx.steppers.materials import EffectiveCoefficient
from dynx.steppers.settings import Setting
from dynx.steppers.state import BodyState, RobotState
from dynx.steppers.stepper import Feature, Stepper, TouchingPoint

NO_BODY = -1
"""Bullet's number of the world as the second body of a constraint."""


def add_constraint(
    client: BulletClient,
    constraint: ConstraintLayout,
    robots: Sequence[BulletRobot],
    bodies: Sequence[BulletBody],
    most: float,
) -> None:
    """Create a constraint with forces up to `most` [N or N m]."""
    ends = [_end(each, robots, bodies) for each in (constraint.a, constraint.b)]
    if ends[0][0] == NO_BODY:
        ends.reverse()
    (body_a, link_a, T_a), (body_b, link_b, T_b) = ends
    engine = client.engine
    kind = engine.JOINT_FIXED if constraint.kind == "weld" else engine.JOINT_POINT2POINT
    number = client.call(
        engine.createConstraint,
        body_a,
        link_a,
        body_b,
        link_b,
        kind,
        [0.0, 0.0, 0.0],
        T_a[:3, 3].tolist(),
        T_b[:3, 3].tolist(),
        quat_from_rotation(T_a[:3, :3]).tolist(),
        quat_from_rotation(T_b[:3, :3]).tolist(),
    )
    client.call(engine.changeConstraint, number, maxForce=most)


def _end(
    anchor: Anchor, robots: Sequence[BulletRobot], bodies: Sequence[BulletBody]
) -> tuple[int, int, Floats]:
    """Return body, link and frame of an anchor; the frame is relative to the link's inertial frame."""
    robot, body = anchor.owner
    if robot is None and body == WORLD:
        return NO_BODY, ROOT, anchor.T
    found = bodies[body].object if robot is None else robots[robot].object
    part = ROOT if robot is None else body
    link = ROOT if part == ROOT else found.links[part]
    return found.body, link, np.linalg.inv(found.inertial_frame(part)) @ anchor.T


class ContactReader:
    """Translation of Bullet's reports, which name bodies and links by number."""

    def __init__(self, client: BulletClient, places: Sequence[Sequence[Place]]) -> None:
        """`places` are the bodies and links of each collider."""
        self._client = client
        self.places = places
        self._collider = {place: k for k, found in enumerate(places) for place in found}
        self.fresh = True
        """True if no step was taken since the state was set, so that there are no forces."""

    def contacts(self) -> list[TouchingPoint]:
        """Return the contacts that have a force, or overlap."""
        found = []
        for a, b, point in self._touching_points():
            force, friction = (0.0, np.zeros(3)) if self.fresh else (point[9], _friction(point))
            found.append(touching_point(a, b, point, force, friction))
        return found

    def pairs(self) -> set[tuple[int, int]]:
        """Return the colliders that have one of `contacts`."""
        return {(a, b) for a, b, _ in self._touching_points()}

    def _touching_points(self) -> Iterator[tuple[int, int, Sequence[Any]]]:
        """Yield the colliders and Bullet's report of each contact."""
        for point in self._client.call(self._client.engine.getContactPoints) or ():
            a, b = self._collider.get((point[1], point[3])), self._collider.get((point[2], point[4]))
            if a is not None and b is not None and (point[8] <= 0.0 or point[9] > 0.0):
                yield a, b, point


def _friction(point: Sequence[Any]) -> Floats:
    """Return the friction on the first body: two forces along two directions of the tangent plane."""
    return np.asarray(point[10] * np.array(point[11]) + point[12] * np.array(point[13]))


def touching_point(
    a: int, b: int, point: Sequence[Any], force: float, friction: Floats | None
) -> TouchingPoint:
    """Return a contact or nearest point from Bullet's report of it."""
    return TouchingPoint(
        a, b, np.array(point[5]), np.array(point[6]), np.array(point[7]), point[8], force, friction
    )


class BulletStepper(Stepper):
    """A scene in a Bullet client of its own."""

    name = "pybullet"
    settings: ClassVar[Mapping[str, Setting]] = SETTINGS
    contact_law: ClassVar[str] = (
        "impulses between rigid bodies at contacts, constraints and joint limits, by iterations"
    )
    commands: ClassVar[tuple[type[EngineCommand], ...]] = (BulletMotorCommand,)
    inexact: ClassVar[Mapping[Feature, str]] = {
        Feature.DAMPING: "that of the velocity when a step begins, an error of first order in the step",
        Feature.DRY_FRICTION: "solved by iterations, before mimic joints are coupled",
    }
    replaced_shapes: ClassVar[Mapping[type, str]] = {
        Ellipsoid: f"polyhedra, within {BALL_DEVIATION * 100:g} % of the half axes"
    }
    native_queries: ClassVar[str] = "dynx.engines.pybullet.native_queries:BulletQueries"

    @classmethod
    def require_engine(cls) -> None:
        bullet()

    @classmethod
    def provides(cls, layout: Layout) -> frozenset[Feature]:
        return frozenset(Feature) - {Feature.ARMATURE, Feature.SPRINGS}

    def __init__(self, layout: Layout, dt: float, settings: Mapping[str, Any]) -> None:
        super().__init__(layout, dt, settings)
        engine = bullet()
        self.client = client = BulletClient(engine, layout.name)
        client.connect(fixedTimeStep=dt, deterministicOverlappingPairs=1)
        self._number = client.number
        self._step_simulation = engine.stepSimulation
        try:
            set_parameters(client, settings)
            with temporary_folder() as folder:
                self._load(folder, settings)
        except BaseException:
            client.close()
            raise
        self._corrected = [robot for robot in self.robots if robot.corrected]
        self._apply = [robot.apply for robot in self.robots]
        self._before = [robot.before_step for robot in self._corrected]
        self._commands: Mapping[int, EngineCommand] = NO_COMMANDS
        self._motor_torques: list[Callable[[], object]] = []
        self._touch()

    def _load(self, folder: Path, settings: Mapping[str, Any]) -> None:
        layout, client = self.layout, self.client
        client.call(client.engine.setGravity, *layout.gravity.tolist())
        self._materials = bullet_materials(layout)
        rebounds = self._materials.rebounds
        # With the faces of polyhedra Bullet finds all points of a contact in one step.
        files = ShapeFiles(folder, client.engine.URDF_INITIALIZE_SAT_FEATURES if rebounds.any() else 0)
        owned: dict[tuple[int | None, int], dict[int, Collider]] = {}
        for number, collider in enumerate(layout.colliders):
            robot, body = collider.owner
            owned.setdefault((robot, body if robot is None else ROOT), {})[number] = collider
        self.robots = [
            BulletRobot(client, robot, owned.get((k, ROOT), {}), files, folder, self.dt)
            for k, robot in enumerate(layout.robots)
        ]
        self._bodies = [
            BulletBody(client, body, owned.get((None, k), {}), files, folder)
            for k, body in enumerate(layout.bodies)
        ]
        places: list[list[tuple[int, int]]] = [[] for _ in layout.colliders]
        objects: list[BulletObject] = [robot.object for robot in self.robots]
        objects += [body.object for body in self._bodies]
        damping = settings["link_damping"]
        for each in objects:
            if damping:
                # Set for the root, it acts on all links.
                given = {"linearDamping": damping, "angularDamping": damping}
                client.call(client.engine.changeDynamics, each.body, ROOT, **given)
            for number, link in each.link_of.items():
                places[number].append((each.body, link))
        for number, collider in enumerate(layout.colliders):
            for shape in filter(is_ground, collider.shapes):
                T = np.eye(4) if collider.owner.robot is not None else layout.bodies[collider.owner.body].T
                ground = load_ground(client, files, shape, T, rebounds=bool(rebounds[number]))
                places[number].append((ground, ROOT))
        set_filters(client, layout, places, self._materials, settings, self.dt)
        self.contact_reader = ContactReader(client, places)
        for constraint in layout.constraints:
            add_constraint(client, constraint, self.robots, self._bodies, settings["constraint_force"])

    def effective_materials(self) -> Mapping[str, EffectiveCoefficient]:
        return self._materials.effective()

    # -- motion -------------------------------------------------------------------------------

    def step(self, n: int, forces: Forces = NO_FORCES) -> None:
        if forces.commands is not self._commands:
            self._command(forces.commands)
        self.contact_reader.fresh = False
        step, number = self._step_simulation, self._number
        # Bullet forgets torques and wrenches after each step.
        applied: list[Callable[[], object]] = [
            partial(self._apply[k], tau.tolist()) for k, tau in forces.torques
        ]
        if forces.wrenches is not None:
            applied += [
                partial(
                    self._bodies[k].object.push_base,
                    forces.wrenches[k, :3].tolist(),
                    forces.wrenches[k, 3:].tolist(),
                )
                for k in np.flatnonzero(forces.wrenches.any(axis=1)).tolist()
            ]
        applied += self._motor_torques
        applied += self._before
        try:
            while n:
                n -= 1
                for call in applied:
                    call()
                step(physicsClientId=number)
                for robot in self._corrected:
                    robot.after_step()
        except self.client.errors as error:
            raise self.client.failure("stepSimulation", error) from error

    def _command(self, commands: Mapping[int, EngineCommand]) -> None:
        """Set Bullet's motors of the robots that have a command, and release those that had one."""
        for k in self._commands.keys() - commands.keys():
            self.robots[k].command(None)
        self._motor_torques = []
        for k, command in commands.items():
            if not isinstance(command, BulletMotorCommand):
                continue
            if command.mode == "TORQUE_CONTROL":
                # Bullet forgets a torque after each step, unlike the targets of the other modes.
                self.robots[k].command(None)
                base = [0.0] * (6 if self.layout.robots[k].model.floating else 0)
                torque = base + command.lists().get("forces", [0.0] * len(self.robots[k].object.links))
                self._motor_torques.append(partial(self._apply[k], torque))
            else:
                self.robots[k].command(command)
        self._commands = commands

    def damps_at_end(self, robot: int) -> bool:
        return self.robots[robot].corrected

    def motor_torque(self, robot: int) -> Floats | None:
        command = self._commands.get(robot)
        return self.robots[robot].motor_torque(command) if isinstance(command, BulletMotorCommand) else None

    # -- state --------------------------------------------------------------------------------

    def robot_state(self, robot: int) -> RobotState:
        return self.robots[robot].state()

    def joint_state(self, robot: int) -> RobotState:
        return self.robots[robot].joint_state()

    def body_state(self, body: int) -> BodyState:
        return self._bodies[body].state()

    def set_robot_state(self, robot: int, q: Floats, v: Floats) -> None:
        self.robots[robot].set_state(q, v)
        self._touch()

    def set_body_state(self, body: int, T: Floats, twist: Floats) -> None:
        self._bodies[body].set_state(T, twist)
        self._touch()

    def _touch(self) -> None:
        """Find the contacts of a state that was set."""
        if self.layout.colliders:
            self.client.call(self.client.engine.performCollisionDetection)
        self.contact_reader.fresh = True

    def dump(self) -> bytes:
        near = np.array([robot.near for robot in self.robots]).tobytes()
        with temporary_folder() as folder:
            path = folder / "world.bullet"
            self.client.call(self.client.engine.saveBullet, str(path))
            data = path.read_bytes()
            # Bullet does not notice a full disk, which has no room for one more byte either.
            with path.open("ab") as file:
                file.write(b"0")
            return struct.pack("<?", self.contact_reader.fresh) + near + data

    def load(self, data: bytes) -> None:
        size = 32 * len(self.robots)
        near = np.frombuffer(data[1 : 1 + size]).reshape(-1, 4)
        with temporary_folder() as folder:
            path = folder / "world.bullet"
            path.write_bytes(data[1 + size :])
            # What Bullet writes of a state that it refuses is in the error.
            with silence():
                self.client.call(self.client.engine.restoreState, fileName=str(path))
        for robot, quat in zip(self.robots, near, strict=True):
            robot.near = quat.tolist()
        (self.contact_reader.fresh,) = struct.unpack("<?", data[:1])

    # -- queries ------------------------------------------------------------------------------

    def contacts(self) -> Sequence[TouchingPoint]:
        return [point for point in self.contact_reader.contacts() if self.layout.collides[point.a, point.b]]

    def touching_pairs(self) -> Iterable[tuple[int, int]]:
        collides = self.layout.collides
        return [pair for pair in self.contact_reader.pairs() if collides[pair]]

    # -- end ----------------------------------------------------------------------------------

    @property
    def version(self) -> str:
        return bullet_version()

    def close(self) -> None:
        for robot in self.robots:
            robot.close()
        self.client.close()
