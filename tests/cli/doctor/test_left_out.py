"""Robots in xacro below a directory: `dynx doctor` and `dynx agree --as-loaded` name them, unexamined."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import pytest
from click.testing import CliRunner

from dynx.cli.shell.main import cli
from tests.cli.doctor.test_command import ARM, QUICK, SOUND
from tests.doctor.formats.test_sarif import require_valid


@pytest.mark.parametrize("command", [["doctor"], ["agree", "--as-loaded"]])
def test_robots_in_xacro_below_a_directory_are_named_in_every_output(
    command: list[str], tmp_path: Path
) -> None:
    robots = tmp_path / "robots"
    robots.mkdir()
    (robots / "arm.urdf").write_text(SOUND)
    left_out = robots / "arm.xacro"
    left_out.write_text(ARM)
    files = {name: tmp_path / f"out.{name}" for name in ("json", "html", "junit", "sarif")}
    wanted = ["json"] if len(command) > 1 else list(files)
    options = [word for name in wanted for word in (f"--{name}", str(files[name]))]
    engines = ["--backends" if len(command) > 1 else "--engines", *QUICK[1:]]
    result = CliRunner().invoke(cli, [*command, str(robots), *engines, *options, "--quiet"])
    assert result.exit_code == 0, result.output
    assert "dynx: note: 1 robot in xacro was not examined" in result.stderr
    assert str(left_out) in result.stderr
    assert json.loads(files["json"].read_text())["left_out"] == [str(left_out)]
    for name in wanted[1:]:
        assert str(left_out) in files[name].read_text(), name
    if "junit" in wanted:
        assert ElementTree.parse(files["junit"]).getroot().get("skipped") == "1"
    if "sarif" in wanted:
        require_valid(json.loads(files["sarif"].read_text()))
