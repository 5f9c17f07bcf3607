"""xacro files: expansion, errors, and the error without the extra."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

from dynx.errors import ArgumentError, DescriptionError, NotInstalledError, RobotNotFoundError
from dynx.model import xacro_reading
from dynx.model.expansion import expand, left_out_note, xacro_robots
from dynx.model.geometry import Mesh
from dynx.model.loading import load
from tests.model.descriptions import joint

XMLNS = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
ROBOT = f"""<?xml version="1.0"?>
<robot name="ä" {XMLNS}>
  <xacro:include filename="$(find parts)/arm.xacro"/>
  <xacro:property name="length" value="0.5"/>
  <link name="base"/>
  <xacro:arm number="1" parent="base"/>
  <xacro:arm number="2" parent="arm1"/>
</robot>"""
ARM = f"""<robot {XMLNS}>
  <xacro:macro name="arm" params="number parent">
    <link name="arm${{number}}"/>
    <joint name="j${{number}}" type="continuous">
      <origin xyz="0 0 ${{2 * length}}"/><parent link="${{parent}}"/><child link="arm${{number}}"/>
    </joint>
  </xacro:macro>
</robot>"""

needs_xacro = pytest.mark.skipif(importlib.util.find_spec("xacro") is None, reason="xacro is not installed")


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    (tmp_path / "packages/parts").mkdir(parents=True)
    (tmp_path / "packages/parts/arm.xacro").write_text(ARM)
    path = tmp_path / "robot.urdf.xacro"
    path.write_text(ROBOT, encoding="utf-8")
    return path


def test_without_xacro_the_extra_is_named(robot: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dynx.model.xacro_reading.importlib.util.find_spec", lambda name: None)
    with pytest.raises(NotInstalledError, match=r"pip install '\S*\[xacro\]'"):
        load(robot)


def test_a_missing_file_is_not_found(tmp_path: Path) -> None:
    with pytest.raises(RobotNotFoundError):
        load(tmp_path / "gone.xacro")


@needs_xacro
def test_macros_and_includes_from_packages_are_expanded(robot: Path) -> None:
    model = load(robot, package_dirs=[robot.parent / "packages"])
    assert (model.name, model.joint_names) == ("ä", ("j1", "j2"))
    assert model.joints[1].origin.xyz == (0.0, 0.0, 1.0)
    assert model.source == str(robot)


@needs_xacro
def test_a_package_outside_the_roots_is_not_found(robot: Path) -> None:
    with pytest.raises(
        DescriptionError, match=r"xacro failed: package 'parts' was not found around the file"
    ):
        load(robot)


@needs_xacro
def test_packages_of_the_repository_are_found_without_folders(robot: Path) -> None:
    (robot.parent / ".git").mkdir()
    (robot.parent / "packages/parts").rename(robot.parent / "packages/parts-main")
    (robot.parent / "packages/parts-main/package.xml").write_text("<package><name>parts</name></package>")
    assert load(robot).joint_names == ("j1", "j2")


@needs_xacro
def test_arguments_follow_the_path(tmp_path: Path) -> None:
    path = tmp_path / "an arm.urdf.xacro"
    path.write_text(
        f"""<robot name="$(arg name)" {XMLNS}><xacro:arg name="links" default="1"/>
        <xacro:if value="$(eval links == 2)"><link name="$(arg name) tool"/></xacro:if>
        <xacro:unless value="$(eval links == 2)"><link name="base"/></xacro:unless></robot>"""
    )
    assert [link.name for link in load(f"{path} name:=b").links] == ["base"]
    model = load(f"{path} name:='my arm' links:=2")
    assert (model.name, model.links[0].name, model.source) == ("my arm", "my arm tool", str(path))
    with pytest.raises(
        DescriptionError, match=r"argument 'name' has no value; give it as 'FILE.xacro name:="
    ):
        load(path)
    for wrong in ("name:=a b", "name:='a"):
        with pytest.raises(ArgumentError, match=r"no argument of|No closing quotation"):
            load(f"{path} {wrong}")


@needs_xacro
def test_an_argument_that_the_file_does_not_have_is_named_with_the_nearest(tmp_path: Path) -> None:
    """xacro ignores it, and the robot would have the default."""
    path = tmp_path / "robot.xacro"
    path.write_text(
        f"""<robot name="r" {XMLNS}>
  <xacro:arg name="mass" default="1"/><xacro:arg name="tool" default="false"/>
  <link name="base"/>
  <xacro:if value="$(arg tool)"><xacro:arg name="reach" default="1"/></xacro:if>
  <link name="tip$(eval mass + 0)"/>
  <joint name="j" type="fixed"><parent link="base"/><child link="tip$(eval mass + 0)"/></joint>
