"""The doctor on MJCF and SDF: own reading of each engine in a process of its own, lines, causes."""

from __future__ import annotations

import os
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.agreement.tolerances import BAR
from dynx.doctor.diagnosis import compare_as_loaded, diagnose, open_case
from dynx.doctor.examination import (
    DocumentFolders,
    EngineProcess,
    EngineTask,
    Examiner,
    temporary_document,
)
from dynx.engines.mujoco.as_loaded import LoadedMujoco
from dynx.errors import DescriptionError
from dynx.loaded import installed_engines, load_as
from dynx.model import Model
from dynx.model.xml.source import XmlSource
from dynx.reference.backend import ReferenceBackend
from dynx.rules import Case, all_rules
from dynx.rules.registry import find_rule, find_trap, trap_case

needs_all = pytest.mark.skipif(len(installed_engines()) < 4, reason="needs all engines")

MJCF_RULES = [rule for rule in all_rules() if rule.formats[0] == "mjcf"]

WITHOUT_CAUSE = {
    "DX608": "frame",
    "DX609": '    <body name="table" pos="0 3 0"/>\n',
    "DX612": 'pos="0.6 0 0"',
    "DX613": '        <include file="dx613_part/hand.xml"/>\n',
    "DX616": '    <mesh name="tetrahedron" file="dx616_part/tetrahedron.stl"/>\n',
    "DX617": '    <mesh name="absent" file="absent.obj"/>\n',
    "DX618": ' pos="0 0 1"',
    "DX623": '  <include file="dx623_part/tip.xml"/>\n',
    "DX704": "      <pose>0.125 0 0 0 0 0</pose>\n",
    "DX705": """    <joint name="foot" type="fixed">
      <parent>world</parent>
      <child>upper</child>
    </joint>
""",
    "DX706": "<spring_stiffness>5</spring_stiffness>",
    "DX708": """    <include>
      <uri>model://dx711_tool</uri>
      <pose>1 0 0 0 0 0</pose>
    </include>
    <joint name="mounting" type="fixed">
      <parent>lower</parent>
      <child>tool::body</child>
    </joint>
""",
    "DX709": "link",
    "DX720": """    <include>
      <uri>model://dx720_holder</uri>
      <pose>1 0 0 0 0 0</pose>
    </include>
    <joint name="mounting" type="fixed">
      <parent>lower</parent>
      <child>holder::tool::body</child>
    </joint>
""",
    "DX712": "<ixy>0.03125</ixy>",
    "DX719": "      <pose>0 0 0 0 1e-9 0</pose>\n",
}
"""What of the trap of each stated omission is its cause."""

SDF = """<sdf version="1.6">
  <model name="crane">
    <link name="mast">
      <pose>0 0 1 0 0 0</pose>
      <inertial><mass>20</mass><inertia><ixx>1</ixx><iyy>2</iyy><izz>2.5</izz></inertia></inertial>
    </link>
    <link name="boom">
      <pose>0 0 1.5 0 0 0</pose>
      <inertial><mass>5</mass><inertia><ixx>1</ixx><iyy>2</iyy><izz>2.5</izz></inertia></inertial>
    </link>
    <joint name="foot" type="fixed"><parent>world</parent><child>mast</child></joint>
    <joint name="turn" type="revolute">
      <parent>mast</parent><child>boom</child>
      <axis><xyz>0 0 1</xyz><dynamics><damping>0.5</damping><friction>0.25</friction></dynamics></axis>
    </joint>
  </model>
</sdf>
"""


class Aborting(LoadedMujoco):
    """An engine that ends its process while it loads a file."""

    def __init__(self, path: Path, model: Model, calls: Collection[str] = ()) -> None:
        os.abort()


