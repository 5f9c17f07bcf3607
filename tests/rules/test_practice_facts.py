"""Statements of the practice rules about engines, checked with the installed engines.

These rules change no equation of motion, so there is no number to compare; what they change is the limits
that an engine holds, or whether it takes the file at all.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from dynx.doctor.examination import model_without_mimics, temporary_document, without_meshes
from dynx.engines.silence import silence
from dynx.loaded import LoadedJoint, installed_engines, load_as, loader_class
from dynx.rules.registry import find_trap, trap_case
from tests.rules.documents import case_of, joint, link

INSTALLED = installed_engines()
NONE = (-math.inf, math.inf)


def loaded_elbow(rule: str, engine: str) -> LoadedJoint:
    """Return the elbow of a rule's trap as an engine loads it."""
    if engine not in INSTALLED:
        pytest.skip(f"{engine} is not installed")
    case = trap_case(rule)
    model = model_without_mimics(case.source, case.base)
    with (
        temporary_document(without_meshes(case.source)) as path,
        silence(),
        load_as(engine, path, model) as robot,
    ):
        return robot.describe().joints["elbow"]


@pytest.mark.parametrize(
    ("rule", "engine", "property", "value"),
    [
        ("DX506", "pinocchio", "effort", 0.0),
        ("DX506", "pybullet", "effort", 0.0),
        ("DX506", "mujoco", "effort", None),
        ("DX507", "pinocchio", "velocity", 0.0),
        ("DX507", "pybullet", "velocity", 0.0),
        ("DX507", "drake", "velocity", 0.0),
        ("DX507", "mujoco", "velocity", None),
        ("DX508", "pinocchio", "limits", (0.0, 0.0)),
        ("DX508", "pybullet", "limits", NONE),
        ("DX508", "mujoco", "limits", NONE),
        ("DX508", "drake", "limits", NONE),
        ("DX509", "pinocchio", "limits", NONE),
        ("DX509", "pybullet", "limits", (-2.0, 2.0)),
        ("DX509", "mujoco", "limits", NONE),
        ("DX509", "drake", "limits", (-2.0, 2.0)),
    ],
)
def test_limits_that_an_engine_holds(rule: str, engine: str, property: str, value: Any) -> None:
    assert getattr(loaded_elbow(rule, engine), property) == value, loader_class(engine).engine_version()


@pytest.mark.parametrize(
    ("engine", "limits"),
    [("pinocchio", (0.5, 0.5)), ("pybullet", (0.5, 0.5)), ("mujoco", NONE), ("drake", (0.5, 0.5))],
)
def test_equal_limits_that_are_written(engine: str, limits: tuple[float, float]) -> None:
    if engine not in INSTALLED:
        pytest.skip(f"{engine} is not installed")
    equal = '<limit lower="0.5" upper="0.5" effort="1" velocity="1"/>'
    case = case_of(link("base"), link("arm"), joint("elbow", "base", "arm", limit=equal))
    with temporary_document(case.source) as path, silence(), load_as(engine, path, case.model) as robot:
        assert robot.describe().joints["elbow"].limits == limits


def test_pybullet_does_not_apply_the_limits_of_a_continuous_joint() -> None:
    p = pytest.importorskip("pybullet")
    client = p.connect(p.DIRECT)
    try:
        body = p.loadURDF(str(find_trap("DX509")), useFixedBase=True, physicsClientId=client)
        elbow = 1
        assert p.getJointInfo(body, elbow, physicsClientId=client)[8:10] == (-2.0, 2.0)
        p.setJointMotorControl2(body, elbow, p.VELOCITY_CONTROL, force=0, physicsClientId=client)
        p.resetJointState(body, elbow, 0.0, 4.0, physicsClientId=client)
        for _ in range(240):
            p.stepSimulation(physicsClientId=client)
        assert p.getJointState(body, elbow, physicsClientId=client)[0] > 2.0
    finally:
        p.disconnect(client)


def test_pinocchio_refuses_a_chain_of_mimics() -> None:
    pin = pytest.importorskip("pinocchio")
    with pytest.raises(ValueError, match="Mimicking and mimicked configuration spaces have different sizes"):
        pin.buildModelFromUrdf(str(find_trap("DX511")), mimic=True)
    assert pin.buildModelFromUrdf(str(find_trap("DX511"))).nv == 3


def missing(tag: str, folder: Path) -> str:
    """Return the path of a robot whose mesh, in <visual> or <collision>, is not there."""
    mesh = f'<{tag}><geometry><mesh filename="gone.stl"/></geometry></{tag}>'
    path = folder / "robot.urdf"
    path.write_text(case_of(link("base"), link("arm", mesh), joint("elbow", "base", "arm")).source.text)
    return str(path)


@pytest.mark.parametrize("tag", ["visual", "collision"])
def test_a_missing_mesh(tag: str, tmp_path: Path) -> None:
    path = missing(tag, tmp_path)
    if "pybullet" in INSTALLED:
        p = pytest.importorskip("pybullet")
        client = p.connect(p.DIRECT)
        try:
            with pytest.raises(p.error, match="Cannot load URDF file"), silence():
                p.loadURDF(path, physicsClientId=client)
        finally:
            p.disconnect(client)
    if "mujoco" in INSTALLED:
        mujoco = pytest.importorskip("mujoco")
        if tag == "collision":
            with pytest.raises(ValueError, match=r"gone\.stl"):
                mujoco.MjModel.from_xml_path(path)
        else:
            assert mujoco.MjModel.from_xml_path(path).nv == 1
    if "drake" in INSTALLED:
        parsing = pytest.importorskip("pydrake.multibody.parsing")
        plant = pytest.importorskip("pydrake.multibody.plant")
        builder = pytest.importorskip("pydrake.systems.framework").DiagramBuilder()
        robots, _ = plant.AddMultibodyPlantSceneGraph(builder, 0.001)
        with pytest.raises(RuntimeError, match=r"gone\.stl.*does not exist"):
            parsing.Parser(robots).AddModels(path)
    if "pinocchio" in INSTALLED:
        pin = pytest.importorskip("pinocchio")
        model = pin.buildModelFromUrdf(path)
        kind = pin.VISUAL if tag == "visual" else pin.COLLISION
        with pytest.raises(ValueError, match=r"gone\.stl could not be found"):
            pin.buildGeomFromUrdf(model, path, kind)
