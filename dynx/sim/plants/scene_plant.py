"""A robot in a scene as the plant of a simulation, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.model import Model
from dynx.steppers.registry import world_class
from dynx.steppers.settings import checked_settings
from dynx.world import Scene, SceneRobot


@checks_types
@dataclass(frozen=True)
class ScenePlant:
    """A plant in which a robot moves among the bodies of a scene, with contacts.

        dynx.simulate(arm, controller, motion, plant=ScenePlant(scene, "arm", engine="mujoco"))

    `robot` is the name of the simulated robot in the scene; it may be left out if the scene has one robot
    only. The motors of the scene drive the other robots; the controller replaces the motors of the simulated
    robot. `engine` and `settings` are those of `dynx.world.World`. Joints stop by the engine's own law,
    unless the simulation has ``joint_limits=False``.

    Raises ArgumentError and its subclasses for a robot, an engine or a setting that does not exist.
    """

    scene: Scene
    robot: str | None = None
    engine: str = "pybullet"
    settings: Mapping[str, Any] | tuple[tuple[str, Any], ...] = ()
    """The engine's settings by name; kept as sorted pairs."""

    def __post_init__(self) -> None:
        if not isinstance(self.scene, Scene):
            raise ArgumentError(f"scene is of type {type(self.scene).__name__}; wanted a Scene")
        names = [robot.name for robot in self.scene.robots]
        robot = self.robot
        if robot is None and len(names) == 1:
            robot = names[0]
        if robot is None:
            known = f"its robots are {', '.join(names)}" if names else "it has none"
            raise ArgumentError(f"wanted the name of the robot of the scene that is simulated; {known}")
        if robot not in names:
            raise UnknownNameError(f"the scene has no robot {shown(robot)}{nearest(robot, names)}")
        given = dict(self.settings)
        checked_settings(self.engine, world_class(self.engine).settings, given)
        object.__setattr__(self, "robot", robot)
        object.__setattr__(self, "settings", tuple(sorted(given.items())))

    @property
    def scene_robot(self) -> SceneRobot:
        """The robot that is simulated."""
        return next(robot for robot in self.scene.robots if robot.name == self.robot)

    def unrecorded(self, base: bool = False) -> str:
        """Return why a record does not determine the joint wrenches of the robot, or with `base` its base
        wrench: a constraint acts on it, whose forces are not recorded. Return "" if there is none."""
        for each in self.scene.constraints:
            ends = [end.partition("/")[0] == self.robot for end in (each.a, each.b)]
            # A constraint between two links of the robot is internal to it.
            if each.active and any(ends) and not (base and all(ends)):
                return (
                    f"a {type(each).__name__} holds {shown(each.a)} to {shown(each.b)}, and a rollout has no "
                    "forces of constraints; World(keep_last_step=True) has them in joint_wrenches() and its "
                    "sensors"
                )
        return ""

    @checks_types
    def require_model(self, model: Model) -> None:
        """Raise ArgumentError unless `model` is that of the simulated robot."""
        own = self.scene_robot.model
        if own != model:
            raise ArgumentError(
                f"the robot {shown(self.robot)} of the scene is not the model {shown(model.name)} that is "
                "simulated: give dynx.simulate the model of the scene's robot"
            )

    def __str__(self) -> str:
        return f"{self.engine} world of {self.scene.name}"
