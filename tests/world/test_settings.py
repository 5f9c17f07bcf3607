"""Settings of engines: checked by name and value, and documented with their defaults."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.errors import ArgumentError, UnknownNameError
from dynx.steppers.registry import world_class
from dynx.steppers.settings import Setting, checked_settings
from dynx.world import Scene, World, box, ground
from dynx.world.scene import SceneRobot
from tests.world.engines import WORLDS

PAGE = (Path(__file__).parents[2] / "docs" / "world.md").read_text(encoding="utf-8")


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
