"""The parser that compares mended files with their originals finds each planted difference."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from benchmarks.surveys import same_robot
from tests.rules.documents import case_of, joint, link

ROBOT = case_of(
    link("base", mass=2.0, moments=(0.2, 0.2, 0.3)),
    link("arm", mass=1.0, moments=(0.01, 0.02, 0.025), center=(0.0, 0.1, 0.2)),
    joint("elbow", "base", "arm", '<origin xyz="0 0 0.5" rpy="0.1 0.2 0.3"/>'),
).source.text

CHANGES = {
    "mass": ('value="1.0"', 'value="1.1"', "mass of link arm"),
    "center": ('xyz="0.0 0.1 0.2"', 'xyz="0.0 0.1 0.21"', "center of link arm"),
    "tensor": ('ixx="0.01"', 'ixx="0.011"', "tensor of link arm"),
    "type": ('type="revolute"', 'type="continuous"', "type of joint elbow"),
    "axis": ('<axis xyz="0 0 1"/>', '<axis xyz="0 1 1"/>', "axis of joint elbow"),
    "position": ('xyz="0 0 0.5"', 'xyz="0 0 0.6"', "position of joint elbow"),
    "rotation": ('rpy="0.1 0.2 0.3"', 'rpy="0.1 0.2 0.4"', "rotation of joint elbow"),
    "limits": ('lower="-1"', 'lower="-2"', "limits of joint elbow"),
    "coordinates": ('type="revolute"', 'type="fixed"', "0 coordinates instead of 1"),
    "name": ("arm", "hand", "removed of link arm"),
}


def compared(tmp_path: Path, mended: str, findings: list[dict[str, Any]]) -> str:
    """Compare the robot with another text by the script."""
    paths = tmp_path / "robot.urdf", tmp_path / "mended.urdf"
    for path, text in zip(paths, (ROBOT, mended), strict=True):
        path.write_text(text, encoding="utf-8")
    entry: dict[str, Any] = {
        "path": str(paths[0]),
        "mended": str(paths[1]),
        "base": "fixed",
        "findings": findings,
    }
    entry |= {"error": None, "withheld": None, "engines": [], "calls": [], "changes": []}
    results = tmp_path / "results.jsonl"
    results.write_text(json.dumps(entry) + "\n", encoding="utf-8")
    command = [sys.executable, same_robot.__file__, str(results), "--no-calls"]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


@pytest.mark.parametrize("kind", CHANGES)
def test_another_number_or_name_is_found(kind: str, tmp_path: Path) -> None:
    old, new, message = CHANGES[kind]
    assert old in ROBOT
    assert message in compared(tmp_path, ROBOT.replace(old, new), [])


def test_a_scaled_axis_and_other_axes_of_a_tensor_are_the_same_robot(tmp_path: Path) -> None:
    text = ROBOT.replace('<axis xyz="0 0 1"/>', '<axis xyz="0 0 2"/>')
    turned = 'xyz="0.0 0.1 0.2" rpy="0 0 1.5707963267948966"'
    text = text.replace('xyz="0.0 0.1 0.2"', turned).replace('ixx="0.01"', 'ixx="0.02"')
    # About z by a quarter turn: the first two moments change places.
    text = text.replace('iyy="0.02"', 'iyy="0.01"')
    found = compared(tmp_path, text, [])
    assert "another reading 0" in found
    assert "1 files changed; median of changed lines 2" in found


def test_what_the_report_states_is_counted(tmp_path: Path) -> None:
    old, new, message = CHANGES["mass"]
    by_name = {"link": "arm", "joint": None, "line": None}
    by_line = {"link": None, "joint": None, "line": 3}
    for finding in (by_name, by_line):
        found = compared(tmp_path, ROBOT.replace(old, new), [finding])
        assert message not in found
        assert "another reading 0, another reading that the report states 1" in found


def test_a_file_without_meshes_keeps_the_rest() -> None:
    text = """<robot name="r"><link name="a"><visual><geometry><mesh filename="gone.stl"/></geometry></visual>
    <collision><geometry><box size="1 2 3"/></geometry></collision></link>
    <transmission name="t&amp;u"><type>simple</type></transmission></robot>"""
    written = same_robot.parse(same_robot.parse(text.encode()).without_meshes().encode()).without_meshes()
    assert "mesh" not in written
    assert 'size="1 2 3"' in written
    assert "t&amp;u" in written
    assert ">simple</type>" in written
