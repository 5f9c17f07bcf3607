"""A scene as an MJCF document: the world of dynx in MuJoCo, which MuJoCo and its tools run without dynx."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from dynx.argument_types import checks_types
from dynx.engines.mujoco.materials import SETTINGS
from dynx.engines.mujoco.mjcf import MjcfDocument
from dynx.errors import UnknownBackendError, nearest, shown
from dynx.steppers.layout import Layout
from dynx.steppers.registry import world_names
from dynx.steppers.settings import checked_settings
from dynx.world.preparation import checked_options, may_be_reached, prepare
from dynx.world.scene.scene import Scene
from dynx.world.sensors.kinds import ForceTorqueSensor


@checks_types
def scene_to_mjcf(
    scene: Scene,
    dt: float = 1e-3,
    *,
    substeps: int = 1,
    collisions: bool = True,
    joint_limits: bool = True,
    joint_damping: bool = True,
    joint_friction: bool = True,
    joint_armature: bool = True,
    engine: str = "mujoco",
    **settings: object,
) -> str:
    """Return a scene as an MJCF document, complete in itself: the model of its world in MuJoCo.

    The options are those of `World`, with the settings of MuJoCo; `World.to_mjcf` has those of a world. Where
    that runs in another `engine`, a comment says that solver and contacts are MuJoCo's. The step of the
    document is that of the engine, dt / substeps [s].

    Links are bodies named ``robot/link``, bodies as in the scene, joints ``robot/joint``, free joints as the
    robot or body that they move, geoms by their part and number. A motor ``robot/joint`` applies its ctrl
    [N m or N] to each joint that is no mimic joint. The keyframe ``start`` is the start of the scene. Free
    joints are at centres of mass; meshes are written as their convex hulls. Links that move have the inertia
    of the links that fixed joints connect to them; what does not move has none. Comments at the beginning
    name what the document cannot carry. Limits of velocity and effort, added frames and visual shapes are
    left out; geoms of a link have its first colour.

    Raises UnsupportedFeatureError for an inertia that MuJoCo refuses, such as that of a link that moves
    without mass, and for a ground that moves; DescriptionError for a fault in a collision shape or its mesh;
    EngineLimitError for a robot with too many links in a row; ArgumentError and UnknownNameError for options.
    """
    switches = {
        "collisions": collisions,
        "joint_limits": joint_limits,
        "joint_damping": joint_damping,
        "joint_friction": joint_friction,
        "joint_armature": joint_armature,
    }
    options = checked_options(dt, substeps, **switches)
    if engine not in world_names():
        raise UnknownBackendError(f"no world engine {shown(engine)}{nearest(engine, world_names())}")
    return layout_to_mjcf(scene, prepare(scene, **switches), options, settings, engine)


def layout_to_mjcf(
    scene: Scene,
    layout: Layout,
    options: Mapping[str, Any],
    settings: Mapping[str, object],
    engine: str = "mujoco",
) -> str:
    """Return the document of a prepared scene, with the options of its world in an engine and settings of
    MuJoCo.

    Raises the errors of `scene_to_mjcf`.
    """
    h = options["dt"] / options["substeps"]
    document = MjcfDocument(layout, h, checked_settings("mujoco", SETTINGS, settings))
    for refused in document.refused:
        raise refused.error
    remarks = (*_remarks(scene, layout, options, engine), *_remarks_on_sensors(scene, document.left_out))
    return document.text(remarks)


def _remarks(scene: Scene, layout: Layout, options: Mapping[str, Any], engine: str) -> Iterator[str]:
    """Yield what a reader of the document must know, and what it cannot carry."""
    yield (
        "The world of dynx in MuJoCo. The ctrl of a motor is the torque that World.step takes for its joint; "
        "the keyframe 'start' is the start of the world; free joints are at centres of mass."
    )
    if engine != "mujoco":
        yield (
            f"The world runs in {engine}. MJCF cannot carry its solver, contacts and settings: those of this "
            "document are MuJoCo's, with their defaults unless they are given, so the motions differ where "
            "parts touch."
        )
    if options["substeps"] > 1:
        yield f"A step of the world, {options['dt']!r} s, is {options['substeps']} steps of the document."
    for number, robot in enumerate(scene.robots):
        if layout.robots[number].friction.any() and not may_be_reached(layout, number):
            yield (
                f"{robot.name}: the dry friction of its joints is MuJoCo's. Where nothing can touch a robot, "
                "a world of dynx computes it outside of MuJoCo, as torques."
            )
        if robot.model.mechanism.coupling is not None:
            yield (
                f"{robot.name}: equality constraints couple its mimic joints softly. The torques by which "
                "dynx lets them follow exactly are not in the document."
            )
        if robot.motors:
            kinds = ", ".join(dict.fromkeys(type(motor).__name__ for motor in robot.motors))
            yield f"{robot.name}: the laws of its motors ({kinds}) are not in the document."


def _remarks_on_sensors(scene: Scene, left_out: Sequence[str]) -> Iterator[str]:
    """Yield how the sensors of the document differ from those of the scene."""
    if not scene.sensors:
        return
    yield (
        "The sensors of MuJoCo are called by the sensor and what it measures, and have neither errors nor "
        "rates nor delays. After a step they are those of its beginning, as in dynx."
    )
    kinds = {sensor.kind for sensor in scene.sensors if sensor.name not in left_out}
    notes = {
        "contact": "Sensors of contacts read in the axes of the world, those of dynx in axes of their own.",
        "ray": (
            "Sensors of rays read -1 where nothing is hit, those of dynx their length; from inside a shape "
            "they read the distance to its other side, those of dynx 0."
        ),
        "joint_torque": "Sensors of joint torques read three numbers, of which the last is along the axis.",
    }
    yield from (note for kind, note in notes.items() if kind in kinds)
    compensated = [
        sensor.name
        for sensor in scene.sensors
        if isinstance(sensor, ForceTorqueSensor) and not sensor.weight and sensor.name not in left_out
    ]
    for name in compensated:
        yield f"{name}: the weight of what it carries is not subtracted."
    for name in left_out:
        yield f"{name}: MuJoCo measures no force at fixed joints, whose links it merges; it is left out."