@pytest.mark.parametrize("rule", [each for each in all_rules() if each.stated], ids=lambda rule: rule.id)
def test_a_stated_omission_is_that_of_the_trap(rule: Any) -> None:
    """Without its cause the engines that the rule names load the trap as dynx does."""
    text = trap_case(rule).source.text
    if rule.id == "DX608":
        start, end = text.index("        <frame"), text.index("</frame>") + len("</frame>\n")
        text = text[:start] + text[end:]
    elif rule.id == "DX709":
        start, end = text.rindex("    <link"), text.rindex("</link>") + len("</link>\n")
        text = text[:start] + text[end:]
    elif rule.id == "DX715":
        start, end = text.index("    <model"), text.rindex("</joint>") + len("</joint>\n")
        text = text[:start] + text[end:]
    elif rule.id == "DX716":
        start, end = text.index('    <link name="hand">'), text.rindex("</joint>") + len("</joint>\n")
        text = text[:start] + text[end:]
    elif rule.id == "DX718":
        start, end = text.index("<mesh>"), text.index("</mesh>") + len("</mesh>")
        text = text[:start] + "<box><size>1 0.5 0.5</size></box>" + text[end:]
    elif rule.id == "DX619":
        text = text.replace(
            '<body name="upper">', '<body name="upper"><joint name="shoulder" axis="0 1 0" type="hinge"/>'
        )
    elif rule.id == "DX615":
        plinth = '<geom type="box" size="1 1 1"/><body name="plinth"/>'
        text = text.replace("<worldbody>", f"<worldbody>{plinth}")
    elif rule.id == "DX612":
        text = text.replace(WITHOUT_CAUSE[rule.id], 'pos="0.625 0 0"')
    else:
        assert WITHOUT_CAUSE[rule.id] in text
        text = text.replace(WITHOUT_CAUSE[rule.id], "")
    engines = [name for name in rule.engines if name in installed_engines()]
    report = compare_as_loaded(text, engines=engines, samples=2)
    assert report.error is None
    assert all(each.no_results is None and max(each.before.values()) <= BAR for each in report.engines)


@pytest.mark.long_cases
@needs_all
@pytest.mark.parametrize("rule", ["DX309", "DX601", "DX602", "DX605", "DX607", "DX608"])
def test_the_cause_of_a_trap_is_named_with_its_line(rule: str) -> None:
    report = diagnose(find_trap(rule), samples=1)
    assert report.status == "explained", report.unexplained
    assert report.format == "mjcf"
    causes = {each.rule: each for each in report.differences}
    assert rule in causes
    line = find_trap(rule).read_text().splitlines()[(causes[rule].line or 0) - 1]
    assert line.strip().startswith("<")
    stated = next(each.stated for each in MJCF_RULES if each.id == rule)
    assert causes[rule].proved != stated


@needs_all
def test_what_engines_hold_otherwise_has_the_line_of_the_file() -> None:
    report = compare_as_loaded(find_trap("DX605"), samples=1)
    held = {(each.engine, each.property): each for each in report.model_difference}
    assert not held  # the engine that drops the joint is not used
    text = trap_case("DX605").source.text.replace('name="elbow"', 'name="elbow" type="hinge" range="-1 1"')
    report = compare_as_loaded(text, samples=1)
    (lower,) = [each for each in report.model_difference if each.property == "lower"]
    assert (lower.engine, lower.name, lower.file, lower.engine_value) == ("pybullet", "elbow", -1.0, None)
    assert "elbow" in text.splitlines()[(lower.line or 0) - 1]


@needs_all
def test_engines_without_a_reader_take_part_only_where_named() -> None:
    report = compare_as_loaded(SDF, samples=1)
    assert [each.engine for each in report.engines] == ["pybullet", "drake"]
    assert report.base == "fixed"
    named = compare_as_loaded(SDF, engines=["mujoco", "drake"], samples=1)
    assert "loads no SDF" in (named.engines[0].not_used or "")


@needs_all
def test_an_sdf_file_is_examined_with_its_causes() -> None:
    report = diagnose(SDF, engines=["drake"], samples=2)
    assert report.status == "explained"
    (cause,) = (each for each in report.differences if each.rule == "DX301")
    assert (cause.rule, cause.joint, cause.proved) == ("DX301", "turn", True)
    friction = [each for each in report.model_difference if each.property == "friction"]
    assert [(each.engine, each.file, each.engine_value) for each in friction] == [("drake", 0.25, 0.0)]


def test_a_base_that_contradicts_the_file_is_refused() -> None:
    report = diagnose(find_trap("DX309"), base="floating")
    assert report.error is not None
    assert report.error.type == "ArgumentError"


