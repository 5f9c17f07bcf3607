"""The commands that docs/doctor.md recommends for continuous integration do what it says."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from dynx.cli.shell.main import cli
from dynx.loaded import installed_engines
from dynx.rules.registry import find_trap

PAGE = Path(__file__).parents[3] / "docs" / "doctor.md"

pytestmark = pytest.mark.skipif("mujoco" not in installed_engines(), reason="joint damping shows in MuJoCo")


def commands() -> list[list[str]]:
    """Return the words of each command of the section."""
    text = PAGE.read_text(encoding="utf-8").partition("## In continuous integration")[2].partition("\n## ")[0]
    return [shlex.split(line) for line in re.findall(r"^```sh\n(.*)\n```$", text, flags=re.MULTILINE)]


def run(words: list[str]) -> Result:
    assert words[0] == "dynx"
    return CliRunner().invoke(cli, [*words[1:], "--jobs", "1"])


def test_the_check_passes_until_something_is_new(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    robots = tmp_path / "robots"
    robots.mkdir()
    shutil.copy(find_trap("DX301"), robots / "damped.urdf")
    record, check = commands()
    assert run(record).exit_code == 0
    assert run(check).exit_code == 0
    assert Path("doctor.xml").is_file()
    assert Path("doctor.sarif").is_file()
    shutil.copy(find_trap("DX101"), robots / "other.urdf")
    found = run(check)
    assert found.exit_code == 1
    assert "new: DX101" in found.stdout
    assert "new: DX301" not in found.stdout


def test_a_mended_file_names_the_causes_that_only_calls_remove(tmp_path: Path) -> None:
    """Damping is right in the file: without the calls the mended file differs as before."""
    text = find_trap("DX301").read_text(encoding="utf-8").replace("</robot>", '<link name="extra"/></robot>')
    joint = '<joint name="mount" type="fixed"><parent link="{}"/><child link="extra"/></joint></robot>'
    parent = re.findall(r'<child link="([^"]+)"', text)[-1]
    robot, mended = tmp_path / "robot.urdf", tmp_path / "mended.urdf"
    robot.write_text(text.replace("</robot>", joint.format(parent)), encoding="utf-8")
    result = run(["dynx", "doctor", str(robot), "--fix", str(mended)])
    assert result.exit_code == 1
    assert f"mended (without the calls above, DX301 remains): {mended}" in result.stdout
    again = run(["dynx", "doctor", str(mended)])
    assert again.exit_code == 1
    assert "engines differ, for 1 cause, all proved" in again.stdout
