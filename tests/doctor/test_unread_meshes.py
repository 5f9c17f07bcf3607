"""A report names the meshes that were not read, and the checks that are left out without them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from dynx import load
from dynx.cli.shell.main import cli
from dynx.doctor import diagnose
from dynx.doctor.formats import html_page, junit_xml, sarif_document
from dynx.doctor.formats.wording import refusal, unread_meshes
from dynx.doctor.report import DoctorReport, EngineResult, UnreadMesh
from dynx.engines.silence import silence
from dynx.errors import EngineError
from dynx.loaded import ENGINES, installed_engines, loader_class
from dynx.model.geometry import Mesh
from dynx.model.geometry.formats.facets import STL_FACET
from tests.doctor.formats.test_sarif import require_valid
from tests.model.geometry.mesh_files import stl

ARM = """<robot name="arm">
  <link name="base"/>
  <link name="tool">
    <visual>
      <geometry><mesh filename="package://arm_description/meshes/tool.stl"/></geometry>
    </visual>
    <inertial>
      <mass value="1"/>
      <inertia ixx="100" ixy="0" ixz="0" iyy="100" iyz="0" izz="100"/>
    </inertial>
  </link>
  <joint name="elbow" type="continuous">
    <parent link="base"/>
    <child link="tool"/>
    <axis xyz="0 0 1"/>
  </joint>
</robot>
"""
"""The inertia is a thousand times that of any body of the size of the mesh."""


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a description in its package, beside the mesh that it names."""
    for variable in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(variable, raising=False)
    folder = tmp_path / "arm_description"
    (folder / "meshes").mkdir(parents=True)
    facets = np.zeros(2, STL_FACET)
    facets["corners"] = [[[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]], [[0, 0, 0], [0.1, 0, 0], [0, 0, 0.1]]]
    mesh = bytes(80) + len(facets).to_bytes(4, "little") + facets.tobytes()
    (folder / "meshes/tool.stl").write_bytes(mesh)
    (folder / "arm.urdf").write_text(ARM)
    return folder / "arm.urdf"


def examined(path: Path) -> DoctorReport:
    """Diagnose a file with one engine."""
    return diagnose(str(path), engines=["pinocchio"], samples=1)


def unwrapped(text: str) -> str:
    """Return a text without blanks, as a terminal may break it after any word of a long path."""
    return "".join(text.split())


def test_a_file_copied_out_of_its_package_is_reported_as_examined_without_meshes(
    package: Path, tmp_path: Path
) -> None:
    inside = examined(package)
    assert "DX501" in {finding.rule for finding in inside.findings}
    assert (inside.meshes, inside.unread_meshes) == (1, ())
    copy = tmp_path / "elsewhere" / "arm.urdf"
    copy.parent.mkdir()
    copy.write_text(ARM)
    outside = examined(copy)
    assert outside.alike
    assert "DX501" not in {finding.rule for finding in outside.findings}
    [mesh] = outside.unread_meshes
    assert (mesh.link, mesh.line) == ("tool", 5)
    assert mesh.reason == "package 'arm_description' was not found"

    command = ["doctor", str(copy), "--engines", "pinocchio", "--samples", "1", "--jobs", "1"]
    result = CliRunner().invoke(cli, [*command, "--json", str(tmp_path / "x.json")])
    assert result.exit_code == 0
    words = "the mesh file could not be read (package 'arm_description' was not found)"
    assert unwrapped(words) in unwrapped(result.stdout)
    assert "DX501" in result.stdout
    [entry] = json.loads((tmp_path / "x.json").read_text())["results"]
    assert (entry["meshes"], [each["file"] for each in entry["unread_meshes"]]) == (1, [mesh.file])
    several = CliRunner().invoke(cli, [*command, str(package)])
    assert "meshes could not be read: 1 of 2 robots" in several.stdout

    assert "The mesh file could not be read" in html_page([outside])
    assert words in junit_xml([outside])
    document = sarif_document([outside])
    require_valid(document)
    [run] = document["runs"]
    assert run["results"] == []
    [note] = run["invocations"][0]["toolExecutionNotifications"]
    assert words in note["message"]["text"]
    assert note["locations"][0]["physicalLocation"]["region"]["startLine"] == 5


@pytest.mark.parametrize(
    ("filename", "reason"),
    [
        ("package://hand/a.stl", "package 'hand' was not found"),
        ("package://arm_description/meshes/none.stl", "no file 'meshes/none.stl' in package"),
        ("meshes/tool.glb", "no file 'meshes/tool.glb'"),
        ("arm.urdf", "no .urdf"),
        ("meshes/empty.stl", "no points can be read in the .stl file"),
        ("../../other.stl", "outside the folder of the description"),
        ("package://arm_description/../other.stl", "outside its package"),
        ("https://example.org/a.stl", "dynx reads no 'https://'"),
        ("$(find hand)/a.stl", "only xacro and launch files expand $(...)"),
    ],
)
def test_the_reason_is_stated(package: Path, filename: str, reason: str) -> None:
    (package.parent / "meshes/empty.stl").write_bytes(b"solid x\nendsolid x\n")
    package.write_text(ARM.replace("package://arm_description/meshes/tool.stl", filename))
    [mesh] = examined(package).unread_meshes
    assert reason in mesh.reason


