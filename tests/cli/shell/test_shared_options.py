"""Options that every command shares: ``--quiet``, one name of the option of engines, and ``--gravity``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from dynx.cli.shell.main import COMMANDS, cli
from dynx.cli.shell.options import ENGINE_SPELLINGS

WITHOUT_ENGINES = {"info", "explain", "robots", "backends", "compare", "convert", "same", "env list"}
"""Commands in which no engine is chosen."""


def commands() -> Iterator[tuple[str, click.Command]]:
    """Yield every command with its name, those of groups included."""
    context = click.Context(cli)
    for name in COMMANDS:
        command = cli.get_command(context, name)
        assert command is not None
        if isinstance(command, click.Group):
            for inner in command.list_commands(context):
                found = command.get_command(context, inner)
                assert found is not None
                yield f"{name} {inner}", found
        else:
            yield name, command


ALL = dict(commands())


@pytest.mark.parametrize("name", ALL)
def test_every_command_is_quiet_on_request(name: str) -> None:
    assert "--quiet" in {spelling for param in ALL[name].params for spelling in param.opts}


@pytest.mark.parametrize("name", sorted(set(ALL) - WITHOUT_ENGINES))
def test_engines_are_chosen_by_one_name_and_every_former_one(name: str) -> None:
    (option,) = (param for param in ALL[name].params if "--engine" in param.opts)
    assert tuple(option.opts) == ENGINE_SPELLINGS
    text = ALL[name].get_help(click.Context(ALL[name]))
    assert "--engine " in text
    assert not any(f"  {spelling} " in text for spelling in ENGINE_SPELLINGS[1:])


@pytest.mark.parametrize("spelling", ENGINE_SPELLINGS)
def test_a_former_name_chooses_the_same_engine(spelling: str) -> None:
    result = CliRunner().invoke(cli, ["mass", "planar_2r", spelling, "reference"])
    assert result.exit_code == 0, result.output
    assert "planar_2r, fixed base, reference" in result.output
    result = CliRunner().invoke(cli, ["agree", "planar_2r", spelling, "reference,pinochio"])
    assert result.exit_code == 2
    assert "did you mean 'pinocchio'" in result.output


@pytest.mark.parametrize(
    "words",
    [
        ["info", "planar_2r"],
        ["robots"],
        ["backends"],
        ["explain", "DX101"],
        ["explain"],
        ["env", "list"],
        ["sim", "planar_2r", "--to", "0.1,0.2", "--duration", "0.1"],
        [
            "bench",
            "planar_2r",
            "--quantity",
            "mass-matrix",
            "--batch",
            "1",
            "--engine",
            "reference",
            "--quick",
        ],
        ["view", "planar_2r", "--export", "out.html"],
    ],
    ids=lambda words: words[0],
)
def test_a_quiet_command_writes_nothing_but_files(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(cli, [*words, "--quiet"])
    assert result.exit_code == 0, result.output
    assert result.output == ""


@pytest.mark.parametrize("name", ["fk", "jacobian", "id", "fd", "mass", "ik", "info", "sim"])
def test_every_query_takes_gravity(name: str) -> None:
    assert "--gravity" in {spelling for param in ALL[name].params for spelling in param.opts}
