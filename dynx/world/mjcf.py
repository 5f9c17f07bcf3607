"""A scene as an MJCF document: the world of dynx in MuJoCo, which MuJoCo and its tools run without dynx."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from dynx.argument_types import checks_types
from dynx.engines.mujoco.materials import SETTINGS
from dynx.engines.mujoco.mjcf import MjcfDocument
from dynx.errors import UnknownNameError
from dynx.steppers.layout import Layout
from dynx.steppers.materials import STRICT_MATERIALS, inexact_materials
from dynx.steppers.settings import checked_settings
from dynx.steppers.stepper import Stepper
from dynx.world.preparation import (
    JointDynamics,
    acting_layout,
    checked_options,
    may_be_reached,
    prepare,
)
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
    joint_damping: JointDynamics = True,
    joint_friction: JointDynamics = True,
    joint_armature: JointDynamics = True,
    joint_springs: JointDynamics = True,
    **settings: object,
) -> str:
    """Return a scene as an MJCF document, complete in itself: the model of its world in MuJoCo.

    The options are those of `World`, with the settings of MuJoCo. `World.to_mjcf` uses the options of the
    world, also of a world in another engine. The step of the document is that of the engine, dt / substeps
    [s].

    Links are bodies named ``robot/link``, bodies as in the scene, joints ``robot/joint``, free joints as the
    robot or body that they move, geoms by their part and number. A motor ``robot/joint`` applies its ctrl [N
    m or N] to each joint that is no mimic joint. The keyframe ``start`` is the start of the scene. Free
    joints are at centres of mass; meshes are written as their convex hulls. Links that move have the inertia
    of the links that fixed joints connect to them; links that do not move have none. Comments at the
    beginning name what the document cannot carry. Limits of velocity and effort, added frames and visual
    shapes are left out; geoms of a link have its first colour.

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
        "joint_springs": joint_springs,
    }
    options = checked_options(dt, substeps, **switches)
    if "engine" in settings:
        raise UnknownNameError(
            "a document of scene_to_mjcf is that of the world in MuJoCo, so that it takes no engine; "
            "World(scene, engine).to_mjcf() is that of a world in another engine"
        )
    return layout_to_mjcf(scene, prepare(scene, **switches), options, settings)


class OtherEngine(NamedTuple):
    """The engine in which the world of a document runs, where that is not MuJoCo."""

    stepper: Stepper
    settings: Mapping[str, Any]
    """Its settings in use."""
    notes: Sequence[str]
    """Sentences on joint dynamics that it does not have exactly."""


def layout_to_mjcf(
    scene: Scene,
    layout: Layout,
    options: Mapping[str, Any],
    settings: Mapping[str, object],
    engine: OtherEngine | None = None,
) -> str:
    """Return the document of a prepared scene, with the options of its world and settings of MuJoCo.

    Raises the errors of `scene_to_mjcf`.
    """
    h = options["dt"] / options["substeps"]
    start = replace(layout, collides=acting_layout(layout).collides)
    document = MjcfDocument(start, h, checked_settings("mujoco", SETTINGS, settings))
    for refused in document.refused:
        raise refused.error
    return document.text(
        (
            "The world of dynx in MuJoCo. The ctrl of a motor is the torque that World.step takes for its "
            "joint; the keyframe 'start' is the start of the world; free joints are at centres of mass. "
            "Visual shapes, and limits of effort and velocity, are left out.",
            *(() if engine is None else _remarks_on_engine(engine)),
            *(f"In this document {each}." for each in inexact_materials(document)),
            *_remarks(scene, layout, options, engine),
            *_remarks_on_sensors(scene, layout, document.left_out),
        )
    )


_COMMENT = re.compile("<!-- (.*?) -->\n", re.DOTALL)


def mjcf_remarks(document: str) -> tuple[str, ...]:
    """Return the comments at the beginning of a document of `scene_to_mjcf`, after the first, which is the
    same in all: they name what the document cannot carry."""
    found, end = [], 0
    # One after the other, because a name may look like an element.
    while (comment := _COMMENT.match(document, end)) is not None:
        found.append(comment[1])
        end = comment.end()
    return tuple(found[1:])


