"""Converted robots are read back the same, with their meshes, and what differs is found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.errors import ArgumentError, DescriptionError, UnknownNameError
from dynx.model import Inertial, Joint, JointDynamics, Limits, Link, Mimic, Model, Pose
from dynx.model.conversion import convert, robot_differences, shape_differences
from dynx.model.document_format import Format
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
    Plane,
    Sphere,
    Visual,
)
from dynx.model.urdf.writer import urdf_text
from dynx.testing.strategies import models

FORMATS: tuple[Format, ...] = ("mjcf", "sdf", "urdf")
CUBE = Inertial(1.0, ixx=1.0, iyy=1.0, izz=1.0)


def arm(geometry: LinkGeometry | None = None) -> Model:
    joints = [
        Joint("j", "revolute", "a", "b", limits=Limits(-1.0, 2.0, 3.0, 4.0)),
        Joint("k", "continuous", "b", "c", mimic=Mimic("j", 2.0, 0.5)),
        Joint("f", "fixed", "c", "d"),
    ]
    links = [Link(name, CUBE) for name in "abcd"]
    shapes = Geometry({} if geometry is None else {"b": geometry})
    return Model.build("arm", links, joints, geometry=shapes).with_frame("tip", "d", Pose((0.0, 0.0, 1.0)))


@given(models(physical=False))
def test_random_robots_are_the_same_in_both_formats(model: Model) -> None:
    for to in FORMATS:
        assert convert(model, to).differences == ()


CHANGES: dict[str, Callable[[Model], Model]] = {
    "name": lambda model: replace(model, name="other"),
    "base": lambda model: model.with_base("floating"),
    "gravity": lambda model: model.with_gravity((0.0, 0.0, -1.0)),
    "pose of the base": lambda model: model.with_base_pose(Pose((1e-9, 0.0, 0.0))),
    "frame 'tip'": lambda model: replace(model, extra_frames=()),
    "frame 'more'": lambda model: model.with_frame("more", "a"),
    "placement of frame 'tip'": lambda model: replace(model, extra_frames=()).with_frame("tip", "d"),
    "mass of link 'b'": lambda model: of_link(model, replace(CUBE, mass=1.0 + 1e-9)),
    "centre of mass of link 'b'": lambda model: of_link(model, replace(CUBE, origin=Pose((1e-9, 0.0, 0.0)))),
    "inertia of link 'b'": lambda model: of_link(model, replace(CUBE, ixy=1e-9)),
    "origin of joint 'j'": lambda model: of_joint(model, origin=Pose((0.0, 0.0, 0.0), (1e-9, 0.0, 0.0))),
    "axis of joint 'j'": lambda model: of_joint(model, axis=(0.0, 1.0, 0.0)),
    "range of joint 'j'": lambda model: of_joint(model, limits=Limits(-1.0, 2.1, 3.0, 4.0)),
    "limit of velocity or effort of joint 'j'": lambda model: of_joint(
        model, limits=Limits(-1.0, 2.0, 3.0, 4.1)
    ),
    "damping, friction, armature or spring of joint 'j'": lambda model: of_joint(
        model, dynamics=JointDynamics(armature=1e-9)
    ),
    "type of joint 'j'": lambda model: of_joint(model, type="prismatic"),
    "coupling of joint 'k'": lambda model: of_joint(model, "k", mimic=Mimic("j", 2.0, 0.6)),
    "locked position of joint 'j'": lambda model: dynx.load(model, lock={"j": 0.0}),
}


def of_link(model: Model, inertial: Inertial) -> Model:
    links = tuple(replace(each, inertial=inertial) if each.name == "b" else each for each in model.links)
    return replace(model, links=links)


def of_joint(model: Model, name: str = "j", **changes: object) -> Model:
    joints = tuple(
        replace(each, **changes) if each.name == name else each  # type: ignore[arg-type]
        for each in model.joints
    )
    return replace(model, joints=joints)


@pytest.mark.parametrize("what", CHANGES)
def test_every_change_is_found_and_named(what: str) -> None:
    model = arm()
    assert [*robot_differences(model, model)] == []
    assert any(what in each for each in robot_differences(model, CHANGES[what](model)))


def cube(path: Path, colour: str = "") -> str:
    corners = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + ([colour] if colour else [])
    lines += [f"f {a + 1} {b + 1} {c + 1}\nf {a + 1} {c + 1} {d + 1}" for a, b, c, d in quads]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n")
    return str(path)


ASCII_STL = """solid t
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 1 0
endloop
endfacet
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 0 1 0.25
vertex 0 0 1
endloop
endfacet
endsolid t
"""


@pytest.mark.parametrize("to", FORMATS)
def test_meshes_and_materials_go_along(tmp_path: Path, to: Format) -> None:
    seen = cube(tmp_path / "from" / "visual" / "part.obj", "mtllib part.mtl\nusemtl red")
    (tmp_path / "from" / "visual" / "part.mtl").write_text("newmtl red\nKd 1 0 0\n")
    felt = cube(tmp_path / "from" / "collision" / "part.obj")
    (tmp_path / "from" / "words.stl").write_text(ASCII_STL)
    blue = Appearance("blue", (0.0, 0.0, 1.0, 1.0))
    shapes = LinkGeometry(
        (
            Visual(Mesh(seen)),
            Visual(Mesh(seen, (2.0, -1.0, 1.0)), material=blue),
            Visual(Mesh(str(tmp_path / "from" / "words.stl"))),
            Visual(Box((1.0, 2.0, 3.0)), Pose((0.1, 0.2, 0.3), (0.4, 0.5, 0.6)), blue, "box"),
        ),
        (Collision(Mesh(felt)), Collision(Capsule(0.1, 0.2))),
    )
    model = arm(shapes)
    found = convert(model, to, "arm")
    assert (found.differences, found.shape_differences) == ((), ())
    path = tmp_path / "to" / f"arm.{to}"
    written = found.write(path)
    assert len(written) == 1 + len(found.files)
    back = dynx.load(path)
    visuals = back.geometry.visuals("b")
    meshes = [each.shape for each in visuals if isinstance(each.shape, Mesh)]
    assert all(each.file.startswith(str(path.parent)) for each in meshes)
    (red,) = meshes[0].parts
    assert red[1].rgba is not None
    assert red[1].rgba[:3] == (1.0, 0.0, 0.0)
    if to == "mjcf":
        mujoco = pytest.importorskip("mujoco")
        assert mujoco.MjModel.from_xml_path(str(path)).ngeom == 6
    with pytest.raises(ArgumentError, match="created"):
        found.write(tmp_path / "from" / "words.stl" / "arm.urdf")


def test_a_mesh_that_mujoco_does_not_read_becomes_obj(tmp_path: Path) -> None:
    model = dynx.load("ur5")
    found = convert(model, "mjcf", "ur5")
    assert {Path(name).suffix for name in found.files} == {".obj", ".mtl", ".stl"}
    assert found.shape_differences == ()
    found.write(tmp_path / "ur5.xml")
    mujoco = pytest.importorskip("mujoco")
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "ur5.xml")).nv == 6


def test_shapes_that_differ_are_named(tmp_path: Path) -> None:
    first, second = cube(tmp_path / "a.obj"), tmp_path / "b.obj"
    second.write_text((tmp_path / "a.obj").read_text().replace("v 1 1 1", "v 1 1 2"))
    model = arm(LinkGeometry((Visual(Mesh(first)),), (Collision(Sphere(1.0)),)))
    for visual, collision, word in (
        (Visual(Mesh(str(second))), Collision(Sphere(1.0)), "mesh"),
        (Visual(Mesh(first, (1.0, 1.0, 2.0))), Collision(Sphere(1.0)), "mesh"),
        (Visual(Mesh(first)), Collision(Sphere(1.0 + 1e-9)), "size"),
        (Visual(Mesh(first)), Collision(Box((1.0, 1.0, 1.0))), "kind"),
        (Visual(Mesh(first), Pose((0.0, 0.0, 1e-9))), Collision(Sphere(1.0)), "pose"),
        (
            Visual(Mesh(first), material=Appearance("", (1.0, 1.0, 1.0, 1.0))),
            Collision(Sphere(1.0)),
            "colour",
        ),
    ):
        (found,) = shape_differences(model, arm(LinkGeometry((visual,), (collision,))))
        assert word in found
        assert "'b'" in found
    (missing,) = shape_differences(model, arm(LinkGeometry((), (Collision(Sphere(1.0)),))))
    assert "0 of 1 visual shapes" in missing


def test_each_size_of_a_shape_that_differs_is_named() -> None:
    shapes = (
        Box((1.0, 2.0, 3.0)),
        Sphere(1.0),
        Cylinder(1.0, 2.0),
        Capsule(1.0, 2.0),
        Ellipsoid((1.0, 2.0, 3.0)),
    )
    for shape in shapes:
        model = arm(LinkGeometry((), (Collision(shape),)))
        others = []
        for field in fields(shape):
            value = getattr(shape, field.name)
            changed: list[object]
            if isinstance(value, tuple):
                changed = [(*value[:k], value[k] * (1.0 + 1e-9), *value[k + 1 :]) for k in range(len(value))]
            else:
                changed = [value * (1.0 + 1e-9)]
            others += [replace(shape, **{field.name: each}) for each in changed]  # type: ignore[arg-type]
        for other in others:
            assert list(shape_differences(model, arm(LinkGeometry((), (Collision(other),))))) == [
                "the size of number 1 of the collision shapes of link 'b' differs"
            ]


def test_missing_meshes_are_named_and_the_rest_is_written(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(
        '<robot name="r"><link name="a"><visual><geometry><mesh filename="gone.stl"/></geometry></visual>'
        '</link><link name="b"><visual><geometry><sphere radius="1"/></geometry><material name="m">'
        '<texture filename="lost.png"/></material></visual></link>'
        '<joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint></robot>'
    )
    model = dynx.load(path)
    found = convert(model, "mjcf")
    assert found.differences == ()
    for word in ("gone.stl", "lost.png"):
        assert any(word in each for each in found.notes)
    assert "0 of 1 visual shapes" in found.shape_differences[0]
    assert any("gone.stl" in each for each in convert(model, "urdf").notes)


@pytest.mark.parametrize("to", ["mjcf", "sdf", "urdf"])
def test_shapes_that_are_not_read_are_named_and_the_robot_is_written(tmp_path: Path, to: Format) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(
        '<robot name="r"><link name="a">'
        '<collision><geometry><mesh filename="gone.stl"/></geometry></collision>'
        '</link><link name="b"><collision><geometry><sphere radius="x"/></geometry></collision></link>'
        '<joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint></robot>'
    )
    found = convert(dynx.load(path), to)
    assert found.differences == ()
    for word in ("gone.stl", "'b'"):
        assert any(word in each for each in found.notes)
    assert any("'b'" in each for each in found.shape_differences)


@pytest.mark.parametrize("to", ["mjcf", "sdf", "urdf"])
@given(count=st.integers(2, 9))
def test_notes_of_one_kind_are_one_note(to: Format, count: int) -> None:
    shapes = (Capsule(0.1, 0.2), Plane())
    each = LinkGeometry((), tuple(Collision(shape, name="same") for shape in shapes))
    links = [Link(f"a{number}", CUBE) for number in range(count)]
    joints = [Joint(f"j{n}", "continuous", f"a{n}", f"a{n + 1}") for n in range(count - 1)]
    model = Model.build("r", links, joints, geometry=Geometry({link.name: each for link in links}))
    notes = [note for note in convert(model, to).notes if "MuJoCo has" not in note]
    assert len(notes) == {"mjcf": 2, "sdf": 1, "urdf": 2}[to]
    assert sum(f"{count} times" in note for note in notes) == {"mjcf": 0, "sdf": 1, "urdf": 2}[to]
    assert sum(f"{2 * count - 1} times" in note for note in notes) == (1 if to == "mjcf" else 0)


def test_what_urdf_cannot_say_is_noted() -> None:
    shapes = Collision(Capsule(0.1, 0.2)), Collision(Ellipsoid((0.1, 0.2, 0.3)))
    model = arm(LinkGeometry(collisions=shapes))
    changed = of_joint(model.with_gravity((0.0, 0.0, -1.0)), dynamics=JointDynamics(armature=0.1))
    notes = " ".join(convert(dynx.load(changed, lock={"j": 0.1}), "urdf").notes)
    for word in ("gravity", "'tip'", "'j'", "armature", "<capsule>", "<ellipsoid>"):
        assert word in notes
    assert convert(arm(), "urdf").notes[0].startswith("Added frames")
    assert "freely" in convert(model.with_base("floating"), "urdf").notes[0]
    assert "pose of the base" in convert(model.with_base_pose(Pose((1.0, 0.0, 0.0))), "urdf").notes[0]


def test_a_document_that_would_be_another_robot_is_not_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def wrong(model: Model, **options: Any) -> str:
        return urdf_text(model.with_base_pose(Pose((1.0, 0.0, 0.0))), **options)

    monkeypatch.setattr("dynx.model.conversion.urdf_text", wrong)
    found = convert(arm(), "urdf")
    assert found.differences[0] == "the pose of the base differs"
    with pytest.raises(ArgumentError, match="pose of the base"):
        found.write(tmp_path / "r.urdf")
    assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize("to", FORMATS)
@pytest.mark.parametrize("inertial", [None, CUBE])
def test_a_root_link_world_may_be_anywhere(to: Format, inertial: Inertial | None) -> None:
    joints = [Joint("j", "continuous", "world", "b"), Joint("k", "prismatic", "world", "c")]
    links = [Link("world", inertial), Link("b", CUBE), Link("c", CUBE)]
    shapes = Geometry({"world": LinkGeometry((), (Collision(Sphere(1.0)),))})
    model = Model.build("r", links, joints, geometry=shapes).with_frame("tip", "world", Pose((0.0, 0.0, 1.0)))
    for pose in (Pose(), Pose((1.0, 0.0, 0.0), (0.1, 0.2, 0.3))):
        found = convert(model.with_base_pose(pose), to)
        assert (found.differences, found.shape_differences) == ((), ())


def test_an_unknown_format_and_an_unspeakable_name_are_refused() -> None:
    with pytest.raises(UnknownNameError, match="mjcf"):
        convert(arm(), "mjfc")  # type: ignore[arg-type]
    with pytest.raises(DescriptionError, match="MJCF cannot express"):
        convert(replace(arm(), name="a\nb"), "mjcf")


def test_limits_of_the_round_trip_are_those_of_the_robot() -> None:
    model = dynx.load("panda")
    back = dynx.load(dynx.load(model.to_mjcf()).to_urdf())
    assert [*robot_differences(model, back)] == []
    np.testing.assert_array_equal(back.effort_limit, model.effort_limit)
