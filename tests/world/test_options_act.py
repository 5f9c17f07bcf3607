"""Every option of a scene, a part, a material and a world changes the motion on every engine, or is noted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest

import dynx
from dynx import Pose
from dynx.spatial.scalar import Floats
from dynx.world import (
    ExternalForce,
    Material,
    PDMotor,
    PointToPoint,
    PositionMotor,
    Scene,
    SceneRobot,
    TorqueMotor,
    VelocityMotor,
    Weld,
    World,
    box,
    ground,
    sphere,
)
from tests.world.engines import WORLDS

ENGINES = [name for name in WORLDS if find_spec(name) is not None]

INERTIAL = (
    '<inertial><origin xyz="0.15 0 0"/><mass value="1"/>'
    '<inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>'
)


def arm() -> dynx.Model:
    """Return two links on revolute joints, with all joint dynamics and limits."""
    parts = (
        f"""<joint name="j{k}" type="revolute">
          <parent link="l{k}"/><child link="l{k + 1}"/><origin xyz="{0.3 * k} 0 0"/><axis xyz="0 1 0"/>
          <limit lower="-0.2" upper="{0.4 - 0.45 * k}" effort="9" velocity="9"/>
          <dynamics damping="0.3" friction="0.4" armature="0.1"/>
          <dynx_spring stiffness="1" reference="0.3"/></joint>
        <link name="l{k + 1}">{INERTIAL}<collision><origin xyz="0.15 0 0"/><geometry>
          <box size="0.25 0.05 0.05"/></geometry></collision></link>"""
        for k in range(2)
    )
    return dynx.load(f'<robot name="arm"><link name="l0"/>{"".join(parts)}</robot>')


MATERIAL = Material(friction=0.4, torsional_friction=0.01, rolling_friction=0.004, restitution=0.2)


def scene_with(material: Material = MATERIAL, **options: Any) -> Scene:
    """Return an arm, a box that slides and spins, a ball that rolls and spins, one that falls, and two boxes
    that meet in the air."""
    bodies = (
        ground(material=material),
        box("slider", (0.3, 0.3, 0.1), mass=1.0, pose=Pose((0, 0, 0.05)), twist=(1, 0, 0, 0, 0, 4)),
        sphere("roller", 0.1, mass=1.0, pose=Pose((0, 2, 0.1)), twist=(1, 0, 0, 0, 10, 5)),
        sphere("falls", 0.1, mass=1.0, pose=Pose((0, 4, 0.15))),
        box("up", (0.1, 0.1, 0.1), mass=1.0, pose=Pose((0, 6, 1)), twist=(0, 0, 0, 1, 0, 0)),
        box("down", (0.1, 0.1, 0.1), mass=1.0, pose=Pose((0, 6.05, 0.85)), twist=(0, 0, 2, 0, 0, 0)),
    )
    moving = tuple(body if body.fixed else replace(body, material=material) for body in bodies)
    robot = SceneRobot(
        "arm", arm(), q=(-0.1, -0.1), v=(0.0, 1.5), material=material, motors=options.pop("motors", ())
    )
    return Scene("all", robots=(robot.at(Pose((5.0, 0.0, 2.0))),), bodies=moving, **options)


def motion(engine: str, scene: Scene, forces: Any = (), **options: Any) -> tuple[Floats, str]:
    """Return the state after 0.25 s as numbers, and the notes."""
    with World(scene, engine, 2.5e-3, **options) as world:
        world.run(0.25, forces=list(forces))
        state, notes = world.state, world.notes
    parts = [state.robots["arm"].q, state.robots["arm"].v]
    parts += [state.bodies[body.name].T_world_body for body in scene.bodies if not body.fixed]
    return np.concatenate([np.ravel(part) for part in parts]), " ".join(notes)


PUSH = ExternalForce("up", (5.0, 0.0, 0.0, 0.0, 0.0, 0.0))

CHANGES: dict[str, Callable[[], tuple[Scene, dict[str, Any]]]] = {
    "collisions": lambda: (scene_with(), {"collisions": False}),
    "joint_limits": lambda: (scene_with(), {"joint_limits": False}),
    "joint_damping": lambda: (scene_with(), {"joint_damping": False}),
    "joint_friction": lambda: (scene_with(), {"joint_friction": False}),
    "joint_armature": lambda: (scene_with(), {"joint_armature": False}),
    "joint_springs": lambda: (scene_with(), {"joint_springs": False}),
    "substeps": lambda: (scene_with(), {"substeps": 2}),
    "forces": lambda: (scene_with(), {"forces": [PUSH]}),
    "forces with a point": lambda: (scene_with(), {"forces": [replace(PUSH, point=(0.0, 0.05, 0.0))]}),
    "gravity": lambda: (scene_with(gravity=(0.5, 0.0, -9.81)), {}),
    "ignored": lambda: (scene_with(ignored=(("falls", "ground"),)), {}),
    "groups": lambda: (scene_with(groups=(("pair", ("up", "down")),), ignored=(("pair", "pair"),)), {}),
    "weld": lambda: (scene_with(constraints=(Weld("up", "down"),)), {}),
    "point": lambda: (
        scene_with(constraints=(PointToPoint("up", "world", (0, 0, 0.1), (0, 6, 1.1)),)),
        {},
    ),
    "torque motor": lambda: (scene_with(motors=(TorqueMotor(1.0),)), {}),
    "pd motor": lambda: (scene_with(motors=(PDMotor(0.0, 20.0, 1.0),)), {}),
    "position motor": lambda: (scene_with(motors=(PositionMotor(0.0, 20.0, 1.0),)), {}),
    "velocity motor": lambda: (scene_with(motors=(VelocityMotor(0.5, 3.0),)), {}),
    "friction": lambda: (scene_with(replace(MATERIAL, friction=0.1)), {}),
    "torsional_friction": lambda: (scene_with(replace(MATERIAL, torsional_friction=0.05)), {}),
    "rolling_friction": lambda: (scene_with(replace(MATERIAL, rolling_friction=0.02)), {}),
    "restitution": lambda: (scene_with(replace(MATERIAL, restitution=0.8)), {}),
}
"""Scenes and options that differ in one thing from `scene_with()` in a world with the defaults."""

LEAST = 1e-4
"""Change of the state [m, rad, m/s or rad/s] that counts as an effect."""


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", CHANGES)
def test_an_option_changes_the_motion_or_is_noted(name: str, engine: str) -> None:
    usual, _ = motion(engine, scene_with())
    scene, options = CHANGES[name]()
    changed, notes = motion(engine, scene, **options)
    assert np.abs(changed - usual).max() > LEAST or f"{name} of " in notes


@pytest.mark.parametrize("engine", ENGINES)
def test_what_is_kept_changes_no_motion(engine: str) -> None:
    usual, _ = motion(engine, scene_with())
    for options in ({"keep_last_step": True}, {"contact_interval": 0.1}):
        changed, _ = motion(engine, scene_with(), **options)
        np.testing.assert_array_equal(changed, usual)
