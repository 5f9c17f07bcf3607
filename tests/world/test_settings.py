"""Settings of engines: checked by name and value, and documented with their defaults."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.contacts import find_case
from dynx.errors import ArgumentError, UnknownNameError
from dynx.steppers.registry import world_class
from dynx.steppers.settings import Setting, checked_settings
from dynx.world import (
    Material,
    PointToPoint,
    Scene,
    SceneRobot,
    Weld,
    World,
    WorldState,
    box,
    cylinder,
    ground,
    read_scene,
)
from tests.world.engines import WORLDS

PAGE = (Path(__file__).parents[2] / "docs/reference/worlds.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("engine", WORLDS)
def test_every_setting_is_documented_with_its_default(engine: str) -> None:
    pytest.importorskip({"drake": "pydrake"}.get(engine, engine))
    for name, setting in world_class(engine).settings.items():
        assert f"| `{engine}` | `{name}` | {setting.default} | {setting.meaning} |" in PAGE


@pytest.mark.parametrize("engine", WORLDS)
def test_every_default_is_valid(engine: str) -> None:
    pytest.importorskip({"drake": "pydrake"}.get(engine, engine))
    known = world_class(engine).settings
    defaults = checked_settings(engine, known, {})
    assert checked_settings(engine, known, defaults) == defaults


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        (Setting(1.0, ""), float("nan")),
        (Setting(1.0, ""), "1"),
        (Setting(1.0, "", least=0.5), 0.1),
        (Setting(1.0, "", most=2.0), 3.0),
        (Setting(1, ""), 1.5),
        (Setting(True, ""), 1),
        (Setting("a", "", choices=("a", "b")), "c"),
        (Setting((1.0, 2.0), ""), (1.0,)),
        (Setting((1.0, 2.0), ""), (1.0, -1.0)),
    ],
)
def test_an_invalid_value_is_refused(setting: Setting, value: object) -> None:
    with pytest.raises(ArgumentError, match="setting x"):
        setting.checked("x", value)


def test_a_setting_reaches_the_engine() -> None:
    scene = Scene("s", bodies=(box("a", (1.0, 1.0, 1.0), mass=1.0),))
    with World(scene, "pybullet", solver_iterations=7) as world:
        assert world.settings["solver_iterations"] == 7
    with pytest.raises(UnknownNameError, match="solver_iterations"):
        World(scene, "pybullet", solver_iteration=7)


def other_value(setting: Setting) -> Any:
    if setting.choices:
        return setting.choices[-1]
    if isinstance(setting.default, bool):
        return not setting.default
    if isinstance(setting.default, tuple):
        return setting.default
    grown = 2 * setting.default or 1
    return min(grown, type(grown)(setting.most)) if setting.most < 1e9 else grown


@pytest.mark.parametrize("engine", WORLDS)
def test_a_world_steps_with_every_setting_changed(engine: str) -> None:
    pytest.importorskip({"drake": "pydrake"}.get(engine, engine))
    scene = Scene("s", bodies=(ground(), box("b", (0.1, 0.1, 0.1), mass=1.0)))
    for name, setting in world_class(engine).settings.items():
        value = other_value(setting)
        with World(scene, engine, **{name: value}) as world:
            assert world.settings[name] == value
            world.step(5)


def test_link_damping_is_that_of_bullet_by_itself(tmp_path: Path) -> None:
    pybullet = pytest.importorskip("pybullet")
    model = dynx.load("double_pendulum", gravity=(0, 0, 0))
    path = tmp_path / "robot.urdf"
    path.write_text(model.to_urdf())
    q, v = (0.3, -0.4), (2.0, -3.0)
    scene = Scene("s", robots=(SceneRobot("r", model, q=q, v=v),), gravity=(0, 0, 0))
    options = {"joint_damping": False, "joint_friction": False, "joint_limits": False}
    ends = {}
    for damping in (0.0, 0.04):
        with World(scene, "pybullet", **options, collisions=False, link_damping=damping) as world:
            world.step(1000)
            ends[damping] = world.state.robots["r"]
    client = pybullet.connect(pybullet.DIRECT)
    try:
        pybullet.setTimeStep(1e-3, physicsClientId=client)
        flags = pybullet.URDF_USE_INERTIA_FROM_FILE
        body = pybullet.loadURDF(str(path), useFixedBase=True, flags=flags, physicsClientId=client)
        joints = [
            k
            for k in range(pybullet.getNumJoints(body, physicsClientId=client))
            if pybullet.getJointInfo(body, k, physicsClientId=client)[2] != pybullet.JOINT_FIXED
        ]
        for k, position, velocity in zip(joints, q, v, strict=True):
            pybullet.setJointMotorControl2(
                body, k, pybullet.VELOCITY_CONTROL, force=0, physicsClientId=client
            )
            pybullet.changeDynamics(
                body,
                k,
                jointDamping=0.0,
                jointLowerLimit=-1e9,
                jointUpperLimit=1e9,
                physicsClientId=client,
            )
            pybullet.resetJointState(body, k, position, velocity, physicsClientId=client)
        for _ in range(1000):
            pybullet.stepSimulation(physicsClientId=client)
        found = np.array([pybullet.getJointState(body, k, physicsClientId=client)[:2] for k in joints]).T
    finally:
        pybullet.disconnect(client)
    np.testing.assert_allclose(found, ends[0.04], atol=1e-9)
    assert np.abs(found - ends[0.0]).max() > 1e-2


def test_settings_are_given_by_their_names() -> None:
    with pytest.raises(UnknownNameError, match=r"or as \*\*settings"):
        World(Scene("s", bodies=(ground(),)), "pybullet", settings={"erp": 0.3})


ARM = """<robot name="arm"><link name="base"/>
<link name="rod"><inertial><origin xyz="0.2 0 0"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0.2 0 0"/><geometry><sphere radius="0.05"/></geometry></collision></link>
<joint name="hinge" type="revolute"><parent link="base"/><child link="rod"/><origin xyz="-1 0 2"/>
<axis xyz="0 1 0"/>
<limit lower="-1" upper="0.1" effort="9" velocity="9"/><dynamics friction="0.2"/></joint></robot>"""


def busy_scene() -> Scene:
    """Return a scene in which every setting of every engine acts: impacts, sliding and sticking of boxes, a
    cylinder and a mesh, a joint with friction that reaches a limit, a weld, and a point held by another."""
    rough = Material(friction=0.4, restitution=0.3, rolling_friction=0.01, torsional_friction=0.01)
    bodies = (
        ground(material=rough),
        box("a", (0.2, 0.2, 0.2), mass=1.0, pose=dynx.Pose((3.0, 0.0, 0.3), (0.3, 0.2, 0.1)), material=rough),
        box("b", (0.2, 0.2, 0.2), mass=3.0, pose=dynx.Pose((3.05, 0.0, 0.6), (0.0, 0.2, 0.1))),
        cylinder("c", 0.1, 0.3, mass=1.0, pose=dynx.Pose((0.0, 0.0, 0.8), (0.5, 0.2, 0.0))),
        box("welded", (0.1, 0.1, 0.1), mass=2.0, pose=dynx.Pose((2.0, 0.0, 1.0))),
        box("carrier", (0.1, 0.1, 0.1), mass=2.0, pose=dynx.Pose((2.2, 0.0, 1.0))),
        box("hung", (0.1, 0.1, 0.1), mass=2.0, pose=dynx.Pose((2.2, 1.0, 1.5))),
    )
    arms = (SceneRobot("arm", dynx.load(ARM)),)
    held = PointToPoint("hung", "ground", (0.1, 0.0, 0.0), (2.3, 1.0, 1.5))
    return Scene("busy", (*read_scene("duck").robots, *arms), bodies, (Weld("carrier", "welded"), held))


def alternatives(setting: Setting) -> list[Any]:
    """Return values of a setting that differ much from its default."""
    if setting.choices:
        return [choice for choice in setting.choices if choice != setting.default]
    if isinstance(setting.default, bool):
        return [not setting.default]
    if isinstance(setting.default, tuple):
        return [tuple(0.9 * number for number in setting.default)]
    if isinstance(setting.default, int):
        return [1, 3]
    default = float(setting.default)
    return [min(3.0 * default or 0.05, setting.most), max(0.3 * default, setting.least), 1e-5 * default]


def moved_by(engine: str, settings: dict[str, Any]) -> tuple[list[float], tuple[str, ...]]:
    """Return the numbers of the state of the busy scene after a while, and the notes of its world."""
    scene = busy_scene()
    if engine == "dynx":  # which has no contacts, constraints or friction
        falling = [body for body in scene.bodies if body.name in ("a", "b")]
        scene = Scene("falling", bodies=tuple(replace(each, twist=(0, 0, 0, 9, 5, 1)) for each in falling))
    with World(scene, engine, dt=5e-3, collisions=engine != "dynx", **settings) as world:
        world.step(60 if engine == "dynx" else 150)
        return [float.fromhex(x) for x in numbers_of(world.state)], world.notes


def numbers_of(state: WorldState) -> Iterator[str]:
    """Yield every number of the state of robots and bodies, exactly."""
    for robot in state.robots.values():
        yield from (x.hex() for x in [*robot.q.tolist(), *robot.v.tolist()])
    for body in state.bodies.values():
        yield from (x.hex() for x in np.concatenate([np.ravel(part) for part in body]).tolist())


@pytest.mark.parametrize("engine", [*WORLDS, "dynx"])
def test_a_changed_setting_changes_the_motion_or_is_named(engine: str) -> None:
    pytest.importorskip({"drake": "pydrake", "dynx": "dynx"}.get(engine, engine))
    usual, notes = moved_by(engine, {})
    assert not any("no effect" in note for note in notes)
    for name, setting in world_class(engine).settings.items():
        if name in ("strict_materials", "backend"):
            continue  # the first refuses a scene, and every backend computes the same
        assert acts_or_is_named(engine, name, setting, usual), (engine, name)


def acts_or_is_named(engine: str, name: str, setting: Setting, usual: list[float]) -> bool:
    for value in alternatives(setting):
        motion, notes = moved_by(engine, {name: value})
        named = any(note.startswith(f"setting {name} is {value}, and has no effect") for note in notes)
        assert not named or motion == usual, "it has an effect"
        if named or motion != usual:
            return True
    return False


@pytest.mark.parametrize(
    ("engine", "others"),
    [
        ("dynx", {"integrator": "adaptive"}),
        ("pybullet", {"friction_anchors": True}),
        ("drake", {"contact_approximation": "sap"}),
        ("drake", {"contact_approximation": "similar"}),
    ],
)
def test_a_setting_that_needs_another_acts_with_it(engine: str, others: dict[str, Any]) -> None:
    pytest.importorskip({"drake": "pydrake"}.get(engine, engine))
    usual, _ = moved_by(engine, others)
    for name, setting in world_class(engine).settings.items():
        if setting.needs is not None and setting.needs[0] in others:
            idle = others[setting.needs[0]] not in setting.needs[1]
            value = {"rtol": 1e-3, "atol": 1e-2}.get(name, alternatives(setting)[0])
            motion, notes = moved_by(engine, {**others, name: value})
            assert any("no effect" in note for note in notes) is idle
            assert (motion == usual) is idle, name


def test_anchored_contacts_do_not_creep_and_saved_worlds_without_them_are_the_same(tmp_path: Path) -> None:
    pytest.importorskip("pybullet")
    case = find_case("slope")
    scene, moved = case.scene(0.4), {}
    for anchors in (False, True):
        with World(scene, "pybullet", 2e-3, friction_anchors=anchors) as world:
            world.run(0.6)
            before = world.state.bodies["box"].position
            world.run(0.5)
            moved[anchors] = float(np.linalg.norm(world.state.bodies["box"].position - before))
    assert moved[False] > 1e-7
    assert moved[True] < 1e-3 * moved[False]
    # A world of a version without the setting has the same identity, so that its states are continued.
    with World(scene, "pybullet") as world:
        expected = world.identity
        del world.settings["friction_anchors"]  # type: ignore[attr-defined]
        world._identity = None
        assert world.identity == expected
    with World(scene, "pybullet", friction_anchors=True) as world:
        assert world.identity != expected