def test_an_engine_that_ends_its_process_is_not_used() -> None:
    if "mujoco" not in installed_engines():
        pytest.skip("needs MuJoCo")
    case = open_case(find_trap("DX605"), None, {})
    examiner = Examiner(["mujoco"], 1, 0)
    reference = examiner.reference(case)
    apart = EngineProcess()
    try:
        with temporary_document(case.source) as path:
            tasks = [
                EngineTask(kind.name, kind, path, frozenset(), reference, False)
                for kind in (Aborting, LoadedMujoco)
            ]
            crashed, sound = apart.evaluate(tasks)
    finally:
        apart.close()
        examiner.close()
    assert "mujoco" in (crashed.not_used or "")
    assert sound.no_results is None


def test_included_files_are_found_from_the_copy_that_engines_load(tmp_path: Path) -> None:
    if "mujoco" not in installed_engines():
        pytest.skip("needs MuJoCo")
    (tmp_path / "package.xml").write_text("<package/>")
    (tmp_path / "robots").mkdir()
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "defaults.xml").write_text(
        '<mujocoinclude><default><geom density="500"/></default></mujocoinclude>'
    )
    robot = tmp_path / "robots" / "arm.xml"
    robot.write_text(
        '<mujoco model="arm">\n<include file="../parts/defaults.xml"/>\n<worldbody><body name="arm">'
        '<joint name="hinge" type="hinge"/><geom size="0.1"/></body></worldbody>\n</mujoco>\n'
    )
    report = compare_as_loaded(robot, engines=["mujoco"], samples=1)
    assert report.error is None
    assert report.alike, report.engines
    assert dynx.load(robot).total_mass == report.total_mass


@needs_all
def test_a_refusal_is_a_cause_also_where_another_cause_hides_the_results() -> None:
    """Drake refuses the script; without the script it loads the file, and lets another link float."""
    script = "<material><script><name>Gazebo/Red</name></script></material>"
    visual = f'<visual name="v"><geometry><box><size>1 1 1</size></box></geometry>{script}</visual>'
    text = trap_case("DX716").source.text.replace("</link>", f"{visual}</link>", 1)
    spring = "</limit><dynamics><spring_stiffness>5</spring_stiffness></dynamics>"
    text = text.replace("</limit>", spring, 1)  # which makes no engine fail
    report = diagnose(text, engines=["drake"], samples=1)
    effects = {each.rule: each.effect.quantity for each in report.findings if each.effect is not None}
    assert effects == {"DX714": "loading", "DX716": "result"}
    assert report.explained


def test_a_scene_may_include_a_file_of_the_name_that_the_copy_would_have(tmp_path: Path) -> None:
    """``scene.xml`` of most robots includes ``robot.xml``."""
    if "mujoco" not in installed_engines():
        pytest.skip("needs MuJoCo")
    (tmp_path / "robot.xml").write_text(
        '<mujoco model="arm"><worldbody><body name="arm"><joint name="hinge"/><geom size="0.1"/></body>'
        "</worldbody></mujoco>"
    )
    scene = tmp_path / "scene.xml"
    scene.write_text('<mujoco model="scene"><include file="robot.xml"/></mujoco>')
    report = compare_as_loaded(scene, engines=["mujoco"], samples=1)
    assert report.alike, report.engines


def test_copies_of_one_document_stand_in_one_folder_until_that_is_closed(tmp_path: Path) -> None:
    (tmp_path / "arm.stl").write_text("solid arm")
    document = tmp_path / "robot.xml"
    document.write_text("<mujoco/>")
    folders = DocumentFolders()
    texts = ("<mujoco/>", "<mujoco><worldbody/></mujoco>")
    for text in texts:
        with temporary_document(XmlSource(text, str(document)), folders=folders) as path:
            assert path.read_text() == text
            assert (path.parent / "arm.stl").read_text() == "solid arm"
        assert not path.exists()
        assert path == folders.of(XmlSource(texts[0], str(document))) / "robot.xml"
    folders.close()
    assert not path.parent.exists()
    assert document.read_text() == "<mujoco/>"


@pytest.mark.parametrize(
    ("comment", "levels"), [("https://example.org", 0), ("model://arm/arm.stl", 4), ("../arm.stl", 1)]
)
def test_links_stand_for_the_folders_in_which_a_document_may_name_files(
    comment: str, levels: int, tmp_path: Path
) -> None:
    folder = tmp_path / "a" / "b" / "c" / "d"
    folder.mkdir(parents=True)
    for above in folder.parents[:4]:
        (above / "marker").touch()
    (folder / "arm.sdf").touch()
    source = XmlSource(f"<sdf><!-- {comment} --></sdf>", str(folder / "arm.sdf"))
    with temporary_document(source) as path:
        assert sum((above / "marker").exists() for above in path.parents) == levels


