"""SDF is read as Drake reads it, and what a model cannot say is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given

import dynx
from dynx.errors import ArgumentError, DescriptionError, UnsupportedFeatureError
from dynx.model.geometry import Box, Capsule, Ellipsoid, Mesh, Plane, Sphere
from dynx.model.geometry.stated_mesh import StatedMesh
from dynx.model.sdf.vocabulary import ATTRIBUTES, CLOSED, NOT_USED, USED, is_undefined
from dynx.model.xml.reading import Element, read_xml
from dynx.spatial.scalar import Floats
from tests.model.sdf.models import models, old_models

EXACT = 1e-12
"""Largest difference, relative to the largest entry: both compute in double precision."""

ARM = """<sdf version="1.9"><model name="arm">
  <link name="base"/>
  <link name="link"><pose>0 0 1 0 0 0</pose></link>
  <joint name="weld" type="fixed"><parent>world</parent><child>base</child></joint>
  <joint name="hinge" type="revolute">
    <parent>base</parent><child>link</child>
    <axis><xyz>0 1 0</xyz></axis>
  </joint>
</model></sdf>"""

FREE = '<sdf version="1.9"><model name="ball"><link name="ball"/></model></sdf>'

LINK = '<link name="link"><pose>0 0 1 0 0 0</pose></link>'


def require_close(got: Floats, want: Floats, tolerance: float = EXACT) -> None:
    assert np.abs(got - want).max(initial=0.0) <= tolerance * max(np.abs(want).max(initial=0.0), 1e-3)


def pose_of(model: dynx.Model, frame: str, q: list[float]) -> Floats:
    return np.asarray(dynx.backend("reference", model).forward_kinematics(q)[model.frame_index(frame)])


def require_like_drake(path: Path, text: str | None = None) -> None:
    """Compare mass matrix, bias and poses of all links with Drake."""
    pytest.importorskip("pydrake")
    from benchmarks.surveys.raw_drake_sdf import DrakeRobot
    from benchmarks.surveys.sdf_files import compare

    if text is not None:
        path.write_text(text, encoding="utf-8")
    difference, quantity = compare(dynx.load(path), DrakeRobot(path))
    assert difference <= EXACT, quantity


@given(text=models())
def test_random_models_are_read_as_drake_reads_them(
    tmp_path_factory: pytest.TempPathFactory, text: str
) -> None:
    require_like_drake(tmp_path_factory.getbasetemp() / "robot.sdf", text)


@given(text=old_models())
def test_models_of_old_versions_are_read_as_drake_reads_them(
    tmp_path_factory: pytest.TempPathFactory, text: str
) -> None:
    require_like_drake(tmp_path_factory.getbasetemp() / "old.sdf", text)


SAMPLES = sorted((Path(__file__).parent / "samples").glob("*.sdf"))


@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.name)
def test_files_are_read_as_drake_reads_them(path: Path) -> None:
    require_like_drake(path)


# -- the base, gravity and worlds ---------------------------------------------------------------


def test_the_base_is_the_files() -> None:
    assert dynx.load(ARM).root == "world"
    free = dynx.load(FREE, base="floating")
    assert (free.root, free.floating, free.total_mass) == ("ball", True, 1.0)
    for text, base in ((FREE, "fixed"), (ARM, "floating")):
        with pytest.raises(ArgumentError, match="with_base"):
            dynx.load(text, base=base)  # type: ignore[arg-type]
    static = dynx.load(FREE.replace('"ball">', '"ball"><static>true</static>', 1))
    assert (static.base, static.nv, static.root) == ("fixed", 0, "world")
    (joint,) = static.joints
    assert (joint.type, joint.child) == ("fixed", "ball")


def test_joints_of_a_static_model_hold() -> None:
    model = dynx.load(ARM.replace('"arm">', '"arm"><static>1</static>'))
    assert model.nv == 0
    assert any("static" in note.message for note in model.notes)
    require_close(pose_of(model, "link", [])[:3, 3], np.array([0.0, 0.0, 1.0]))


def world(content: str, version: str = "1.9") -> str:
    return f'<sdf version="{version}"><world name="w">{content}</world></sdf>'


GROUND = (
    '<model name="ground"><static>true</static><link name="link"><collision name="c"><geometry>'
    "<plane><normal>0 0 1</normal></plane></geometry></collision></link></model>"
)


def test_one_model_of_a_world_is_loaded_with_the_gravity_and_the_pose_of_the_world() -> None:
    inside = ARM.partition(">")[2].removesuffix("</sdf>").replace('"arm">', '"arm"><pose>1 2 3 0 0 0</pose>')
    model = dynx.load(world(f"<gravity>0 0 -1.6</gravity>{GROUND}{inside}"))
    assert model.name == "arm"
    assert model.gravity == (0.0, 0.0, -1.6)
    assert model.joint_names == ("hinge",)
    require_close(pose_of(model, "link", [0.0])[:3, 3], np.array([1.0, 2.0, 4.0]))
    (plane,) = model.geometry.collisions("ground::link")
    assert plane.shape == Plane()
    # Of a robot that moves freely, the ground is no part.
    ball = FREE.partition(">")[2].removesuffix("</sdf>")
    free = dynx.load(world(GROUND + ball))
    assert (free.root, free.gravity) == ("ball", (0.0, 0.0, -9.8))
    assert any("no part of it" in note.message for note in free.notes)
    old = world(f"<physics><gravity>0 0 -3</gravity></physics>{ball}", "1.5")
    assert dynx.load(old).gravity == (0.0, 0.0, -3.0)
    assert dynx.load(old.replace("1.5", "1.6")).gravity == (0.0, 0.0, -9.8)


def test_a_world_of_several_robots_is_refused_and_read_scene_named() -> None:
    ball = FREE.partition(">")[2].removesuffix("</sdf>")
    inside = ARM.partition(">")[2].removesuffix("</sdf>")
    several = (
        world(ball + ball.replace('"ball"', '"other"')),
        world(ball + inside),
        world(inside + inside.replace('"arm"', '"other"')),
        ARM.replace("</model>", '<link name="apart"/></model>'),
        f'<sdf version="1.9">{inside}{ball}</sdf>',
    )
    for text in several:
        with pytest.raises(UnsupportedFeatureError, match="read_scene"):
            dynx.load(text)


def test_a_model_without_weight_has_no_gravity() -> None:
    light = FREE.replace('name="ball"/>', 'name="ball"><gravity>false</gravity></link>')
    assert dynx.load(light).gravity == (0.0, 0.0, 0.0)
    some = ARM.replace('name="base"/>', 'name="base"><gravity>0</gravity></link>')
    model = dynx.load(some)
    assert model.gravity == (0.0, 0.0, -9.81)
    assert any("<gravity> of link 'base'" in note.message for note in model.notes)


# -- joints -------------------------------------------------------------------------------------


def test_a_joint_off_the_origin_of_its_child_keeps_the_frame_of_the_link() -> None:
    model = dynx.load(ARM.replace('"revolute">', '"revolute"><pose>0.5 0 0 0 0 0</pose>'))
    assert model.joint("hinge").child == "hinge_link"
    # About (0.5, 0, 1), the origin of the link goes from -x to +z.
    require_close(pose_of(model, "link", [np.pi / 2])[:3, 3], np.array([0.5, 0.0, 1.5]))
    along = dynx.load(ARM.replace('"revolute">', '"revolute"><pose>0 0.5 0 0 0 0</pose>'))
    assert along.joint("hinge").child == "link"


@pytest.mark.parametrize("kind", ["universal", "revolute2"])
def test_a_joint_of_two_axes_is_a_chain(kind: str) -> None:
    two = "<axis2><xyz>0 0 1</xyz><limit><upper>0.5</upper><effort>-1</effort></limit></axis2>"
    text = ARM.replace("revolute", kind).replace("</joint>\n</model>", f"{two}</joint></model>")
    model = dynx.load(text)
    assert model.joint_names == ("hinge_axis", "hinge_axis2")
    assert [link.name for link in model.links] == ["world", "base", "hinge_axis_link", "link"]
    assert (model.joint("hinge_axis2").limits.upper, model.joint("hinge_axis2").limits.effort) == (
        0.5,
        np.inf,
    )
    a, b = 0.3, -0.7
    y = np.array([[np.cos(a), 0.0, np.sin(a)], [0.0, 1.0, 0.0], [-np.sin(a), 0.0, np.cos(a)]])
    z = np.array([[np.cos(b), -np.sin(b), 0.0], [np.sin(b), np.cos(b), 0.0], [0.0, 0.0, 1.0]])
    require_close(pose_of(model, "link", [a, b])[:3, :3], y @ z)


def test_a_joint_whose_child_is_nearer_to_the_root_is_turned_round() -> None:
    turned = ARM.replace(
        "<parent>base</parent><child>link</child>", "<parent>link</parent><child>base</child>"
    )
    turned = turned.replace('"revolute">', '"universal"><pose>0.1 0 0.2 0.3 0 0</pose>')
    turned = turned.replace("</joint>\n</model>", "<axis2><xyz>1 0 0</xyz></axis2></joint>\n</model>")
    model = dynx.load(turned)
    other = dynx.load(turned.replace("world</parent><child>base", "world</parent><child>link"))
    first = {"hinge_axis": 0.4, "hinge_axis2": -0.9}
    poses = []
    for each in (model, other):
        q = [first[name] for name in each.joint_names]
        poses.append(np.linalg.inv(pose_of(each, "base", q)) @ pose_of(each, "link", q))
    require_close(poses[0], poses[1])
    assert model.joint_names == ("hinge_axis2", "hinge_axis")


def test_limits_dynamics_and_mimic() -> None:
    axis = (
        "<axis><xyz>0 1 0</xyz><limit><lower>-1e16</lower><upper>inf</upper><velocity>-1</velocity></limit>"
        "<dynamics><damping>0.5</damping><friction>0.2</friction><spring_stiffness>3</spring_stiffness>"
        "<spring_reference>0.1</spring_reference></dynamics>"
        "</axis>"
    )
    follower = (
        '<link name="tip"/><joint name="slide" type="prismatic"><parent>link</parent><child>tip</child>'
        '<axis><xyz>1 0 0</xyz><mimic joint="hinge"><multiplier>2</multiplier><offset>0.5</offset>'
        "<reference>0.1</reference></mimic></axis></joint></model>"
    )
    text = ARM.replace("<axis><xyz>0 1 0</xyz></axis>", axis).replace("</model>", follower)
    model = dynx.load(text.replace('version="1.9"', 'version="1.11"'))
    hinge = model.joint("hinge")
    assert (hinge.type, hinge.limits.velocity) == ("continuous", np.inf)
    assert (hinge.dynamics.damping, hinge.dynamics.friction) == (0.5, 0.2)
    assert (hinge.dynamics.stiffness, hinge.dynamics.spring_reference) == (3.0, 0.1)
    assert not any("spring" in note.message for note in model.notes)
    mimic = model.joint("slide").mimic
    assert mimic is not None
    assert (mimic.joint, mimic.multiplier) == ("hinge", 2.0)
    assert mimic.offset == pytest.approx(0.3)


# -- frames, nested models and included files ----------------------------------------------------


def test_frames_of_the_file_are_frames_of_the_model() -> None:
    frames = '<frame name="tool" attached_to="link"><pose>0 0 0.5 0 0 0</pose></frame><frame name="start"/>'
    model = dynx.load(ARM.replace("</model>", f"{frames}</model>"))
    require_close(pose_of(model, "tool", [np.pi / 2])[:3, 3], np.array([0.5, 0.0, 1.0]))
    require_close(pose_of(model, "start", [1.0]), np.eye(4))


def included(folder: Path, extra: str = "", **files: str) -> Path:
    """Write a file that includes the model ``part``, and others."""
    part = folder / "part"
    part.mkdir(exist_ok=True)
    (folder / "package.xml").write_text("<package/>")
    (part / "model.config").write_text(
        '<model><name>Part</name><sdf version="1.4">old.sdf</sdf><sdf version="1.9">model.sdf</sdf></model>'
    )
    (part / "model.sdf").write_text(
        '<sdf version="1.9"><model name="part"><link name="a"><pose>0 0 0.5 0 0 0</pose></link>'
        '<frame name="tip" attached_to="a"><pose>0 0 1 0 0 0</pose></frame></model></sdf>'
    )
    for name, text in files.items():
        (folder / f"{name}.sdf").write_text(text)
    path = folder / "robot.sdf"
    path.write_text(
        f'<sdf version="1.9"><model name="robot"><link name="base"/>{extra}<joint name="weld" type="fixed">'
        "<parent>world</parent><child>base</child></joint></model></sdf>"
    )
    return path


INCLUDE = (
    "<include{}><uri>{}</uri><name>one</name><pose>1 0 0 0 0 0</pose></include>"
    '<joint name="j" type="revolute"><parent>base</parent><child>{}a</child>'
    "<axis><xyz>0 0 1</xyz></axis></joint>"
)


@pytest.mark.parametrize(
    "uri", ["model://part", "part", "part/model.sdf", "model://part/model.sdf", "file://part"]
)
def test_included_models(tmp_path: Path, uri: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path = included(tmp_path, INCLUDE.format("", uri, "one::"))
    model = dynx.load(path)
    assert model.joint("j").child == "one::a"
    require_close(pose_of(model, "one::tip", [0.0])[:3, 3], np.array([1.0, 0.0, 1.5]))
    merged = dynx.load(included(tmp_path, INCLUDE.format(' merge="true"', uri, "")))
    assert merged.joint("j").child == "a"
    require_close(pose_of(merged, "tip", [0.0])[:3, 3], np.array([1.0, 0.0, 1.5]))
    if uri == "model://part":
        monkeypatch.setenv("GZ_SIM_RESOURCE_PATH", str(tmp_path))
        elsewhere = tmp_path / "elsewhere"
        elsewhere.mkdir()
        (elsewhere / "robot.sdf").write_text(path.read_text())
        assert dynx.load(elsewhere / "robot.sdf").nv == 1


def test_a_bare_name_is_searched_for_as_the_name_of_a_model(tmp_path: Path) -> None:
    """A folder beside the file comes first, then the models of the repository and of the environment."""
    included(tmp_path)
    inner = tmp_path / "robots/arm"
    inner.mkdir(parents=True)
    path = included(inner, INCLUDE.format("", "part/", "one::"))
    (inner / "package.xml").unlink()
    (inner / "part/model.sdf").unlink()
    with pytest.raises(DescriptionError, match=r"no file 'part/model.sdf'"):
        dynx.load(path)
    (inner / "part/model.config").unlink()
    (inner / "part").rmdir()
    assert dynx.load(path).joint("j").child == "one::a"
    path.write_text(path.read_text().replace("part/", "prt"))
    with pytest.raises(DescriptionError, match=r"'prt' is not included: no file 'prt/model.config'"):
        dynx.load(path)


def test_a_file_that_is_one_include_is_the_model_that_it_includes(tmp_path: Path) -> None:
    included(tmp_path)
    place = "<name>one</name><pose>1 0 0 0 0 0</pose>"
    path = tmp_path / "whole.sdf"
    path.write_text(f'<sdf version="1.9"><include><uri>model://part</uri>{place}</include></sdf>')
    model = dynx.load(path)
    assert (model.name, model.nv) == ("one", 6)
    assert any("'a' is placed at 1 0 0.5" in each.message for each in model.notes)
    require_close(pose_of(model, "tip", model.neutral().tolist())[:3, 3], np.array([0.0, 0.0, 1.0]))
    extra = INCLUDE.format("", "whole.sdf", "one::").replace("<pose>1 0 0 0 0 0</pose>", "")
    outer = dynx.load(included(tmp_path, extra, whole=path.read_text()))
    require_close(pose_of(outer, "one::tip", [0.0])[:3, 3], np.array([1.0, 0.0, 1.5]))
    more = '<model name="m"><link name="l"/></model>'
    path.write_text(path.read_text().replace("</include>", f"</include>{more}"))
    with pytest.raises(UnsupportedFeatureError, match="0 worlds and 2 models"):
        dynx.load(path)
    with pytest.raises(DescriptionError, match="a file of 2 models; wanted one"):
        dynx.load(included(tmp_path, extra))


def test_a_placement_frame_is_what_the_pose_places(tmp_path: Path) -> None:
    extra = INCLUDE.format("", "part", "one::").replace(
        "</pose>", "</pose><placement_frame>tip</placement_frame>"
    )
    model = dynx.load(included(tmp_path, extra))
    require_close(pose_of(model, "one::tip", [0.0])[:3, 3], np.array([1.0, 0.0, 0.0]))


def test_long_chains_of_frames_are_read() -> None:
    count = 1500
    links = "".join(
        f'<link name="l{k}"><pose relative_to="l{k + 1}">0 0 0.001 0 0 0</pose></link>'
        f'<joint name="j{k}" type="fixed"><parent>l{k + 1}</parent><child>l{k}</child></joint>'
        f'<frame name="f{k}" attached_to="f{k + 1}"/>'
        for k in range(count)
    )
    last = f'<link name="l{count}"/><frame name="f{count}" attached_to="l0"/>'
    model = dynx.load(f'<sdf version="1.9"><model name="m">{links}{last}</model></sdf>')
    # A fixed joint is no step of the recursion of the algorithms.
    assert (model.root, len(model.frame_names)) == (f"l{count}", 2 * count + 2)
    assert model.extra_frames[0].link == "l0"


def test_cycles_floods_and_files_elsewhere_are_refused(tmp_path: Path) -> None:
    folder = tmp_path / "robot"
    folder.mkdir()
    (tmp_path / "outside.sdf").write_text(FREE)
    for uri in (
        "../outside.sdf",
        str(tmp_path / "outside.sdf"),
        "file:///etc/passwd",
        "none.sdf",
        "model://none",
    ):
        with pytest.raises(DescriptionError, match=r"robot\.sdf:1: .* is not included"):
            dynx.load(included(folder, INCLUDE.format("", uri, "one::")))
    for uri in ("https://fuel.gazebosim.org/1.0/a/models/b", "http://example.org/a.sdf"):
        with pytest.raises(DescriptionError, match="network"):
            dynx.load(included(folder, INCLUDE.format("", uri, "one::")))

    def holding(name: str, times: int = 1) -> str:
        parts = "".join(f"<include><uri>{name}.sdf</uri><name>n{k}</name></include>" for k in range(times))
        return f'<sdf version="1.9"><model name="m"><link name="l"/>{parts}</model></sdf>'

    with pytest.raises(DescriptionError, match="includes itself"):
        dynx.load(included(folder, INCLUDE.format("", "x.sdf", "one::"), x=holding("y"), y=holding("x")))
    bomb = {f"x{k}": holding(f"x{k + 1}", 10) for k in range(8)} | {"x8": FREE}
    with pytest.raises(DescriptionError, match="more than"):
        dynx.load(included(folder, INCLUDE.format("", "x0.sdf", "one::"), **bomb))


@pytest.mark.parametrize(
    ("bound", "element"),
    [
        ("MAX_PARTS", '<frame name="f{}"/>'),
        ("MAX_PARTS", '<joint name="f{}" type="fixed"><parent>a</parent><child>l</child></joint>'),
        ("MAX_ELEMENTS", '<plugin name="p{}" filename="f"/>'),
    ],
)
def test_what_a_file_holds_counts_each_time_it_is_included(
    bound: str, element: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    held = "".join(element.format(k) for k in range(10))
    file = f'<sdf version="1.9"><model name="m"><link name="l"/>{held}</model></sdf>'
    extra = "".join(f"<include><uri>x.sdf</uri><name>n{k}</name></include>" for k in range(20))
    monkeypatch.setattr(f"dynx.model.sdf.document.{bound}", 200)
    with pytest.raises(DescriptionError, match=r"more than 200 (links, joints, frames and shapes|elements)"):
        dynx.load(included(tmp_path, extra, x=file))


def test_the_shapes_of_a_link_count(monkeypatch: pytest.MonkeyPatch) -> None:
    shapes = "".join(f'<visual name="v{k}"/>' for k in range(12))
    monkeypatch.setattr("dynx.model.sdf.document.MAX_PARTS", 10)
    with pytest.raises(DescriptionError, match=r":1: the file has more than 10 links, joints, frames"):
        dynx.load(f'<sdf version="1.9"><model name="m"><link name="l">{shapes}</link></model></sdf>')


def test_names_of_merged_models_are_found_at_any_depth(tmp_path: Path) -> None:
    """Each of the models is merged into the one that includes it; one in the middle holds a model."""
    files = {
        f"x{k}": f'<sdf version="1.9"><model name="m{k}"><link name="l{k}"/>'
        f'<include merge="true"><uri>x{k + 1}.sdf</uri></include></model></sdf>'
        for k in range(5)
    }
    inner = '<model name="inner"><link name="a"/><frame name="tip"><pose>0 0 1 0 0 0</pose></frame></model>'
    files["x5"] = f'<sdf version="1.9"><model name="m5"><link name="l5"/>{inner}</model></sdf>'
    names = [*(f"l{k}" for k in range(6)), "inner::a"]
    joints = "".join(
        f'<joint name="j{k}" type="fixed"><parent>base</parent><child>{name}</child></joint>'
        for k, name in enumerate(names)
    )
    found = '<frame name="found" attached_to="inner::tip"/>'
    chain = f'<include merge="true"><uri>x0.sdf</uri></include>{joints}{found}'
    model = dynx.load(included(tmp_path, chain, **files))
    assert [each.child for each in model.joints if each.name != "weld"] == names
    require_close(pose_of(model, "found", [])[:3, 3], np.array([0.0, 0.0, 1.0]))
    for name in ("l5", "inner"):
        other = f'<model name="o"><link name="{name}"/></model>'
        files["y"] = f'<sdf version="1.9">{other}</sdf>'
        twice = f'{chain}<include merge="true"><uri>y.sdf</uri></include>'
        with pytest.raises(DescriptionError, match=f"the merged model 'o' has a part '{name}', and so has"):
            dynx.load(included(tmp_path, twice, **files))
    with pytest.raises(DescriptionError, match=r"names 'l6', which model 'robot' has not; 17 are known"):
        dynx.load(included(tmp_path, chain.replace("<child>l5", "<child>l6"), **files))


def test_an_error_in_an_included_file_names_it(tmp_path: Path) -> None:
    broken = '<sdf version="1.9"><model name="m">\n<link name="a"><pose>x</pose></link></model></sdf>'
    with pytest.raises(DescriptionError, match=r"x\.sdf:2: pose in <pose> of link 'a'"):
        dynx.load(included(tmp_path, INCLUDE.format("", "x.sdf", "one::"), x=broken))


# -- inertias and shapes ------------------------------------------------------------------------


def shape(content: str, tag: str = "collision", more: str = "") -> str:
    return ARM.replace(
        LINK, LINK.replace("</link>", f'<{tag} name="s">{more}<geometry>{content}</geometry></{tag}></link>')
    )


def test_shapes_and_colours(tmp_path: Path) -> None:
    cases = {
        "<box><size>1 2 3</size></box>": Box((1.0, 2.0, 3.0)),
        "<sphere><radius>0.1</radius></sphere>": Sphere(0.1),
        "<capsule><radius>0.1</radius><length>2</length></capsule>": Capsule(0.1, 2.0),
        "<ellipsoid><radii>1 2 3</radii></ellipsoid>": Ellipsoid((1.0, 2.0, 3.0)),
        "<ellipsoid/>": Ellipsoid((1.0, 1.0, 1.0)),
        "<plane><normal>0 0 1</normal><size>9 9</size></plane>": Plane(),
    }
    for content, want in cases.items():
        (found,) = dynx.load(shape(content)).geometry.collisions("link")
        assert found.shape == want
    assert not dynx.load(shape("<empty/>")).geometry.collisions("link")
    colour = "<transparency>0.5</transparency><material><diffuse>1 0 0 1</diffuse></material>"
    (visual,) = dynx.load(shape("<box><size>1 1 1</size></box>", "visual", colour)).geometry.visuals("link")
    assert visual.material is not None
    assert visual.material.rgba == (1.0, 0.0, 0.0, 0.5)
    turned = dynx.load(shape("<plane><normal>1 0 0</normal></plane>"))
    (plane,) = turned.geometry.collisions("link")
    require_close(plane.origin.matrix[:3, 2], np.array([1.0, 0.0, 0.0]))
    (tmp_path / "a.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    path = tmp_path / "robot.sdf"
    path.write_text(shape("<mesh><uri>a.obj</uri><scale>2 2 2</scale></mesh>"))
    (mesh,) = dynx.load(path).geometry.collisions("link")
    assert isinstance(mesh.shape, Mesh)
    assert mesh.shape.triangles[0].max() == 2.0


@pytest.mark.parametrize("content", ["<cone/>", "<polyline/>", "<heightmap/>", "<image/>"])
def test_shapes_that_dynx_has_not_are_named(content: str) -> None:
    model = dynx.load(shape(content))
    tag = content.strip("</>")
    assert any(f"<{tag}>" in note.message for note in model.notes)
    with pytest.raises(UnsupportedFeatureError, match=f"<{tag}>"):
        model.geometry.collisions("link")


def test_an_inertia_that_follows_from_a_cone_and_a_mesh(tmp_path: Path) -> None:
    cone = "<cone><radius>0.2</radius><length>0.6</length></cone>"
    auto = ARM.replace(
        LINK,
        '<link name="link"><inertial auto="true"><mass>3</mass></inertial>'
        f'<collision name="c"><density>7</density><geometry>{cone}</geometry></collision></link>',
    )
    inertial = dynx.load(auto.replace('"1.9"', '"1.11"')).inertial("link")
    assert inertial.mass == pytest.approx(3.0)
    assert inertial.origin.xyz[2] == pytest.approx(-0.15)
    assert inertial.izz == pytest.approx(3.0 * 0.3 * 0.2**2)
    # From the integral over slices of the cone.
    assert inertial.ixx == pytest.approx(3.0 * 3.0 / 80.0 * (4.0 * 0.2**2 + 0.6**2))
    (tmp_path / "a.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    path = tmp_path / "robot.sdf"
    path.write_text(auto.replace(cone, "<mesh><uri>a.obj</uri></mesh>").replace("<mass>3</mass>", ""))
    assert dynx.load(path).inertial("link").mass == pytest.approx(7.0 / 6.0)


def test_the_defaults_of_an_inertial_are_those_of_the_format() -> None:
    link = '<link name="link"><inertial><inertia><ixx>2</ixx></inertia></inertial></link>'
    inertial = dynx.load(ARM.replace(LINK, link)).inertial("link")
    assert (inertial.mass, inertial.ixx, inertial.iyy, inertial.ixy) == (1.0, 2.0, 1.0, 0.0)
    assert dynx.load(ARM).total_mass == 2.0


# -- what is refused, and what is named -----------------------------------------------------------

XYZ = "<xyz>0 1 0</xyz>"
FAULTS = {
    "version": ('"1.9"', '"1.3"', UnsupportedFeatureError, "1: the version of SDF is '1.3'"),
    "no version": (' version="1.9"', "", DescriptionError, "no attribute version"),
    "screw": ('"revolute"', '"screw"', UnsupportedFeatureError, "5: joint 'hinge' is a screw joint"),
    "gearbox": ('"revolute"', '"gearbox"', UnsupportedFeatureError, "5: joint 'hinge' is a gearbox joint"),
    "type": ('"revolute"', '"revolut"', DescriptionError, "'revolut'; did you mean 'revolute'"),
    "no type": (' type="revolute"', "", DescriptionError, "5: joint 'hinge' has no type"),
    "no axis": (
        f"<axis>{XYZ}</axis>",
        "",
        DescriptionError,
        "5: joint 'hinge' is revolute and has no <axis>",
    ),
    "zero axis": ("0 1 0<", "0 0 0<", DescriptionError, "7: the axis of joint 'hinge' is zero"),
    "axis": ("0 1 0<", "0 1<", DescriptionError, "7: xyz in <xyz> of joint 'hinge' is '0 1'"),
    "parent": (">base</parent>", ">bse</parent>", DescriptionError, "5: joint 'hinge' names 'bse'"),
    "itself": (">base</parent>", ">link</parent>", DescriptionError, "joins link 'link' to itself"),
    "loop": (
        "</model>",
        '<joint name="more" type="fixed"><parent>base</parent><child>link</child></joint></model>',
        UnsupportedFeatureError,
        "'more' closes a loop",
    ),
    "world": (">link</child>", ">world</child>", DescriptionError, "the child of joint 'hinge' is the world"),
    "pose": ("0 0 1 0 0 0", "0 0 1", DescriptionError, "3: pose in <pose> of link 'link'"),
    "relative": ("<pose>", '<pose relative_to="lnk">', DescriptionError, "3: link 'link' names 'lnk'"),
    "circle": ("<pose>", '<pose relative_to="hinge">', DescriptionError, "relative to itself"),
    "format": ("<pose>", '<pose rotation_format="quat">', DescriptionError, "did you mean 'quat_xyzw'"),
    "quaternion": ("<pose>", '<pose rotation_format="quat_xyzw">', DescriptionError, "seven numbers"),
    "limits": (
        XYZ,
        f"{XYZ}<limit><lower>1</lower><upper>0</upper></limit>",
        DescriptionError,
        "7: joint 'hinge'",
    ),
    "limit": (XYZ, f"{XYZ}<limit><lower>low</lower></limit>", DescriptionError, "7: lower in <limit>"),
    "element": (XYZ, "<xzy>0 1 0</xzy>", DescriptionError, "7: <axis> has the unknown element <xzy>"),
    "attribute": ("<xyz>", '<xyz expresed_in="base">', DescriptionError, "did you mean 'expressed_in'"),
    "twice": (
        "</model>",
        '<link name="link"/></model>',
        DescriptionError,
        "link 'link' has the name of a link",
    ),
    "kinds": (
        "</model>",
        '<frame name="link"/></model>',
        DescriptionError,
        "frame 'link' has the name of a link",
    ),
    "reserved": ('<link name="base"/>', '<link name="world"/>', DescriptionError, "give it another name"),
    "mass": (
        '"base"/>',
        '"base"><inertial><mass>-1</mass></inertial></link>',
        DescriptionError,
        "2: the mass",
    ),
    "auto": (
        '"base"/>',
        '"base"><inertial auto="1"/></link>',
        DescriptionError,
        "2: the inertia of link 'base'",
    ),
    "flag": (
        '"base"/>',
        '"base"><gravity>no</gravity></link>',
        DescriptionError,
        "2: gravity of link 'base'",
    ),
    "include": ('"base"/>', '"base"/><include/>', DescriptionError, "2: an <include> has no <uri>"),
    "mimic": (XYZ, f'{XYZ}<mimic joint="base"/>', DescriptionError, "7: joint 'hinge' mimics 'base'"),
    "entities": ("<sdf", '<!DOCTYPE a [<!ENTITY b "c">]><sdf', DescriptionError, "document type"),
    "frame of a pose": (
        "<pose>",
        '<pose frame="base">',
        DescriptionError,
        "3: frame of <pose> is called relative_to",
    ),
    "frame of an axis": (
        XYZ,
        f"{XYZ}<use_parent_model_frame>1</use_parent_model_frame>",
        DescriptionError,
        "7: <use_parent_model_frame>",
    ),
    "names": ('name="base"', 'name=""', DescriptionError, "2: the name of a <link> is empty"),
    "end tag": ("</joint>\n", "\n", DescriptionError, "9: not well-formed XML: mismatched tag"),
    "quote": ('name="hinge"', 'name="hinge', DescriptionError, "5: not well-formed XML: invalid token"),
    "attribute twice": ('name="hinge"', 'name="hinge" name="x"', DescriptionError, "duplicate attribute"),
    "infinite": ("0 0 1 0 0 0", "0 0 1e999 0 0 0", DescriptionError, "3: pose in <pose> of link 'link'"),
    "no child": ("<child>link</child>", "", DescriptionError, "5: joint 'hinge' has no <child>"),
    "no parent": ("<parent>base</parent>", "", DescriptionError, "5: joint 'hinge' has no <parent>"),
    "no name": (' name="hinge"', "", DescriptionError, "5: a <joint> has no name"),
    "expressed in": ("<xyz>", '<xyz expressed_in="bse">', DescriptionError, "7: joint 'hinge' names 'bse'"),
    "heavy": (
        '"base"/>',
        '"base"><inertial><mass>heavy</mass></inertial></link>',
        DescriptionError,
        "2: mass in <inertial> of link 'base' is 'heavy'",
    ),
    "moment": (
        '"base"/>',
        '"base"><inertial><inertia><izz>x</izz></inertia></inertial></link>',
        DescriptionError,
        "2: izz in <inertia> of link 'base' is 'x'",
    ),
    "geometry": (
        '"base"/>',
        '"base"><collision name="c"><geometry><bx/></geometry></collision></link>',
        DescriptionError,
        "2: <geometry> has the unknown element <bx>",
    ),
    "models": (
        "</model>",
        '</model><model name="more"><link name="a"/></model>',
        UnsupportedFeatureError,
        "9: the file holds 0 worlds and 2 models",
    ),
    "attached": (
        "</model>",
        '<frame name="f" attached_to="nowhere"/></model>',
        DescriptionError,
        "9: frame 'f' names 'nowhere'",
    ),
    "attached in a circle": (
        "</model>",
        '<frame name="f" attached_to="g"/><frame name="g" attached_to="f"/></model>',
        DescriptionError,
        "9: frame 'f' is attached to itself, by way of others",
    ),
    "canonical": (
        'name="arm"',
        'name="arm" canonical_link="bse"',
        DescriptionError,
        "1: the canonical link of model 'arm' names 'bse'",
    ),
    "placement": (
        'name="arm"',
        'name="arm" placement_frame="bse"',
        DescriptionError,
        "1: model 'arm' names 'bse'",
    ),
    "static": (
        '<link name="base"/>',
        '<static>perhaps</static><link name="base"/>',
        DescriptionError,
        "2: static of model 'arm' is 'perhaps'",
    ),
    "damping": (
        XYZ,
        f"{XYZ}<dynamics><damping>x</damping></dynamics>",
        DescriptionError,
        "7: damping in <dynamics> of joint 'hinge' is 'x'",
    ),
}


LABEL = """<sdf version="1.9"><model name="m"><link name="l">
<visual name="v"><geometry><plane>{}</plane></geometry></visual>
<collision name="c"><geometry>{}</geometry></collision></link></model></sdf>"""


def test_a_visual_plane_with_a_size_is_the_rectangle_that_gazebo_draws() -> None:
    size = "<normal>1 0 0</normal><size>0.5 0.25</size>"
    model = dynx.load(LABEL.format(size, "<box><size>1 1 1</size></box>"))
    (visual,) = model.geometry.visuals("l")
    assert isinstance(visual.shape, StatedMesh)
    assert not any("size" in each.message for each in model.notes)
    points, corners = visual.shape.triangles
    edges = points[corners[:, 1:]] - points[corners[:, :1]]
    normals = np.cross(edges[:, 0], edges[:, 1])
    require_close(0.5 * normals.sum(axis=0), np.array([0.0, 0.0, 0.125]))
    require_close(np.ptp(points, axis=0), np.array([0.5, 0.25, 0.0]))
    require_close(visual.origin.matrix[:3, 2], np.array([1.0, 0.0, 0.0]))
    broken = dynx.load(LABEL.format("<size>0 1</size>", "<box/>"))
    with pytest.raises(DescriptionError, match="size of visual 'v' of link 'l' is 0 1; wanted positive"):
        broken.geometry.visuals("l")


@pytest.mark.parametrize(
    ("plane", "collision"),
    [("", "<box/>"), ("<size>9 9</size>", "<plane><size>9 9</size></plane>")],
)
def test_a_visual_plane_of_the_ground_has_no_end(plane: str, collision: str) -> None:
    model = dynx.load(LABEL.format(plane, collision))
    assert [each.shape for each in model.geometry.visuals("l")] == [Plane()]
    assert any("a plane has no end" in each.message for each in model.notes) == bool(plane)


@pytest.mark.parametrize(
    "axis",
    [
        f"{XYZ}<use_parent_model_frame>false</use_parent_model_frame>",
        '<xyz expressed_in="__model__">1 0 0</xyz><use_parent_model_frame>1</use_parent_model_frame>',
    ],
)
def test_a_former_element_that_states_nothing_else_is_ignored(axis: str) -> None:
    model = dynx.load(ARM.replace(XYZ, axis))
    plain = dynx.load(ARM.replace(XYZ, axis[: axis.index("<use")]))
    assert np.array_equal(model.joint("hinge").axis, plain.joint("hinge").axis)
    assert any("no element since version 1.7" in each.message for each in model.notes)


@pytest.mark.parametrize(
    ("around", "name", "version", "expected"),
    [
        ("sensor", "gz_frame_id", (1, 9), True),
        ("sensor", "imu", (1, 9), False),
        ("sensor", "gz:frame", (1, 9), False),
        ("sensor", "plugin", (1, 4), False),
        ("sensor", "frame", (1, 6), False),
        ("sensor", "frame", (1, 7), True),
        ("model", "frame", (1, 7), False),
        ("collision", "material", (1, 6), True),
        ("visual", "material", (1, 6), False),
        ("axis", "use_parent_model_frame", (1, 6), False),
        ("axis", "use_parent_model_frame", (1, 9), True),
        ("always_on", "anything", (1, 9), False),
    ],
)
def test_elements_that_sdf_does_not_define(
    around: str, name: str, version: tuple[int, int], expected: bool
) -> None:
    assert is_undefined(around, name, version) == expected


def test_elements_that_are_not_read_are_defined_but_for_those_of_pybullet() -> None:
    read = [(around, name) for around, names in NOT_USED.items() for name in names]
    undefined = {around for around, name in read if is_undefined(around, name, (1, 6))}
    assert undefined == {"link", "collision"}


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_errors_with_the_line(fault: str) -> None:
    old, new, kind, message = FAULTS[fault]
    assert old in ARM
    with pytest.raises(kind) as raised:
        dynx.load(ARM.replace(old, new, 1))
    assert message in str(raised.value)
    assert raised.value.line is not None


def test_every_element_that_is_not_used_is_named_once() -> None:
    """Put each element that is not used into the element around it, and count the notes."""
    places = {
        "model": "</model>",
        "link": "</link>",
        "joint": "</joint>",
        "axis": "</axis>",
    }
    for around, names in NOT_USED.items():
        if around not in places:
            continue
        for name in names:
            text = ARM.replace(places[around], f"<{name}/><{name}/>{places[around]}", 1)
            notes = [note.message for note in dynx.load(text).notes]
            assert sum(f"<{name}> of <{around}> is not read (2 times)" in each for each in notes) == 1
    vendor = ARM.replace("</link>", '<drake:thing/><plugin filename="x"/></link>', 1).replace(
        "<sdf", '<sdf xmlns:drake="d"'
    )
    notes = [note.message for note in dynx.load(vendor).notes]
    assert any("<drake:thing> of <link> is not read" in each for each in notes)
    assert any("<plugin> of <link> is not read" in each for each in notes)


def test_a_colour_in_a_collision_is_named_and_changes_nothing() -> None:
    shape = "<geometry><sphere><radius>1</radius></sphere></geometry>"
    link = f'<link name="a"><collision name="c">{shape}</collision></link>'
    bare = f'<sdf version="1.6"><model name="m">{link}</model></sdf>'
    model = dynx.load(bare.replace(shape, f"{shape}<material><diffuse>1 0 0 1</diffuse></material>"))
    assert any(
        "<material> of <collision> is not read: it belongs into a <visual>" in str(n) for n in model.notes
    )
    assert model.geometry == dynx.load(bare).geometry


@given(text=models())
def test_every_element_and_attribute_counts(text: str) -> None:
    """Each element and attribute of a file is used: one of another name, wherever it stands, is an error."""
    root = read_xml(text, "<string>", [])
    for element in _inside(root):
        assert set(element.attributes) <= set(ATTRIBUTES.get(element.tag, "").split())
        assert {child.tag for child in element.children} <= set(USED.get(element.tag, "").split())
    tags = sorted({element.tag for element in _inside(root)})
    for tag in tags:
        misspelt = text.replace(f"<{tag}>", f"<{tag}x>").replace(f"<{tag} ", f"<{tag}x ")
        misspelt = misspelt.replace(f"<{tag}/>", f"<{tag}x/>").replace(f"</{tag}>", f"</{tag}x>")
        with pytest.raises(DescriptionError):
            dynx.load(misspelt)
    for attribute in sorted({name for element in _inside(root) for name in element.attributes}):
        with pytest.raises(DescriptionError):
            dynx.load(text.replace(f' {attribute}="', f' {attribute}x="'))


@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.name)
def test_each_element_of_a_file_is_used_or_named(path: Path) -> None:
    notes = [note.message for note in dynx.load(path).notes]
    used, unused = 0, set[str]()
    waiting = [read_xml(path.read_bytes(), str(path), [])]
    while waiting:
        element = waiting.pop()
        for child in element.children:
            if child.tag in USED.get(element.tag, "").split():
                used += 1
                waiting += [] if child.tag in CLOSED else [child]
            else:
                unused.add(f"<{child.tag}> of <{element.tag}> is not read")
    assert used
    assert all(sum(note.startswith(named) for note in notes) == 1 for named in unused)
    assert sum(note.startswith("<") and "> is not read" in note for note in notes) == len(unused)


def _inside(element: Element) -> list[Element]:
    """Return the elements that the reader looks into."""
    if element.tag in CLOSED:
        return []
    return [element, *(found for child in element.children for found in _inside(child))]


def test_the_urdf_of_a_model_from_sdf_is_the_same_robot() -> None:
    model = dynx.load(
        ARM.replace('"revolute">', '"universal"><pose>0.1 0 0.2 0 0.3 0</pose>').replace(
            "</joint>\n</model>", "<axis2><xyz>1 0 0</xyz></axis2></joint>\n</model>"
        )
    )
    again = dynx.load(model.to_urdf())
    q, v, a = np.array([0.3, 0.1]), np.array([0.5, -1.0]), np.array([-0.7, 0.2])
    want = dynx.backend("reference", model).inverse_dynamics(q, v, a)
    require_close(dynx.backend("reference", again).inverse_dynamics(q, v, a), want)
    assert again.joint_names == model.joint_names


def test_a_ball_joint_has_the_frame_of_the_joint_and_its_own_damping() -> None:
    text = ARM.replace('"revolute"', '"ball"').replace(
        f"<axis>{XYZ}</axis>",
        f"<pose>0 0 0.25 0.5 0 0</pose><axis>{XYZ}<dynamics><damping>0.5</damping></dynamics></axis>",
    )
    model = dynx.load(text)
    joint = model.joint("hinge")
    assert (joint.type, joint.dynamics.damping, joint.limits.upper) == ("ball", 0.5, np.inf)
    assert (model.nq, model.nv) == (4, 3)
    quarter = np.array([0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)])
    still, turned = (
        dynx.backend("reference", model).forward_kinematics(q, "link") for q in (model.neutral(), quarter)
    )
    # The point of the joint stays where it is.
    point = np.array([0.0, 0.0, 0.25, 1.0])
    np.testing.assert_allclose(turned @ point, still @ point, rtol=0.0, atol=1e-15)
    assert turned[0, 3] == pytest.approx(-0.25)
    without = dynx.load(ARM.replace('"revolute"', '"ball"').replace(f"<axis>{XYZ}</axis>", ""))
    assert without.joint("hinge").type == "ball"