</robot>"""
    )
    assert load(f"{path} mass:=3").links[1].name == "tip3"
    with pytest.raises(DescriptionError, match=r"the file has no argument 'mas'; did you mean 'mass'\?"):
        load(f"{path} mas:=3")
    with pytest.raises(DescriptionError, match=r"the file has no argument 'reach'; known: mass, tool"):
        load(f"{path} mass:=3 reach:=2")
    with pytest.raises(ArgumentError, match=r"'mass=3' is no argument of .*; wanted name:=value"):
        load(f"{path} mass=3")


@needs_xacro
def test_a_package_that_only_a_mesh_names_may_be_missing(tmp_path: Path) -> None:
    path = tmp_path / "robot.xacro"
    path.write_text(
        f"""<robot name="r" {XMLNS}><link name="base"><visual><geometry>
        <mesh filename="file://$(find looks)/base.stl"/></geometry></visual></link>
        <gazebo><parameters>$(find control)/gains.yaml</parameters></gazebo></robot>"""
    )
    shape = load(path).geometry.visuals("base")[0].shape
    assert isinstance(shape, Mesh)
    with pytest.raises(DescriptionError, match=r"package 'looks' was not found"):
        _ = shape.triangles


@needs_xacro
@pytest.mark.parametrize(
    "text",
    [
        '<xacro:include filename="$(find gone)/arm.xacro"/>',
        '<xacro:include filename="$(find gone)/*.xacro"/>',
        "<xacro:property name=\"p\" value=\"${xacro.load_yaml('$(find gone)/p.yaml')}\"/><a b='${p}'/>",
    ],
)
def test_a_file_of_a_missing_package_is_an_error(tmp_path: Path, text: str) -> None:
    path = tmp_path / "robot.xacro"
    path.write_text(f'<robot name="r" {XMLNS}><link name="base"/>{text}</robot>')
    with pytest.raises(DescriptionError, match=r"xacro failed: package 'gone' was not found around the file"):
        load(path)


@needs_xacro
def test_an_included_file_that_is_not_there_is_named_with_the_nearest(tmp_path: Path) -> None:
    (tmp_path / "wheels.xacro").write_text(f"<robot {XMLNS}/>")
    path = tmp_path / "robot.xacro"
    path.write_text(f'<robot name="r" {XMLNS}><xacro:include filename="wheel.xacro"/></robot>')
    with pytest.raises(DescriptionError, match=r"No such file.*wheel\.xacro'; did you mean 'wheels\.xacro'"):
        load(path)


@needs_xacro
def test_a_file_of_macros_is_no_robot(tmp_path: Path) -> None:
    path = tmp_path / "arm.xacro"
    path.write_text(ARM)
    with pytest.raises(DescriptionError, match="has no link; a xacro file without links of its own"):
        load(path)


@needs_xacro
@pytest.mark.parametrize("text", ["<robot", "<robot>${1 +}</robot>", "<robot><xacro:gone/></robot>", ""])
def test_errors_of_xacro_become_one_error(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bad.xacro"
    path.write_text(text.replace("<robot>", f"<robot {XMLNS}>"))
    with pytest.raises(DescriptionError, match=r"bad\.xacro: xacro failed: ") as caught:
        load(path)
    assert str(caught.value).isprintable()


@needs_xacro
def test_an_endless_expansion_is_terminated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(xacro_reading, "TIMEOUT", 0.01)
    path = tmp_path / "x.xacro"
    path.write_text(joint())
    with pytest.raises(DescriptionError, match=r"did not finish within 0\.01 s"):
        load(path)


@needs_xacro
def test_nothing_is_imported_from_the_current_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "dynx").mkdir()
    for name in ("yaml.py", "numpy.py", "xml.py", "sitecustomize.py", "dynx/__init__.py"):
        (tmp_path / name).write_text(f"open({str(tmp_path / 'imported')!r}, 'w')")
    (tmp_path / "x.xacro").write_text(f'<robot name="r" {XMLNS}><link name="a$(eval 1 + 1)"/></robot>')
    monkeypatch.chdir(tmp_path)
    # A program that was started by python -m, interactively, or with an empty entry in PYTHONPATH.
    monkeypatch.setattr(sys, "path", ["", str(tmp_path), *sys.path])
    monkeypatch.setenv("PYTHONPATH", f":{tmp_path}")
    assert [link.name for link in load("./x.xacro").links] == ["a2"]
    assert not (tmp_path / "imported").exists()


@needs_xacro
@pytest.mark.skipif(sys.platform != "linux", reason="memory is bounded on Linux")
def test_an_expansion_that_takes_too_much_memory_is_ended(tmp_path: Path) -> None:
    path = tmp_path / "x.xacro"
    path.write_text(f'<robot name="r" {XMLNS}><link name="${{len(\'x\' * 3 * 2**30)}}"/></robot>')
    with pytest.raises(DescriptionError, match="xacro failed: it needs more than 1 GiB of memory"):
        load(path)


@needs_xacro
def test_a_text_that_is_too_large_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.xacro"
    path.write_text(f'<robot name="r" {XMLNS}><link name="${{\'x\' * 65 * 2**20}}"/></robot>')
    with pytest.raises(DescriptionError, match="xacro failed: its text is larger than 64 MiB"):
        load(path)


@needs_xacro
def test_a_program_that_xacro_leaves_behind_does_not_delay_the_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The reply ends when its process has ended, or at the time limit with everything that it started."""
    monkeypatch.setattr(xacro_reading, "TIMEOUT", 1.0)
    command = [sys.executable, "-c", "import os, time; os.fork() or time.sleep(60)"]
    reply, _ = xacro_reading._reply(command)
    assert reply is None


