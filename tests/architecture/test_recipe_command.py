"""The recipe for a command: one module and an entry point, in a package of somebody else."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from dynx.cli.shell.main import COMMANDS
from tests.architecture.packages import write_package

MODULE = '''"""Mass of a robot."""

import click

from dynx.cli.shell.inputs import load_robot
from dynx.cli.shell.options import model_options


@click.command
@click.argument("robot")
@model_options
def weigh(robot, **options):
    """Print the total mass of a robot [kg]."""
    click.echo(f"{load_robot(robot, **options).total_mass:.3f} kg")
'''


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """Return the folder of the package, for the import path of a process."""
    write_package(tmp_path, "acme_weigh", MODULE, "[dynx.commands]\nweigh = acme_weigh:weigh\n")
    return tmp_path


def dynx_command(package: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run ``dynx`` in a process that finds the package."""
    path = os.pathsep.join([str(package), *filter(None, sys.path)])
    return subprocess.run(
        [sys.executable, "-m", "dynx", *arguments],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )


def test_it_runs_with_the_errors_and_exit_codes_of_dynx(package: Path) -> None:
    done = dynx_command(package, "weigh", "double_pendulum")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.endswith(" kg\n")
    refused = dynx_command(package, "weigh", "no_such_robot")
    assert refused.returncode == 2
    assert refused.stderr.startswith("dynx: error: no robot 'no_such_robot'")


def test_it_is_listed_after_the_commands_of_dynx(package: Path) -> None:
    text = dynx_command(package, "--help").stdout
    listed = [
        line.split()[0] for line in text.partition("Commands:")[2].splitlines() if line.startswith("  ")
    ]
    assert listed[: len(COMMANDS) + 1] == [*COMMANDS, "weigh"]
    assert "weigh     Print the total mass of a robot [kg]." in text


def test_it_has_help(package: Path) -> None:
    done = dynx_command(package, "weigh", "--help")
    assert "Print the total mass of a robot [kg]." in done.stdout
    assert "--lock JOINT=VALUE" in done.stdout


def test_it_never_replaces_a_command_of_dynx(package: Path) -> None:
    metadata = package / "acme_weigh-1.0.dist-info" / "entry_points.txt"
    metadata.write_text("[dynx.commands]\nrobots = acme_weigh:weigh\n")
    done = dynx_command(package, "robots", "ur5")
    assert "ur5_robot.urdf" in done.stdout


@pytest.mark.parametrize(
    ("target", "reason"),
    [("no_such_module:weigh", "ModuleNotFoundError"), ("acme_weigh:load_robot", "is no click.Command")],
)
def test_one_that_cannot_be_loaded_is_named_and_hides_no_other(
    package: Path, target: str, reason: str
) -> None:
    metadata = package / "acme_weigh-1.0.dist-info" / "entry_points.txt"
    metadata.write_text(f"[dynx.commands]\nweigh = {target}\n")
    done = dynx_command(package, "weigh", "ur5")
    assert done.returncode == 2
    assert f"the command 'weigh' of the entry point {target} cannot be loaded" in done.stderr
    assert reason in done.stderr
    listed = dynx_command(package, "--help")
    assert listed.returncode == 0
    assert "agree" in listed.stdout
    assert "weigh     (cannot be loaded)" in listed.stdout
