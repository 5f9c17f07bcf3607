"""The group of commands: help, start-up, and the exit codes of errors."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from dynx._version import __version__
from dynx.agreement.agreement import DEFAULT_SAMPLES
from dynx.cli.shell.main import COMMANDS, SYNONYMS, CommandLine, cli
from dynx.doctor.diagnosis import DEFAULT_SAMPLES as DEFAULT_STATES


def test_version() -> None:
    assert CliRunner().invoke(cli, ["--version"]).output == f"dynx {__version__}\n"


@pytest.mark.parametrize("name", [None, *COMMANDS])
def test_help_of_every_command_has_examples_and_fits_80_columns(name: str | None) -> None:
    arguments = ["--help"] if name is None else [name, "--help"]
    result = CliRunner().invoke(cli, arguments, terminal_width=80)
    assert result.exit_code == 0
    assert "Examples:" in result.output
    assert max(map(len, result.output.splitlines())) <= 80


def test_no_argument_gives_help() -> None:
    result = CliRunner().invoke(cli, [])
    assert result.exit_code == 0
    assert "agree" in result.output


def test_a_group_of_commands_without_one_gives_help() -> None:
    result = CliRunner().invoke(cli, ["env"])
    assert result.exit_code == 2
    assert "Commands:\n  distance" in result.output
    assert "error" not in result.output


def test_the_default_of_samples_is_that_of_agree() -> None:
    text = " ".join(CliRunner().invoke(cli, ["agree", "--help"]).output.split())
    assert f"(default: {DEFAULT_SAMPLES}; with --as-loaded {DEFAULT_STATES})" in text


def test_help_imports_nothing_slow() -> None:
    """Import no slow package for the group or for the declaration of any command."""
    script = (
        "import click, sys; from dynx.cli.shell.main import COMMANDS, cli; context = click.Context(cli); "
        "[cli.get_command(context, name).get_help(context) for name in COMMANDS]; cli.get_help(context); "
        "slow = ('numpy', 'rich', 'mpmath', 'pinocchio', 'pybullet', 'dynx.model'); "
        "print([name for name in slow if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def broken() -> CommandLine:
    """Return a command line with a defect."""

    @click.command()
    def fail() -> None:
        raise KeyError("some\nthing")

    group = CommandLine("broken")
    group.add_command(fail)
    return group


def test_a_defect_is_one_line_and_70(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DYNX_TRACEBACK", raising=False)
    result = CliRunner().invoke(broken(), ["fail"])
    assert result.exit_code == 70
    assert "defect of dynx" in result.stderr
    assert "KeyError" in result.stderr
    assert result.stderr.count("\n") == 1


def test_the_environment_variable_turns_tracebacks_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DYNX_TRACEBACK", "1")
    assert "Traceback" in CliRunner().invoke(broken(), ["fail"]).stderr


def test_python_dash_m() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "dynx", "nosuch"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stderr.startswith("dynx: error: ")


def closed_pipe(*arguments: str) -> tuple[int, bytes]:
    """Return exit code and standard error of a command whose reader is gone before it writes."""
    command = [sys.executable, "-m", "dynx", *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        errors = process.stderr.read()
    return process.returncode, errors


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGPIPE")
@pytest.mark.parametrize(
    "arguments",
    [["--help"], ["--version"], ["fk", "--help"], ["robots"], ["robots", "--json"], ["id", "six_axis_arm"]],
)
def test_a_closed_pipe_is_not_a_negative_result(arguments: list[str]) -> None:
    assert closed_pipe(*arguments) == (141, b"")


FULL = Path("/dev/full")


@pytest.mark.skipif(not FULL.exists(), reason="no device that is always full")
@pytest.mark.parametrize(
    "arguments", [["--help"], ["info", "six_axis_arm"], ["info", "six_axis_arm", "--json"]]
)
def test_output_that_cannot_be_written_is_no_defect(arguments: list[str]) -> None:
    with FULL.open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "dynx", *arguments],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert done.returncode == 74
    assert done.stderr.startswith("dynx: error: standard output cannot be written")
    assert done.stderr.count("\n") == 1


@pytest.mark.skipif(sys.platform == "win32", reason="a POSIX shell")
@pytest.mark.parametrize("arguments", ["info six_axis_arm", "info six_axis_arm --json"])
def test_no_standard_output_at_all(arguments: str) -> None:
    script = f'"{sys.executable}" -m dynx {arguments} >&-'
    done = subprocess.run(["sh", "-c", script], stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 74
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "nearest"),
    [
        (["doctr"], "doctor"),
        (["env", "lst"], "list"),
        (["inverse-dynamics"], "id"),
        (["inverse_kinematics"], "ik"),
        (["diagnose"], "doctor"),
        (["simulate"], "sim"),
    ],
)
def test_a_mistyped_command_of_any_group_names_the_nearest(words: list[str], nearest: str) -> None:
    result = CliRunner().invoke(cli, words)
    assert result.exit_code == 2
    assert f"no command '{words[-1]}'; did you mean '{nearest}'?" in result.output


def test_words_for_commands_lead_to_commands() -> None:
    assert not {*SYNONYMS} & {*COMMANDS}
    assert {*SYNONYMS.values()} <= {*COMMANDS}


@pytest.mark.parametrize("command", [name for name in COMMANDS if name != "env"])
def test_a_mistyped_option_of_every_command_names_the_nearest(command: str) -> None:
    result = CliRunner().invoke(cli, [command, "--jsn"])
    assert result.exit_code == 2
    assert ("--json" in result.output.partition("; did you mean ")[2]) == (command != "view"), result.output
    result = CliRunner().invoke(cli, [command, "--wholly-else"])
    assert "no option '--wholly-else' (see" in result.output


@pytest.mark.parametrize("words", [[], ["id"], ["env", "list"]])
def test_usage_begins_with_the_program(words: list[str]) -> None:
    text = CliRunner().invoke(cli, [*words, "--help"]).output
    assert text.startswith(" ".join(("Usage: dynx", *words)))
