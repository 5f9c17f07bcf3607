"""Shapes of links, as the description states them and as engines read them."""

from __future__ import annotations

import pickle
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import dynx
from dynx.errors import DescriptionError, UnknownNameError
from dynx.model import Link, Model
from dynx.model.geometry import (
    Appearance,
    Box,
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    Geometry,
    LinkGeometry,
    Mesh,
    Sphere,
)
from dynx.model.library import robots
from tests.model.geometry.mesh_files import stl

ROBOTS = ("panda", "anymal", "talos_box", "solo12", "hector", "ur5", "double_pendulum_simple")


def link(*shapes: str, materials: str = "") -> Model:
    return dynx.load(f'<robot name="r">{materials}<link name="a">{"".join(shapes)}</link></robot>')


def visual(geometry: str, more: str = "") -> str:
    return f"<visual><geometry>{geometry}</geometry>{more}</visual>"


def test_every_shape_is_read() -> None:
    found = link(
        visual('<box size="1 2 3"/>', '<origin xyz="1 0 0" rpy="0 0 1"/>'),
        visual('<sphere radius="2"/>'),
        visual('<cylinder radius="1" length="2"/>'),
        visual('<capsule radius="1" length="2"/>'),
        visual('<ellipsoid radii="1 2 3"/>'),
    ).geometry.visuals("a")
    assert [each.shape for each in found] == [
        Box((1, 2, 3)),
        Sphere(2),
        Cylinder(1, 2),
        Capsule(1, 2),
        Ellipsoid((1, 2, 3)),
    ]
    assert found[0].origin.xyz == (1.0, 0.0, 0.0)
    assert found[0].line == 1


def test_materials_are_those_of_the_robot_or_of_an_earlier_visual() -> None:
    box = '<box size="1 1 1"/>'
    found = link(
        visual(box, '<material name="red"/>'),
        visual(box, '<material name="green"><color rgba="0 1 0 1"/></material>'),
        visual(box, '<material name="green"/>'),
        visual(box, '<material name="none"/>'),
        visual(box),
        materials='<material name="red"><color rgba="1 0 0 0.5"/><texture filename="a.png"/></material>',
    ).geometry.visuals("a")
    green = Appearance("green", (0.0, 1.0, 0.0, 1.0))
    red = Appearance("red", (1.0, 0.0, 0.0, 0.5), "a.png")
    assert [each.material for each in found] == [red, green, green, Appearance("none"), None]


@pytest.mark.parametrize(
    ("geometry", "message"),
    [
        ('<box size="1 0 1"/>', r"size of a box\[1\] is 0.0"),
        ('<box size="1 1"/>', "wanted three numbers"),
        ("<box/>", "no attribute size"),
        ('<sphere radius="-1"/>', "radius of a sphere"),
        ('<sphere radius="nan"/>', "radius in <sphere>"),
        ('<cone radius="1"/>', "unknown shape <cone>"),
        ("<mesh/>", "has no filename"),
        ('<mesh filename="a.stl" scale="1 0 1"/>', "wanted no zero"),
        ("", "<geometry> of <collision> 1 of link 'a' is empty"),
    ],
)
def test_a_fault_is_raised_where_the_shapes_are_asked_for(geometry: str, message: str) -> None:
    shape = f"<collision><geometry>{geometry}</geometry></collision>"
    model = link(shape, visual('<sphere radius="1"/>'))
    assert len(model.geometry.visuals("a")) == 1
    with pytest.raises(DescriptionError, match=message) as caught:
        model.geometry.collisions("a")
    assert caught.value.line == 1


def test_geometry_is_kept_and_does_not_change_equality() -> None:
    plain, shaped = link(), link(visual('<sphere radius="1"/>'))
    assert plain == shaped
    for model in (
        shaped.with_base("floating"),
        pickle.loads(pickle.dumps(shaped)),
        dynx.load(shaped, gravity=[0, 0, 0]),
    ):
        assert model.geometry == shaped.geometry
    assert plain.geometry != shaped.geometry


