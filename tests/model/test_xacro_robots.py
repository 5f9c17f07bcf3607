"""Robots and macros among xacro files, told apart without expanding any."""

from __future__ import annotations

from pathlib import Path

import pytest

from dynx.model.expansion import expand, left_out_note, xacro_robots

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
