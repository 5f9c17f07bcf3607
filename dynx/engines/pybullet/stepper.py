"""`BulletStepper`: a scene in PyBullet.

Robots are dynx's canonical mechanisms, stepped as `dynx.simulate(plant="pybullet")` steps them, without
motors, damping or limits that the scene does not have. Every link with shapes has a Bullet link of its own,
so that contacts are named by the links of the description.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

import numpy as np

from dynx.engines.pybullet.library import bullet, bullet_version
from dynx.engines.pybullet.motors import BulletMotorCommand
from dynx.engines.pybullet.world.bodies import BulletBody
from dynx.engines.pybullet.world.client import WorldClient
from dynx.engines.pybullet.world.constraints import add_constraint
from dynx.engines.pybullet.world.contacts import ContactReader
from dynx.engines.pybullet.world.filters import set_filters
from dynx.engines.pybullet.world.materials import bullet_materials
from dynx.engines.pybullet.world.objects import BulletObject
from dynx.engines.pybullet.world.robot import BulletRobot
from dynx.engines.pybullet.world.settings import SETTINGS
from dynx.engines.pybullet.world.shapes import ShapeFiles, is_ground, load_ground
from dynx.errors import EngineError
from dynx.model.mechanism import ROOT
from dynx.spatial.scalar import Floats
from dynx.steppers.forces import NO_COMMANDS, NO_FORCES, EngineCommand, Forces
from dynx.steppers.layout import Collider, Layout
from dynx.steppers.materials import EffectiveCoefficient
from dynx.steppers.settings import Setting
from dynx.steppers.state import BodyState, RobotState
from dynx.steppers.stepper import Stepper, TouchingPoint


class BulletStepper(Stepper):
    """A scene in a Bullet client of its own."""

    name = "pybullet"
    settings: ClassVar[Mapping[str, Setting]] = SETTINGS
    commands: ClassVar[tuple[type[EngineCommand], ...]] = (BulletMotorCommand,)
    native_queries: ClassVar[str] = "dynx.engines.pybullet.native_queries:BulletQueries"

    @classmethod
    def require_engine(cls) -> None:
        bullet()

    def __init__(self, layout: Layout, dt: float, settings: Mapping[str, Any]) -> None:
        super().__init__(layout, dt, settings)
        engine = bullet()
        self.client = client = WorldClient(engine, layout.name, dt, settings)
        self._number = client.number
        self._step_simulation = engine.stepSimulation
        try:
            with TemporaryDirectory(prefix="dynx-", ignore_cleanup_errors=True) as folder:
                self._load(Path(folder), settings)
        except OSError as error:
            client.close()
            raise EngineError(f"the files through which Bullet loads {layout.name}: {error}") from error
        except BaseException:
            client.close()
            raise
        self._corrected = [robot for robot in self._robots if robot.corrected]
        self._apply = [robot.apply for robot in self._robots]
        self._before = [robot.before_step for robot in self._corrected]
        self._commands: Mapping[int, EngineCommand] = NO_COMMANDS
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
        self._robots = [
            BulletRobot(client, robot, owned.get((k, ROOT), {}), files, folder, self.dt)
            for k, robot in enumerate(layout.robots)
        ]
        self._bodies = [
            BulletBody(client, body, owned.get((None, k), {}), files, folder)
            for k, body in enumerate(layout.bodies)
        ]
        places: list[list[tuple[int, int]]] = [[] for _ in layout.colliders]
        objects: list[BulletObject] = [robot.object for robot in self._robots]
        objects += [body.object for body in self._bodies]
        for each in objects:
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
            add_constraint(client, constraint, self._robots, self._bodies, settings["constraint_force"])

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
            self._robots[k].command(None)
        for k, command in commands.items():
            if isinstance(command, BulletMotorCommand):
                self._robots[k].command(command)
        self._commands = commands

    # -- state --------------------------------------------------------------------------------

    def robot_state(self, robot: int) -> RobotState:
        return self._robots[robot].state()

    def joint_state(self, robot: int) -> RobotState:
        return self._robots[robot].joint_state()

    def body_state(self, body: int) -> BodyState:
        return self._bodies[body].state()

    def set_robot_state(self, robot: int, q: Floats, v: Floats) -> None:
        self._robots[robot].set_state(q, v)
        self._touch()

    def set_body_state(self, body: int, T: Floats, twist: Floats) -> None:
        self._bodies[body].set_state(T, twist)
        self._touch()

    def _touch(self) -> None:
        """Find the contacts of a state that was set."""
        self.client.call(self.client.engine.performCollisionDetection)
        self.contact_reader.fresh = True

    def dump(self) -> bytes:
        near = np.array([robot.near for robot in self._robots]).tobytes()
        with TemporaryDirectory(prefix="dynx-", ignore_cleanup_errors=True) as folder:
            path = Path(folder) / "world.bullet"
            self.client.call(self.client.engine.saveBullet, str(path))
            return struct.pack("<?", self.contact_reader.fresh) + near + path.read_bytes()

    def load(self, data: bytes) -> None:
        size = 32 * len(self._robots)
        near = np.frombuffer(data[1 : 1 + size]).reshape(-1, 4)
        with TemporaryDirectory(prefix="dynx-", ignore_cleanup_errors=True) as folder:
            path = Path(folder) / "world.bullet"
            path.write_bytes(data[1 + size :])
            self.client.call(self.client.engine.restoreState, fileName=str(path))
        for robot, quat in zip(self._robots, near, strict=True):
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
        for robot in self._robots:
            robot.close()
        self.client.close()
