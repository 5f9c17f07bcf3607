"""Every robot of example-robot-data, loaded from its own file by Pinocchio and by PyBullet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dynx.agreement.tolerances import BAR
from dynx.doctor.examination import temporary_document, without_meshes
from dynx.engines.pinocchio.as_loaded import LoadedPinocchio
from dynx.errors import DynxError, EngineError
from dynx.loaded.difference import model_difference
from dynx.model import Model
from dynx.model.library import EXAMPLE_ROBOT_DATA, robots
from dynx.model.loading import load
from dynx.model.tree import Base
from dynx.model.xml.source import XmlSource
from dynx.reference.backend import ReferenceBackend
from tests.backends.robots import motion
from tests.loaded.files import TILTED, assert_alike, error

BASES: tuple[Base, ...] = ("fixed", "floating")


FILES = {entry.name: entry.path for entry in robots() if entry.source == EXAMPLE_ROBOT_DATA}
LEFT_OUT = "ur_description_ur3"
"""A file without any link."""
NAMES = [name for name in FILES if name != LEFT_OUT]


def written(name: str) -> XmlSource:
    return XmlSource(FILES[name].read_bytes(), name)


def source_of(name: str) -> XmlSource:
    return without_meshes(written(name))


def in_tree_coordinates(source: XmlSource, base: Base) -> Model:
    model = load(source.text, base=base, gravity=TILTED)
    return replace(model, joints=tuple(replace(joint, mimic=None) for joint in model.joints))


def test_one_robot_of_the_library_is_left_out() -> None:
    assert {name for name in FILES if not is_readable(written(name))} == {LEFT_OUT}


def is_readable(source: XmlSource) -> bool:
    try:
        load(source.text)
    except DynxError:
        return False
    return True


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("name", NAMES)
def test_pinocchio_loads_it_as_dynx_reads_it(name: str, base: Base) -> None:
    source = source_of(name)
    model = in_tree_coordinates(source, base)
    with temporary_document(source) as path, LoadedPinocchio(path, model) as robot:
        if model.nv:
            assert_alike(robot, model, solve=False)
        assert model_difference(model, [robot.describe()]) == ()


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("name", NAMES)
def test_pybullet_differs_where_the_model_difference_lists_it(name: str, base: Base) -> None:
    pytest.importorskip("pybullet")
    from dynx.engines.pybullet.as_loaded import LoadedPyBullet

    source = source_of(name)
    model = in_tree_coordinates(source, base)
    reference = ReferenceBackend(model)
    q, v, a = motion(model)
    refusal = _refusal(model)
    if refusal is not None:
        with temporary_document(source) as path, pytest.raises(EngineError, match=refusal):
            LoadedPyBullet(path, model)
        return
    with temporary_document(source) as path, LoadedPyBullet(path, model) as robot:
        rows = model_difference(model, [robot.describe()])
        poses = reference.forward_kinematics(q)[: len(model.links)]
        assert error(robot.link_poses(q), poses) <= BAR
        properties = {row.property for row in rows if row.part != "gravity"}
        # Everything that PyBullet makes of these files; none of it moves a joint or a frame.
        assert properties <= {"mass", "inertia", "axis", "lower", "upper"}
        if model.nv and not properties & {"mass", "inertia", "axis"}:
            assert error(robot.mass_matrix(q), reference.mass_matrix(q)) <= BAR
            torque = reference.inverse_dynamics(q, v, a)
            assert error(robot.inverse_dynamics(q, v, a), torque) <= BAR


def _refusal(model: Model) -> str | None:
    """Text of the expected error: too many joints, or a free base whose root has no mass in PyBullet."""
    if len(model.joints) > 127:
        return "joints, fixed ones included"
    inertial = model.link(model.root).inertial
    massless = model.root == "world" if inertial is None else inertial.mass == 0.0
    return "fixes" if massless and model.floating else None


def test_some_robots_are_loaded_alike_and_most_are_not() -> None:
    bullet = pytest.importorskip("dynx.engines.pybullet.as_loaded")
    alike = []
    for name in ("ur5", "solo12", "panda", "talos", "g1"):
        source = source_of(name)
        model = in_tree_coordinates(source, "fixed")
        q = model.random(0)
        with temporary_document(source) as path, bullet.LoadedPyBullet(path, model) as robot:
            M = ReferenceBackend(model).mass_matrix(q)
            alike.append(bool(np.max(np.abs(robot.mass_matrix(q) - M)) <= BAR * np.max(M)))
    assert alike == [True, True, False, False, False]