def _remarks_on_engine(engine: OtherEngine) -> Iterator[str]:
    """Yield what the engine of a world has that a document for MuJoCo cannot carry."""
    stepper = engine.stepper
    name, version = stepper.name, stepper.version
    yield (
        f"The world runs in {version if version.startswith(name) else f'{name} {version}'}, which has "
        f"{stepper.contact_law}. MJCF cannot carry that: contacts, constraints, joint limits and joint "
        "dynamics have the coefficients of the world, by the laws and the settings of MuJoCo, so that the "
        "motions differ where they act."
    )
    in_effect = {**engine.settings, **stepper.settings_in_effect(engine.settings, stepper.dt)}
    values = [
        f"{each} {value}" for each, value in in_effect.items() if stepper.settings[each] != STRICT_MATERIALS
    ]
    if values:
        yield f"Settings of {name} that are not in the document: {', '.join(values)}."
    for each in inexact_materials(stepper):
        yield f"In {name} {each}."
    for note in engine.notes:
        yield f"In the world, {note}."


def _remarks(
    scene: Scene, layout: Layout, options: Mapping[str, Any], engine: OtherEngine | None
) -> Iterator[str]:
    """Yield what the document of a world cannot carry, whatever its engine."""
    if options["substeps"] > 1:
        yield f"A step of the world, {options['dt']!r} s, is {options['substeps']} steps of the document."
    for constraint in layout.constraints:
        if not constraint.collides:
            do = "never touch" if constraint.active else "also touch while it acts"
            yield f"{' and '.join(constraint.names)}, the ends of a constraint with collides=False, {do}."
    for number, robot in enumerate(scene.robots):
        friction = layout.robots[number].friction
        if engine is None:
            name, outside = "MuJoCo", bool(friction.any()) and not may_be_reached(layout, number)
        else:
            name = engine.stepper.name
            outside = bool((friction != engine.stepper.layout.robots[number].friction).any())
        if outside:
            yield (
                f"{robot.name}: the dry friction of its joints is MuJoCo's, under which joints that stick "
                f"creep. The world computes it outside of {name}, as torques."
            )
        if robot.model.mechanism.coupling is not None:
            yield (
                f"{robot.name}: equality constraints couple its mimic joints softly. The torques by which "
                "dynx lets them follow exactly are not in the document."
            )
        if robot.motors:
            kinds = ", ".join(dict.fromkeys(type(motor).__name__ for motor in robot.motors))
            yield f"{robot.name}: the laws of its motors ({kinds}) are not in the document."


def _remarks_on_sensors(scene: Scene, layout: Layout, left_out: Sequence[str]) -> Iterator[str]:
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
        "ray": "Sensors of rays read -1 where nothing is hit, those of dynx their length.",
        "joint_torque": "Sensors of joint torques read three numbers, of which the last is along the axis.",
    }
    yield from (note for kind, note in notes.items() if kind in kinds)
    for robot in layout.robots:
        sensing = {each.kind for each in layout.sensors if each.part.startswith(f"{robot.name}/")}
        if robot.damping.any() and sensing & {"imu", "force_torque", "joint_torque"}:
            yield (
                f"{robot.name}: MuJoCo's sensors read the acceleration before the damping of the joints at "
                "the end of the step is added, those of dynx the acceleration of the step."
            )
        if robot.model.mechanism.coupling is not None and sensing:
            yield (
                f"{robot.name}: MuJoCo's sensors read its mimic joints as they follow softly, those of dynx "
                "as they follow exactly."
            )
    compensated = [
        sensor.name
        for sensor in scene.sensors
        if isinstance(sensor, ForceTorqueSensor) and not sensor.weight and sensor.name not in left_out
    ]
    for name in compensated:
        yield f"{name}: the weight of what it carries is not subtracted."
    for name in left_out:
        yield f"{name}: MuJoCo measures no force at fixed joints, whose links it merges; it is left out."
