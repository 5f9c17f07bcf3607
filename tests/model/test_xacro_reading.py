"""xacro files: expansion, errors, and the error without the extra."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from dynx.errors import DescriptionError, NotInstalledError, RobotNotFoundError
from dynx.model import xacro_reading
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
    with pytest.raises(NotInstalledError, match=r"pip install 'dynx\[xacro\]'"):
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
    with pytest.raises(DescriptionError, match=r"xacro failed: .*package 'parts' was not found"):
        load(robot)


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
def test_plain_urdf_is_xacro_too(tmp_path: Path) -> None:
    path = tmp_path / "x.xacro"
    path.write_text(joint())
    assert load(path) == load(joint())