def test_engines_that_refuse_a_file_without_its_meshes_are_named(package: Path, tmp_path: Path) -> None:
    """The engine input has no meshes, so what the engine returns does not show it."""
    copy, mended = tmp_path / "elsewhere/arm.urdf", tmp_path / "mended.urdf"
    copy.parent.mkdir()
    command = ["doctor", str(copy), "--engines", "pinocchio,pybullet", "--samples", "1", "--jobs", "1"]
    refuses = "; pybullet refuses a file of which a mesh is missing"
    for text in (ARM, ARM.replace('<axis xyz="0 0 1"/>', "<axis/>")):
        package.write_text(text)
        copy.write_text(text)
        found = diagnose(str(package), engines=["pinocchio", "pybullet"], samples=1)
        assert found.refused_without_meshes == ()
        result = CliRunner().invoke(cli, [*command, "--json", str(tmp_path / "x.json"), "--fix", str(mended)])
        assert unwrapped(refuses) in unwrapped(result.stdout)
        [entry] = json.loads((tmp_path / "x.json").read_text())["results"]
        assert [each["refused_by"] for each in entry["unread_meshes"]] == [["pybullet"]]
    assert unwrapped("loads the mended file once its meshes are there") in unwrapped(result.stdout)
    said = f"mended (for pybullet, once its meshes are there): {mended}"
    assert unwrapped(said) in unwrapped(result.stdout)
    report = diagnose(str(copy), engines=["pinocchio", "pybullet"], samples=1)
    assert "It loads the mended file once its meshes are there." in html_page([report])
    assert refuses in json.dumps(sarif_document([report]))
    assert refuses in CliRunner().invoke(cli, [*command, str(package)]).stdout
    assert refuses not in CliRunner().invoke(cli, ["doctor", str(package), *command[2:]]).stdout


@pytest.mark.parametrize("engine", [each for each in installed_engines() if each in ENGINES])
@pytest.mark.parametrize("part", ["visual", "collision"])
def test_the_engines_refuse_such_a_file(engine: str, part: str, tmp_path: Path) -> None:
    text = ARM.replace("visual>", f"{part}>").replace('"0 0 1"', '"0 1 0"')
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    kind = loader_class(engine)
    model = load(path)
    try:
        with silence(), kind(path, model):
            refused = False
    except EngineError:
        refused = True
    assert refused == (part in kind.refuses_without)
    report = diagnose(path, engines=[engine], samples=1, counterexamples=False)
    assert report.refused_without_meshes == ((engine,) if refused else ())


@pytest.mark.skipif("pybullet" not in installed_engines(), reason="PyBullet is not installed")
@pytest.mark.parametrize(
    ("filename", "found"),
    [
        ("/meshes/base.stl", True),
        ("meshes/base.stl", True),
        ("package://elsewhere/base.stl", False),
        ("package://meshes/base.stl", True),
        ("model://meshes/base.stl", True),
        ("package://none/meshes/base.stl", False),
        ("/none/meshes/base.stl", False),
        ("file://meshes/base.stl", True),
        ("/meshes/base.glb", False),
        ("/meshes/base.stl/", False),
    ],
)
def test_a_mesh_that_only_pybullet_finds_is_said_to_be_found(
    filename: str, found: bool, tmp_path: Path
) -> None:
    """Raw PyBullet loads the file exactly where the report does not say that it refuses it."""
    path = tmp_path / "repository/urdf/arm.urdf"
    (tmp_path / "repository/meshes").mkdir(parents=True)
    (tmp_path / "repository/.git").mkdir()
    for name in ("base.stl", "base.glb"):
        (tmp_path / "repository/meshes" / name).write_bytes(stl())
    path.parent.mkdir()
    path.write_text(ARM.replace("package://arm_description/meshes/tool.stl", filename))
    try:
        with silence(), loader_class("pybullet")(path, load(path)):
            loaded = True
    except EngineError:
        loaded = False
    assert loaded == found
    report = diagnose(path, engines=["pybullet", "mujoco"], samples=1, counterexamples=False)
    assert ("pybullet" in report.refused_without_meshes) == (not found)
    assert all(("PyBullet alone finds" in mesh.reason) == found for mesh in report.unread_meshes)
    [visual] = load(path).geometry.visuals("tool")
    assert isinstance(visual.shape, Mesh)
    assert (visual.shape.fault is None) == (found or "base.glb" in filename)


def test_of_text_without_a_file_no_mesh_is_looked_for() -> None:
    [mesh] = diagnose(ARM, engines=["pinocchio"], samples=1).unread_meshes
    assert mesh.reason == "the description was not read from a file"


def test_reasons_of_one_kind_are_counted_and_the_first_is_written() -> None:
    missing = [
        UnreadMesh(f"{each}.stl", each, 1, f"no file '{each}.stl'; did you mean 'a.stl'?") for each in "pqr"
    ]
    report = DoctorReport("robot", meshes=5, unread_meshes=tuple(missing))
    start = "of 5 mesh files could not be read (no file 'p.stl'; did you mean 'a.stl'?; likewise 2 more"
    assert f"3 {start}); engines are" in unread_meshes(report)
    other = UnreadMesh("s.stl", "s", 2, "package 'arm' was not found")
    report = DoctorReport("robot", meshes=5, unread_meshes=(other, *missing))
    assert f"4 {start}; 1 for other reasons); engines are" in unread_meshes(report)


def test_the_name_of_the_file_that_an_engine_was_given_is_not_in_its_message() -> None:
    message = "mujoco refuses robot.urdf: Error: no mass; Element name 'a'"
    refused = EngineResult("mujoco", "4.0.0", "", refused=message, refused_after=message)
    assert refusal(refused) == "refuses the file: no mass; Element name 'a'"
    assert refusal(refused, mended=True) == "refuses the mended file too: no mass; Element name 'a'"