def test_models_of_programs_have_the_geometry_given() -> None:
    ball = Geometry({"a": LinkGeometry(collisions=(Collision(Sphere(1.0)),))})
    model = Model.build("r", [Link("a")], [], geometry=ball)
    assert model.geometry.collisions("a") == (Collision(Sphere(1.0)),)
    assert Model.build("r", [Link("b")], []).geometry.collisions("b") == ()
    with pytest.raises(UnknownNameError, match="geometry of 'a'"):
        Model.build("r", [Link("b")], [], geometry=ball)
    with pytest.raises(UnknownNameError, match="no link 'c'"):
        model.geometry.visuals("c")


def test_meshes_are_found_beside_the_file_and_nowhere_outside(tmp_path: Path) -> None:
    folder = tmp_path / "robot" / "urdf"
    folder.mkdir(parents=True)
    for place in (tmp_path / "secret.stl", tmp_path / "robot" / "part.stl"):
        place.write_bytes(stl())
    meshes = "".join(
        visual(f'<mesh filename="{name}" scale="1 1 2"/>')
        for name in ("../part.stl", "../../secret.stl", str(tmp_path / "secret.stl"), "../absent.stl")
    )
    text = f'<robot name="r"><link name="a">{meshes}</link></robot>'
    (folder / "r.urdf").write_text(text)

    def faults(model: Model) -> list[bool]:
        shapes = [each.shape for each in model.geometry.visuals("a")]
        return [isinstance(shape, Mesh) and shape.fault is None for shape in shapes]

    model = dynx.load(folder / "r.urdf")
    assert faults(model) == [True, False, False, False]
    assert faults(dynx.load(text)) == [False] * 4
    assert faults(dynx.load(text, package_dirs=[tmp_path])) == [False, False, True, False]
    found = model.geometry.visuals("a")[0].shape
    assert isinstance(found, Mesh)
    assert np.ptp(found.triangles[0], axis=0).tolist() == [1.0, 2.0, 6.0]
    secret = model.geometry.visuals("a")[1].shape
    assert isinstance(secret, Mesh)
    with pytest.raises(DescriptionError, match="outside the folder of the description"):
        _ = secret.triangles


def _files(names: tuple[str, ...]) -> list[tuple[str, Path]]:
    return [(entry.name, entry.path) for entry in robots() if entry.name in names]


@pytest.mark.parametrize(("name", "path"), _files(ROBOTS))
def test_pinocchio_reads_the_same_collision_shapes(name: str, path: Path) -> None:
    pinocchio = pytest.importorskip("pinocchio")
    model = dynx.load(path)
    found = Counter(each.name for each in model.links for _ in model.geometry.collisions(each.name))
    native = pinocchio.buildModelFromUrdf(str(path), pinocchio.JointModelFreeFlyer())
    folders = [str(path.parents[k]) for k in range(1, min(6, len(path.parents)))]
    read = pinocchio.buildGeomFromUrdf(native, str(path), pinocchio.GeometryType.COLLISION, None, folders)
    # Pinocchio names the shapes of a link LINK_0, LINK_1, ...
    assert Counter(each.name.rpartition("_")[0] for each in read.geometryObjects) == found


@pytest.mark.parametrize(("name", "path"), _files(("panda", "anymal", "hector")))
def test_pybullet_reads_the_same_collision_shapes(name: str, path: Path) -> None:
    pybullet = pytest.importorskip("pybullet")
    model = dynx.load(path)
    client = pybullet.connect(pybullet.DIRECT)
    try:
        pybullet.setAdditionalSearchPath(str(path.parents[3]), physicsClientId=client)
        body = pybullet.loadURDF(str(path), physicsClientId=client)
        joints = range(pybullet.getNumJoints(body, physicsClientId=client))
        names = {k: pybullet.getJointInfo(body, k, physicsClientId=client)[12].decode() for k in joints}
        names[-1] = model.root
        read = {
            name: len(pybullet.getCollisionShapeData(body, k, physicsClientId=client))
            for k, name in names.items()
        }
    finally:
        pybullet.disconnect(client)
    assert {each.name: len(model.geometry.collisions(each.name)) for each in model.links} == read