@needs_xacro
def test_plain_urdf_is_xacro_too(tmp_path: Path) -> None:
    path = tmp_path / "x.xacro"
    path.write_text(joint())
    assert load(path) == load(joint())


def test_a_text_of_a_process_that_failed_is_not_its_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "robot.xacro"
    path.write_text("<robot/>")
    monkeypatch.setattr(xacro_reading, "_reply", lambda command: (xacro_reading._TEXT + b"<robot/>", 3))
    monkeypatch.setattr(xacro_reading, "find_spec", lambda name: object(), raising=False)
    with pytest.raises(DescriptionError, match="its process ended with code 3"):
        xacro_reading.expand_xacro(str(path), ())


def test_memory_that_ran_out_is_named_with_its_limit() -> None:
    error = RuntimeError("wrapped")
    error.__context__ = MemoryError()
    limit = xacro_reading.MAX_MEMORY / 2**30
    assert xacro_reading._reason_of(error) == f"it needs more than {limit:g} GiB of memory"


@needs_xacro
def test_lines_are_those_of_the_expanded_text(tmp_path: Path) -> None:
    path = tmp_path / "x.xacro"
    path.write_text('<robot name="r"><link name="a"/><link name="a"/></robot>')
    with pytest.raises(
        DescriptionError, match=r"x\.xacro, line \d+ of its URDF: two links are named 'a'"
    ) as caught:
        load(path)
    assert caught.value.line is not None


OPEN = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"'
LINK = '<link name="base"/>'
MACRO = f'{OPEN} name="arm"><xacro:macro name="arm" params="p">{LINK}</xacro:macro></robot>'
CALL = (
    f'{OPEN} name="a"><xacro:include filename="$(find arm)/urdf/arm_macro.xacro"/><xacro:arm p="1"/></robot>'
)


def folder(root: Path, **texts: str) -> list[str]:
    """Write ``urdf/NAME.xacro`` below `root` for each text; return the paths."""
    (root / "urdf").mkdir()
    paths = []
    for name, text in texts.items():
        path = root / "urdf" / f"{name}.xacro"
        path.write_text(text)
        paths.append(str(path))
    return paths


@pytest.mark.parametrize(
    ("text", "is_robot"),
    [
        (CALL, True),
        (MACRO, False),
        (f"{OPEN} name='a'>{LINK}</robot>", True),
        (f"{OPEN}><xacro:if value='$(arg x)'>{LINK}</xacro:if></robot>", True),
        (f"{OPEN}><xacro:if value='$(arg x)'><xacro:property name='p' value='1'/></xacro:if></robot>", False),
        (f"{OPEN} name='a'><xacro:arg name='x' default='1'/><material name='grey'/></robot>", False),
        ("<sdf/>", False),
        ("<robot", True),
        ("", True),
    ],
)
def test_one_file(text: str, is_robot: bool, tmp_path: Path) -> None:
    paths = folder(tmp_path, arm=text)
    assert xacro_robots(paths) == (paths if is_robot else [])


@pytest.mark.parametrize("name", ["part.xacro", "./part.xacro", "$(find arm_description)/urdf/part.xacro"])
def test_a_file_that_another_includes_is_no_robot(name: str, tmp_path: Path) -> None:
    whole = f"{OPEN} name='a'><xacro:include filename='{name}'/>{LINK}</robot>"
    part, robot = folder(tmp_path, part=f"{OPEN} name='p'>{LINK}</robot>", whole=whole)
    assert xacro_robots([part, robot]) == [robot]


def test_a_file_of_the_same_name_elsewhere_is_a_robot(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    whole = f"{OPEN} name='a'><xacro:include filename='$(find arm)/meshes/part.xacro'/>{LINK}</robot>"
    paths = folder(tmp_path, part=f"{OPEN} name='p'>{LINK}</robot>", whole=whole)
    assert xacro_robots(paths) == paths


def test_a_folder_names_its_robots_in_xacro(tmp_path: Path) -> None:
    paths = folder(tmp_path, arm_macro=MACRO, arm=CALL)
    (tmp_path / "arm.urdf").write_text("<robot/>")
    found = expand([str(tmp_path)])
    assert [each.robot for each in found.robots] == [str(tmp_path / "arm.urdf")]
    assert found.left_out == (paths[1],)
    assert expand([str(tmp_path), str(tmp_path), paths[1]]).left_out == ()


def test_a_long_list_is_shortened() -> None:
    note = left_out_note([f"{number}.xacro" for number in range(7)])
    assert note.startswith("7 robots in xacro were not examined")
    assert note.endswith("4.xacro and 2 more")