def test_meshes_by_uri_are_found_from_the_copy_that_engines_load(tmp_path: Path) -> None:
    if "pybullet" not in installed_engines():
        pytest.skip("needs PyBullet")
    folder = tmp_path / "crate"
    folder.mkdir()
    (tmp_path / "package.xml").write_text("<package/>")
    (folder / "crate.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    text = trap_case("DX701").source.text
    start, end = text.index("<box><size>1 1 1"), text.index("</box>", text.index("<box><size>1 1 1"))
    mesh = "<mesh><uri>model://crate/crate.obj</uri></mesh>"
    (folder / "model.sdf").write_text(text[:start] + mesh + text[end + len("</box>") :])
    report = compare_as_loaded(folder / "model.sdf", engines=["pybullet"], samples=1)
    assert report.error is None
    assert report.engines[0].refused is None, report.engines[0].refused


def test_a_copy_keeps_the_format_of_the_document() -> None:
    for text, suffix in (("<robot/>", ".urdf"), ("<mujoco/>", ".xml"), ("<sdf/>", ".sdf")):
        with temporary_document(XmlSource(text)) as path:
            assert path.suffix == suffix
            assert path.read_text() == text


@needs_all
def test_a_missing_mesh_of_sdf_is_named_and_hinders_no_comparison(tmp_path: Path) -> None:
    """As of URDF: an engine that refuses the file for its mesh is named, and compared without the mesh."""
    shape = '<{0} name="{0}"><geometry><mesh><uri>model://crane/{0}.stl</uri></mesh></geometry></{0}>'
    path = tmp_path / "crane.sdf"
    free = SDF.replace(
        '<joint name="foot" type="fixed"><parent>world</parent><child>mast</child></joint>', ""
    )
    for kind in ("visual", "collision"):
        path.write_text(free.replace('<link name="boom">', f'<link name="boom">{shape.format(kind)}'))
        report = diagnose(path, samples=1)
        (mesh,) = report.unread_meshes
        assert (mesh.link, mesh.line) == ("boom", 7)
        assert mesh.refused_by == ("pybullet",)
        assert report.status == "explained", report.unexplained
        assert "model 'crane' was not found" in mesh.reason


def test_a_joint_called_world_gets_another_name() -> None:
    case = Case(XmlSource(SDF.replace('joint name="foot"', 'joint name="world"')), "fixed")
    rule = find_rule("DX710")
    remedy = rule.remedy(case, rule.detect(case))
    assert remedy is not None
    assert 'joint name="world_joint"' in remedy.case.source.text


def test_shapes_of_one_link_with_one_name_get_names_of_their_own() -> None:
    shape = '<visual name="v"><geometry><sphere><radius>0.1</radius></sphere></geometry></visual>'
    case = Case(XmlSource(SDF.replace('<link name="boom">', f'<link name="boom">{3 * shape}')), "fixed")
    rule = find_rule("DX710")
    remedy = rule.remedy(case, rule.detect(case))
    assert remedy is not None
    text = remedy.case.source.text
    assert [text.count(f'"{name}"') for name in ("v", "v_2", "v_3")] == [1, 1, 1]
    assert not rule.detect(remedy.case)


def test_links_of_static_models_have_no_moments_that_an_engine_could_lose() -> None:
    text = trap_case("DX701").source.text
    ground = '<model name="ground"><static>1</static><link name="plate"/></model>'
    inner = text[text.index("<model") : text.rindex("</sdf>")]
    world = text.replace(inner, f'<world name="w">{inner}{ground}</world>')
    alone, beside = (find_rule("DX701").detect(Case(XmlSource(each), "floating")) for each in (text, world))
    assert [each.link for each in beside] == [each.link for each in alone]


def test_pybullet_finds_a_robot_without_joints_beside_a_floor(tmp_path: Path) -> None:
    """Its FD has the forces of the floor, unless the call of DX620 switches contacts off."""
    pytest.importorskip("pybullet")
    path = tmp_path / "crate.xml"
    path.write_text(
        '<mujoco model="crate"><worldbody><geom type="plane" size="9 9 9"/><body name="crate"><freejoint/>'
        '<geom type="box" size="0.3 0.3 0.3" mass="2"/></body></worldbody></mujoco>'
    )
    model = dynx.load(path)
    q, zero = model.neutral(), np.zeros(model.nv)
    wanted = dynx.backend("reference", model).forward_dynamics(q, zero, zero)
    with load_as("pybullet", path, model) as pushed:
        (depth,) = pushed.contacts(q).values()
        assert depth == pytest.approx(0.3, abs=1e-6)
        assert abs(pushed.forward_dynamics(q, zero, zero) - wanted).max() > 1.0
    with load_as("pybullet", path, model, ["pybullet.no_contacts"]) as free:
        assert not free.contacts(q)
        np.testing.assert_allclose(free.forward_dynamics(q, zero, zero), wanted, atol=1e-12)


NEAR_AXES = {
    "mjcf": (
        '<mujoco model="near"><worldbody><body name="base"><freejoint/><geom size="0.1" mass="1"/>'
        '<body name="arm" pos="0 0 1"><joint name="turn" type="hinge" axis="1e-9 0 1"/>'
        '<geom pos="0.2 0 0" size="0.1" mass="1"/></body></body></worldbody></mujoco>'
    ),
    "sdf": (
        '<sdf version="1.6"><model name="near"><link name="base"/><link name="arm"><pose>0 0 1 0 0 0</pose>'
        '</link><joint name="turn" type="revolute"><parent>base</parent><child>arm</child><axis>'
        "<xyz>1e-9 0 1</xyz><limit><lower>-1</lower><upper>1</upper></limit></axis></joint></model></sdf>"
    ),
}


@needs_all
@pytest.mark.parametrize("form", NEAR_AXES)
def test_an_axis_near_a_coordinate_axis_is_named_in_every_format(form: str) -> None:
    """Drake takes z for it."""
    report = diagnose(NEAR_AXES[form], engines=["drake"], counterexamples=False)
    assert [(each.rule, each.joint) for each in report.differences] == [("DX226", "turn")]
    assert not report.unexplained


@needs_all
def test_equal_limits_of_sdf_are_named_as_those_of_urdf_are() -> None:
    text = trap_case("DX712").source.text.replace("<ixy>0.03125</ixy>", "")
    text = text.replace("<lower>-1</lower><upper>1</upper>", "<lower>0.25</lower><upper>0.25</upper>")
    report = diagnose(text, base="floating", engines=["pybullet", "drake"], samples=1)
    assert report.status == "explained", report.unexplained
    (cause,) = [each for each in report.differences if each.rule == "DX306"]
    assert (cause.joint, cause.proved) == ("elbow", True)


@pytest.mark.parametrize("kind", ["universal", "revolute2"])
@pytest.mark.parametrize("version", ["1.4", "1.9"])
def test_a_joint_of_two_axes_is_written_as_the_two_joints_that_dynx_reads(kind: str, version: str) -> None:
    text = trap_case("DX713").source.text.replace('type="universal"', f'type="{kind}"')
    text = text.replace('version="1.6"', f'version="{version}"')
    placed = text.replace("<pose>0.5 0 0 0 0 0</pose>", "<pose>0.5 0 0.25 0.5 -0.25 1</pose>")
    assert placed != text
    rule = find_rule("DX713")
    case = Case(XmlSource(placed), "floating")
    remedy = rule.remedy(case, rule.detect(case))
    assert remedy is not None
    assert not rule.detect(remedy.case)
    one, other = (each.model for each in (case, remedy.case))
    assert one.joint_names == other.joint_names == ("elbow_axis", "elbow_axis2")
    q = one.random(np.random.default_rng(0))
    for name in ("upper", "lower"):
        poses = [ReferenceBackend(each).forward_kinematics(q, name) for each in (one, other)]
        np.testing.assert_allclose(poses[0], poses[1], rtol=0.0, atol=BAR)


def test_frames_and_followers_of_a_joint_of_two_axes_keep_their_meaning() -> None:
    text = trap_case("DX713").source.text.replace('version="1.6"', 'version="1.11"')
    text = text.replace("<pose>0.5 0 0 0 0 0</pose>", '<pose relative_to="elbow"/>')
    text = text.replace(
        "<parent>upper</parent>", '<pose relative_to="upper">0.5 0 0 0 0 0</pose><parent>upper</parent>'
    )
    text = text.replace("</model>", '<frame name="tip" attached_to="elbow"/></model>')
    rule = find_rule("DX713")
    case = Case(XmlSource(text), "floating")
    remedy = rule.remedy(case, rule.detect(case))
    assert remedy is not None
    written = remedy.case.source.text
    assert '<frame name="tip" attached_to="elbow_axis2"/>' in written
    assert [written.count(f'relative_to="elbow_{each}"') for each in ("axis", "axis2")] == [1, 1]
    model = remedy.case.model
    assert [each.name for each in model.frames if each.name == "tip"] == ["tip"]
    before, after = (case.model, model)
    q = before.random(np.random.default_rng(0))
    poses = [ReferenceBackend(each).forward_kinematics(q, "tip") for each in (before, after)]
    np.testing.assert_allclose(poses[0], poses[1], rtol=0.0, atol=BAR)


SUN = "<include><uri>model://sun</uri></include>"
GROUND = "<include><uri>https://example.org/models/Ground Plane</uri></include>"


@needs_all
def test_the_sun_and_the_ground_of_gazebo_are_left_out_where_they_are_not_found() -> None:
    text = trap_case("DX712").source.text.replace("<ixy>0.03125</ixy>", "")
    inner = text[text.index("<model") : text.rindex("</sdf>")]
    text = text.replace(inner, f'<world name="w">{SUN}{GROUND}{inner}</world>')
    notes = [each for each in dynx.load(text).notes if "Gazebo" in each.message]
    assert len(notes) == 2
    report = diagnose(text, base="floating", engines=["pybullet", "drake"], samples=1)
    assert report.status == "explained", report.unexplained
    assert {each.rule for each in report.differences} == {"DX711"}
    with pytest.raises(DescriptionError, match="table"):
        dynx.load(text.replace("model://sun", "model://table"))


@needs_all
def test_undefined_elements_of_included_files_are_named(tmp_path: Path) -> None:
    sensor = '<sensor name="imu" type="imu"><gz_frame_id>body</gz_frame_id></sensor>'
    tool = f'<model name="tool"><link name="body">\n{sensor}</link></model>'
    (tmp_path / "arm").mkdir()
    (tmp_path / "arm/model.sdf").write_text(f'<sdf version="1.7">{tool}</sdf>')
    path = tmp_path / "robot.sdf"
    path.write_text(trap_case("DX711").source.text.replace("model://dx711_tool", "model://arm/model.sdf"))
    report = diagnose(path, base="floating", engines=["drake"], samples=1)
    assert report.status == "explained", report.unexplained
    found = [each for each in report.differences if each.rule == "DX720"]
    assert [each.message for each in found] == [
        "in the included file arm/model.sdf, line 2, SDF has no <gz_frame_id> in <sensor>"
    ]
    (tmp_path / "arm/model.sdf").write_text(f'<sdf version="1.7">{tool.replace(sensor, "")}</sdf>')
    report = diagnose(path, base="floating", engines=["drake"], samples=1)
    assert {each.rule for each in report.differences} == {"DX711"}


@needs_all
def test_a_manifest_without_a_version_is_named(tmp_path: Path) -> None:
    tool = '<sdf version="1.7"><model name="tool"><link name="body"/></model></sdf>'
    (tmp_path / "arm").mkdir()
    (tmp_path / "arm/model.sdf").write_text(tool)
    manifest = tmp_path / "arm/model.config"
    path = tmp_path / "robot.sdf"
    path.write_text(trap_case("DX711").source.text.replace("model://dx711_tool", "model://arm"))
    for version in ("", ' version="1.7"'):
        manifest.write_text(f"<model>\n<sdf{version}>model.sdf</sdf></model>")
        report = diagnose(path, base="floating", engines=["drake"], samples=1)
        assert report.status == "explained", report.unexplained
        found = [each.message for each in report.differences if each.rule == "DX720"]
        assert found == ([] if version else ["in arm/model.config, line 2, <sdf> has no version"])


@needs_all
@pytest.mark.parametrize(
    ("uri", "read_by_drake"),
    [
        ("arm", "model://arm/"),
        ("arm/model.sdf", "model://arm/model.sdf"),
        ("./arm/parts/hand.sdf", "model://arm/parts/hand.sdf"),
        ("tool.sdf", "model://robots/tool.sdf"),
        ("../tool.sdf", "model://{}/tool.sdf"),
        ("../arm", "model://arm/"),
    ],
)
def test_includes_by_a_path_are_written_as_drake_reads_them(
    tmp_path: Path, uri: str, read_by_drake: str
) -> None:
    tool = '<sdf version="1.7"><model name="tool"><link name="body"/></model></sdf>'
    (tmp_path / "package.xml").write_text("<package/>")
    for folder in (tmp_path, tmp_path / "robots"):
        (folder / "arm/parts").mkdir(parents=True)
        (folder / "arm/model.config").write_text('<model><sdf version="1.7">model.sdf</sdf></model>')
        for name in ("tool.sdf", "arm/model.sdf", "arm/parts/hand.sdf"):
            (folder / name).write_text(tool)
    path = tmp_path / "robots/robot.sdf"
    path.write_text(trap_case("DX711").source.text.replace("model://dx711_tool", uri))
    report = diagnose(path, base="floating", engines=["drake"], samples=1)
    assert report.status == "explained", report.unexplained
    assert [(each.rule, each.proved) for each in report.differences] == [("DX711", True)]
    assert report.mended is not None
    assert f"<uri>{read_by_drake.format(tmp_path.name)}</uri>" in report.mended


def test_the_ground_of_gazebo_is_read_where_it_is_found(tmp_path: Path) -> None:
    ground = '<model name="ground"><static>1</static><link name="plate"/></model>'
    (tmp_path / "models/ground_plane").mkdir(parents=True)
    (tmp_path / "worlds").mkdir()
    (tmp_path / ".git").mkdir()
    (tmp_path / "models/ground_plane/model.sdf").write_text(f'<sdf version="1.6">{ground}</sdf>')
    manifest = '<model><sdf version="1.6">model.sdf</sdf></model>'
    (tmp_path / "models/ground_plane/model.config").write_text(manifest)
    include = GROUND.replace("https://example.org/models/Ground Plane", "model://ground_plane")
    crane = SDF[SDF.index("<model") : SDF.index("</sdf>")]
    world = f'<sdf version="1.6"><world name="w">{include}{crane}</world></sdf>'
    (tmp_path / "worlds/w.world").write_text(world)
    model = dynx.load(tmp_path / "worlds/w.world")
    assert not [each for each in model.notes if "Gazebo" in each.message]


def test_the_state_of_a_world_has_no_links_of_its_own() -> None:
    text = trap_case("DX712").source.text
    inner = text[text.index("<model") : text.rindex("</sdf>")]
    link = '<link name="upper"><pose>1 0 0 0 0 0</pose></link>'
    state = f'<state world_name="w"><model name="m">{link}</model></state>'
    world = text.replace(inner, f'<world name="w">{inner}{state}</world>')
    alone, beside = (find_rule("DX701").detect(Case(XmlSource(each), "floating")) for each in (text, world))
    assert [each.link for each in beside] == [each.link for each in alone]


@needs_all
@pytest.mark.parametrize("tensor", ["", "<inertia><ixx>0</ixx><iyy>0</iyy><izz>0</izz></inertia>"])
def test_a_root_of_sdf_without_mass_and_moments_gets_the_least_of_both(tensor: str) -> None:
    """Without <inertia> the moments are 1 kg m^2, as the format says."""
    text = trap_case("DX722").source.text
    start, end = text.index("<inertia>"), text.index("</inertia>") + len("</inertia>")
    report = diagnose(
        text[:start] + tensor + text[end:], base="floating", engines=["pybullet", "drake"], samples=1
    )
    assert report.status == "explained", report.unexplained
    assert "DX722" in {each.rule for each in report.differences}
    assert report.mended is not None
    (root,) = [each for each in dynx.load(report.mended).links if each.name == "upper"]
    assert root.inertial is not None
    assert root.inertial.mass == 2e-15
    assert root.inertial.ixx == (1.5e-14 if tensor else 1.0)
