"""The files of a release agree with each other, and the action for robot descriptions does what it says."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml  # type: ignore[import-untyped]

import dynx

ROOT = Path(__file__).resolve().parents[1]
ACTION: dict[str, Any] = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
INSTALL, EXAMINE, COMPARE = ACTION["runs"]["steps"][1:]


def variables(step: dict[str, Any], **inputs: str) -> dict[str, str]:
    """Environment of a step of the action, for the inputs given and the defaults of the others."""
    values = {name: each.get("default", "") for name, each in ACTION["inputs"].items()} | inputs
    return {
        name: re.sub(r"\$\{\{ inputs\.([\w-]+) \}\}", lambda match: values[match[1]], text)
        for name, text in step["env"].items()
    }


def test_no_extra_of_dynx_has_a_marker_which_the_build_would_drop() -> None:
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert not re.findall(r'"dynx-robotics\[[^"]*;[^"]*"', text)


@pytest.fixture
def runner(tmp_path: Path) -> dict[str, str]:
    """Environment of a runner whose virtual environment has this dynx."""
    if shutil.which("bash") is None:
        pytest.skip("needs bash")
    scripts = tmp_path / "dynx-venv" / "bin"
    scripts.mkdir(parents=True)
    command = scripts / "dynx"
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -P -m dynx "$@"\n', encoding="utf-8")
    command.chmod(0o755)
    return {
        **os.environ,
        "RUNNER_TEMP": str(tmp_path),
        "GITHUB_OUTPUT": str(tmp_path / "output"),
        "GITHUB_ACTION_PATH": str(ROOT),
    }


def run(script: str, environment: dict[str, str], folder: Path) -> subprocess.CompletedProcess[str]:
    # As GitHub runs `shell: bash`.
    return subprocess.run(
        ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", script],
        env=environment,
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_version_stands_alike_in_every_file() -> None:
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    newest = re.search(r"^## (\S+) \((unreleased|\d{4}-\d{2}-\d{2})\)$", changelog, flags=re.MULTILINE)
    assert newest is not None
    assert newest[1] == dynx.__version__
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == dynx.__version__


@pytest.mark.parametrize(
    "path", sorted((ROOT / ".github/workflows").glob("*.yml")), ids=lambda path: path.name
)
def test_workflows_have_the_least_permissions(path: Path) -> None:
    workflow = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert workflow["permissions"] == {"contents": "read"}
    for name, job in workflow["jobs"].items():
        assert job.get("permissions", {}) == ({"id-token": "write"} if name == "publish" else {})
        for step in job["steps"]:
            assert "${{ github.event" not in step.get("run", "")


def test_scripts_of_the_action_read_inputs_from_variables_only() -> None:
    for step in (INSTALL, EXAMINE, COMPARE):
        assert "${{" not in step["run"]


@pytest.mark.parametrize(("extras", "wanted"), [("", ""), ("xacro,drake", "[xacro,drake]")])
def test_the_action_installs_itself_with_the_extras(
    extras: str, wanted: str, runner: dict[str, str], tmp_path: Path
) -> None:
    commands = tmp_path / "commands"
    commands.mkdir()
    log = tmp_path / "log"
    fake = commands / "python"
    # `python -m venv` is recorded; the python of the environment is there before.
    fake.write_text(f'#!/bin/sh\necho "$@" >> "{log}"\n', encoding="utf-8")
    fake.chmod(0o755)
    shutil.copy(fake, tmp_path / "dynx-venv/bin/python")
    environment = runner | variables(INSTALL, extras=extras)
    environment["PATH"] = f"{commands}{os.pathsep}{environment['PATH']}"
    result = run(INSTALL["run"], environment, tmp_path)
    assert result.returncode == 0, result.stderr
    assert log.read_text(encoding="utf-8").splitlines() == [
        f"-m venv {tmp_path}/dynx-venv",
        f"-m pip install -q {ROOT}{wanted}",
    ]


def test_the_action_fails_on_a_robot_that_engines_load_differently(
    runner: dict[str, str], tmp_path: Path
) -> None:
    robots = tmp_path / "robots"
    robots.mkdir()
    link = '<link name="tip"><inertial><mass value="1"/>{}</inertial></link>'
    inertia = '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'
    text = (
        '<robot name="r"><link name="base"/>{}<joint name="j" type="revolute"><parent link="base"/>'
        '<child link="tip"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/>'
        "{}</joint></robot>"
    )
    (robots / "alike.urdf").write_text(text.format(link.format(inertia), ""), encoding="utf-8")
    differs = robots / "it's $(touch executed).urdf"
    differs.write_text(text.format(link.format(inertia), '<dynamics damping="2"/>'), encoding="utf-8")
    engines = "pinocchio,pybullet"
    for robot, status in (("robots/alike.urdf", 0), (f"\nrobots/alike.urdf\nrobots/{differs.name}\n", 1)):
        result = run(EXAMINE["run"], runner | variables(EXAMINE, robots=robot, engines=engines), tmp_path)
        assert result.returncode == status, result.stdout + result.stderr
    chosen = {"robots": f"robots/{differs.name}", "engines": engines}
    for options, status in (({"ignore": "DX301,DX101"}, 0), ({"only": "DX101"}, 0), ({"only": "DX301"}, 1)):
        result = run(EXAMINE["run"], runner | variables(EXAMINE, **chosen, **options), tmp_path)
        assert result.returncode == status, result.stdout + result.stderr
        assert ("::notice title=1 finding ignored::DX301" in result.stdout) == (not status)
    (tmp_path / "output").unlink()
    robot = f"\nrobots/alike.urdf\nrobots/{differs.name}\n"
    run(EXAMINE["run"], runner | variables(EXAMINE, robots=robot, engines=engines), tmp_path)
    assert not list(tmp_path.rglob("executed"))
    outputs = dict(
        line.split("=", 1) for line in (tmp_path / "output").read_text(encoding="utf-8").splitlines()
    )
    assert set(outputs) == set(ACTION["outputs"]) - {"pairs"}
    assert "DX" in Path(outputs["sarif"]).read_text(encoding="utf-8")
    assert "alike" in Path(outputs["junit"]).read_text(encoding="utf-8")
    assert differs.name.split()[0].replace("'", "&#39;") in Path(outputs["html"]).read_text(encoding="utf-8")


def test_the_action_refuses_an_empty_list(runner: dict[str, str], tmp_path: Path) -> None:
    result = run(EXAMINE["run"], runner | variables(EXAMINE, robots="\n"), tmp_path)
    assert result.returncode == 2
    assert "ROBOT" in result.stderr


def test_the_action_compares_pairs(runner: dict[str, str], tmp_path: Path) -> None:
    own = ROOT / "models/six_axis_arm.urdf"
    text = own.read_text(encoding="utf-8")
    for name, mass in (("a", "4.2"), ("b$(touch${IFS}executed)", "4.5")):
        changed = text.replace('mass value="4.2"', f'mass value="{mass}"')
        (tmp_path / f"{name}.urdf").write_text(changed, encoding="utf-8")
    (other,) = (each.name for each in tmp_path.glob("b*.urdf"))
    for pairs, status in (
        ("a.urdf a.urdf\n", 0),
        (f"\na.urdf a.urdf\na.urdf  {other}\n", 1),
        ("a.urdf\n", 2),
    ):
        result = run(COMPARE["run"], runner | variables(COMPARE, pairs=pairs), tmp_path)
        assert result.returncode == status, result.stdout + result.stderr
    result = run(COMPARE["run"], runner | variables(COMPARE, pairs=f"a.urdf {other}"), tmp_path)
    assert "::error file=" in result.stdout
    assert not list(tmp_path.rglob("executed"))
    (folder,) = {
        line.split("=", 1)[1] for line in (tmp_path / "output").read_text(encoding="utf-8").splitlines()
    }
    assert {each.name for each in Path(folder).iterdir()} == {
        f"{number}.{suffix}" for number in (1, 2) for suffix in ("html", "sarif", "xml")
    }
    accepted = tmp_path / "known.json"
    command = f"same a.urdf '{other}' --write-baseline {accepted.name}"
    assert run(f"dynx-venv/bin/dynx {command}", runner, tmp_path).returncode == 0
    known = {"pairs": f"a.urdf {other}", "pairs-baseline": accepted.name}
    result = run(COMPARE["run"], runner | variables(COMPARE, **known), tmp_path)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "::error" not in result.stdout
