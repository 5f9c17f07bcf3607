"""Statements of the rules about shapes and materials, checked with the installed engines."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from dynx.doctor import diagnose
from dynx.engines.silence import silence
from dynx.errors import EngineError
from dynx.loaded import installed_engines, load_as
from dynx.model.loading import load
from dynx.rules import find_rule
from tests.rules.documents import case_of, joint, link
from tests.rules.trap_cases import mended

INSTALLED = installed_engines()

WITHOUT_SIZE = [
    '<box size="0 0 0"/>',
    '<box size="0 1 1"/>',
    '<box size="1 0 1"/>',
    '<box size="1 1 0"/>',
    '<box size="-0.1 0.1 0.1"/>',
    '<sphere radius="0"/>',
    '<sphere radius="-0.1"/>',
    '<cylinder radius="0" length="1"/>',
    '<cylinder radius="1" length="0"/>',
    '<cylinder radius="1" length="-1"/>',
    '<capsule radius="0" length="1"/>',
    '<capsule radius="1" length="0"/>',
]
WITHOUT_ATTRIBUTE = ["<box/>", "<sphere/>", '<cylinder radius="1"/>', '<cylinder length="1"/>']
WITHOUT_FILE = ["<mesh/>", '<mesh filename=""/>', '<mesh filename=" " scale="1 1 1"/>']
TINY = ['<box size="1e-16 1 1"/>', '<sphere radius="1e-300"/>', '<cylinder radius="1e-9" length="1e-9"/>']


def shaped(shape: str, tag: str = "collision") -> str:
    """Return the text of a robot whose arm has one shape."""
    text = f"<{tag}><geometry>{shape}</geometry></{tag}>"
    return case_of(link("base"), link("arm", text), joint("elbow", "base", "arm")).source.text


def material(text: str) -> str:
    """Return the text of a robot with a material."""
    return case_of(text, link("base"), link("arm"), joint("elbow", "base", "arm")).source.text


def refused(text: str, engine: str, folder: Path) -> bool:
    """Check whether an engine refuses a file with this text."""
    if engine not in INSTALLED:
        pytest.skip(f"{engine} is not installed")
    path = folder / "robot.urdf"
    path.write_text(text)
    sound = case_of(link("base"), link("arm"), joint("elbow", "base", "arm")).model
    try:
        with silence(), load_as(engine, path, sound):
            return False
    except EngineError:
        return True


@pytest.mark.parametrize("shape", WITHOUT_SIZE)
def test_mujoco_alone_refuses_a_size_that_is_not_positive(shape: str, tmp_path: Path) -> None:
    refusing = {engine for engine in INSTALLED if refused(shaped(shape), engine, tmp_path)}
    assert refusing == {"mujoco"}.intersection(INSTALLED)


@pytest.mark.parametrize("shape", WITHOUT_ATTRIBUTE + WITHOUT_FILE)
def test_mujoco_and_pybullet_refuse_a_missing_size(shape: str, tmp_path: Path) -> None:
    refusing = {engine for engine in INSTALLED if refused(shaped(shape), engine, tmp_path)}
    assert refusing == {"mujoco", "pybullet"}.intersection(INSTALLED)


@pytest.mark.parametrize("shape", TINY)
def test_the_least_size_is_a_size(shape: str, tmp_path: Path) -> None:
    assert not any(refused(shaped(shape), engine, tmp_path) for engine in INSTALLED)
    assert not find_rule("DX425").detect(
        case_of(link("arm", f"<collision><geometry>{shape}</geometry></collision>"))
    )


@pytest.mark.parametrize("shape", [*WITHOUT_SIZE, *WITHOUT_ATTRIBUTE, *WITHOUT_FILE])
@pytest.mark.parametrize("choice", ["remove", "thicken"])
def test_no_engine_refuses_the_mended_file(shape: str, choice: str, tmp_path: Path) -> None:
    case = case_of(
        link("base"),
        link("arm", f"<collision><geometry>{shape}</geometry></collision>"),
        joint("elbow", "base", "arm"),
    )
    found, remedy = mended("DX425", replace(case, choices={"DX425": choice}))
    assert [each.link for each in found] == ["arm"]
    negative = "-" in shape
    kept = shape in WITHOUT_SIZE and (negative or choice == "thicken")
    assert ("<collision>" in remedy.case.source.text) == kept
    assert not any(refused(remedy.case.source.text, engine, tmp_path) for engine in INSTALLED)


@pytest.mark.parametrize("tag", ["collision", "visual"])
@pytest.mark.parametrize(
    ("origin", "shape"),
    [
        ('<origin rpy="${3.0/2} 0 0"/>', '<box size="1 1 1"/>'),
        ("", '<sphere radius="${radius}"/>'),
        ("", '<cylinder radius="${1/2}" length="$(arg l)"/>'),
    ],
)
def test_mujoco_alone_refuses_an_expression_in_a_collision(
    tag: str, origin: str, shape: str, tmp_path: Path
) -> None:
    text = f"<{tag}>{origin}<geometry>{shape}</geometry></{tag}>"
    case = case_of(link("base"), link("arm", text), joint("elbow", "base", "arm"))
    refusing = {engine for engine in INSTALLED if refused(case.source.text, engine, tmp_path)}
    assert refusing == ({"mujoco"} if tag == "collision" else set()).intersection(INSTALLED)
    found = find_rule("DX429").detect(case)
    assert [each.link for each in found] == (["arm"] if tag == "collision" else [])
    if found:
        _, remedy = mended("DX429", case)
        assert ("<collision>" in remedy.case.source.text) == bool(origin)
        assert "${" not in remedy.case.source.text
        assert not any(refused(remedy.case.source.text, engine, tmp_path) for engine in INSTALLED)


@pytest.mark.parametrize(
    ("inertial", "origin"),
    [
        ("", 'xyz="$(optenv IMU_XYZ 0.19 0 0.149)" rpy="0 ${pi/2} 0"'),
        ("$(optenv MASS 2.5)", 'xyz="0 0 1"'),
    ],
)
def test_a_number_of_an_expression_that_states_it_is_written(inertial: str, origin: str) -> None:
    ends = f'<origin {origin}/><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>'
    text = case_of(
        link("base"), link("arm"), f'<joint name="elbow" type="continuous">{ends}</joint>'
    ).source.text
    if inertial:
        text = re.sub(r'(<mass value=")[^"]*', rf"\g<1>{inertial}", text)
    report = diagnose(text, samples=1, counterexamples=False)
    assert report.explained
    assert {each.rule for each in report.differences} == {"DX429"}
    assert report.mended is not None
    model = load(report.mended)
    origin_read = model.joint("elbow").origin
    assert (origin_read.xyz == (0.19, 0.0, 0.149)) == (not inertial)
    assert (model.inertial("arm").mass == 2.5) == bool(inertial)


def test_an_expression_without_a_stated_value_is_left() -> None:
    ends = '<origin xyz="$(arg x) 0 0"/><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>'
    case = case_of(link("base"), link("arm"), f'<joint name="elbow" type="continuous">{ends}</joint>')
    assert not find_rule("DX429").detect(case)


@pytest.mark.parametrize(
    ("kind", "inside", "refusing"),
    [
        ("fixed", '<limit lower="${x}" upper="1" effort="1" velocity="1"/>', {"pinocchio"}),
        ("fixed", '<dynamics damping="${1/2}"/>', {"pinocchio"}),
        ("fixed", '<mimic joint="k" multiplier="${k}"/>', {"pinocchio", "drake"}),
        ("continuous", '<safety_controller soft_lower_limit="${x}" k_velocity="1"/>', {"pinocchio"}),
        ("continuous", '<calibration rising="${x}"/>', {"pinocchio"}),
        ("continuous", '<limit lower="${x}" effort="1" velocity="1"/>', {"pinocchio", "drake"}),
    ],
)
def test_an_expression_that_dynx_does_not_read_is_explained(
    kind: str, inside: str, refusing: set[str]
) -> None:
    ends = '<parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>'
    joint_text = f'<joint name="elbow" type="{kind}">{ends}{inside}</joint>'
    text = case_of(link("base"), link("arm"), joint_text).source.text
    report = diagnose(text, samples=1, counterexamples=False)
    found = {each.engine for each in report.engines if each.refused is not None}
    assert found == refusing.intersection(INSTALLED)
    assert report.explained
    others = {"DX208"} if "mimic" in inside else set()  # The joint that it follows is missing.
    assert {each.rule for each in report.differences} - others == ({"DX429"} if found else set())
    if found:
        assert report.mended is not None
        assert "${" not in report.mended
        assert ("effort" in report.mended) == (kind == "continuous" and "effort" in inside)


def test_a_mesh_without_file_reaches_the_engines() -> None:
    report = diagnose(shaped("<mesh/>"), samples=1)
    refusing = {each.engine for each in report.engines if each.refused is not None}
    assert refusing == {"mujoco", "pybullet"}.intersection(INSTALLED)
    assert report.explained
    assert {each.rule for each in report.differences} == ({"DX425"} if refusing else set())


@pytest.mark.parametrize("tag", ["collision", "visual"])
@pytest.mark.parametrize("shape", WITHOUT_SIZE)
def test_drake_with_a_scene_graph_ends_the_program(tag: str, shape: str, tmp_path: Path) -> None:
    if "drake" not in INSTALLED:
        pytest.skip("drake is not installed")
    parsing = pytest.importorskip("pydrake.multibody.parsing")
    plant = pytest.importorskip("pydrake.multibody.plant")
    builder = pytest.importorskip("pydrake.systems.framework").DiagramBuilder()
    robots, _ = plant.AddMultibodyPlantSceneGraph(builder, 0.001)
    path = tmp_path / "robot.urdf"
    path.write_text(shaped(shape, tag))
    if shape == '<sphere radius="0"/>':
        assert parsing.Parser(robots).AddModels(str(path))
    else:
        with pytest.raises(SystemExit, match="Failure at"):
            parsing.Parser(robots).AddModels(str(path))


@pytest.mark.parametrize(
    "texture", ["gone.png", "sub/gone.png", "package://robot/wood.png", "file:///gone.png", "http://a/b.png"]
)
def test_drake_alone_refuses_a_texture_that_it_does_not_find(texture: str, tmp_path: Path) -> None:
    text = material(f'<material name="wood"><texture filename="{texture}"/></material>')
    assert {engine for engine in INSTALLED if refused(text, engine, tmp_path)} == {"drake"}.intersection(
        INSTALLED
    )
    report = diagnose(tmp_path / "robot.urdf")
    assert report.explained
    assert {finding.rule for finding in report.differences} == ({"DX426"} if "drake" in INSTALLED else set())
    if "drake" in INSTALLED:
        assert report.mended is not None
        assert not refused(report.mended, "drake", tmp_path)


@pytest.mark.parametrize("color", ["", '<color rgba="1 0 0 1"/>'])
@pytest.mark.parametrize("relative", [True, False])
def test_a_texture_that_is_there_is_no_fault(color: str, relative: bool, tmp_path: Path) -> None:
    image = tmp_path / "wood.png"
    image.write_bytes(b"an image")
    name = image.name if relative else image.as_uri()
    text = material(f'<material name="wood">{color}<texture filename="{name}"/></material>')
    assert not any(refused(text, engine, tmp_path) for engine in INSTALLED)
    report = diagnose(tmp_path / "robot.urdf")
    assert report.alike
    assert not report.findings


def test_a_texture_of_a_text_without_file_may_be_anywhere() -> None:
    assert diagnose(material('<material name="wood"><texture filename="wood.png"/></material>')).alike


@pytest.mark.parametrize(
    ("text", "engines"),
    [
        ('<material name="grey"/>', {"drake"}),
        ('<material name="grey"><texture/></material>', {"drake"}),
        ('<material><color rgba="1 0 0 1"/></material>', {"drake"}),
        ('<material name=""><color rgba="1 0 0 1"/></material>', {"drake"}),
        ('<material name="red"><color rgba="1 0 0"/></material>', {"drake", "mujoco"}),
        ('<material name="red"><color rgba="1 0 0 1 1"/></material>', {"drake", "mujoco"}),
        ('<material name="red"><color rgba="1,0,0,1"/></material>', {"drake", "mujoco"}),
        ('<material name="red"><color rgb="1 0 0"/></material>', {"drake", "mujoco"}),
        ('<material name="red"><color rgba="300 0 0 1"/></material>', set()),
    ],
)
def test_a_material_without_colour(text: str, engines: set[str], tmp_path: Path) -> None:
    document = material(text)
    assert {each for each in INSTALLED if refused(document, each, tmp_path)} == engines.intersection(
        INSTALLED
    )
    case = case_of(text, link("base"), link("arm"), joint("elbow", "base", "arm"))
    if not engines:
        assert not find_rule("DX427").detect(case)
        return
    found, remedy = mended("DX427", case)
    assert len(found) == 1
    assert not any(refused(remedy.case.source.text, engine, tmp_path) for engine in INSTALLED)


def test_a_missing_texture_of_a_visual_is_bad_practice(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    (tmp_path / "here.png").write_bytes(b"an image")
    looks = "".join(
        f'<visual><geometry><box size="1 1 1"/></geometry><material name="{name}">'
        f'<texture filename="{name}.png"/></material></visual>'
        for name in ("here", "gone", "gone")
    )
    case = case_of(link("base"), link("arm", looks), joint("elbow", "base", "arm"), source=path)
    path.write_text(case.source.text)
    (each,) = find_rule("DX516").detect(case)
    assert each.link == "arm"
    assert "'gone.png'" in each.message
    assert not any(refused(case.source.text, engine, tmp_path) for engine in INSTALLED)
