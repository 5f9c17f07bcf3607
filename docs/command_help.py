"""The directive `command-help`: a section for each command of dynx with the text of its ``--help``."""

from __future__ import annotations

from collections.abc import Iterator

import click
from click.testing import CliRunner
from docutils import nodes
from docutils.parsers.rst import Directive
from sphinx.application import Sphinx

from dynx.cli.shell.main import cli

WIDTH = 96
"""Columns of the text, which fit on a page."""


def setup(app: Sphinx) -> dict[str, object]:
    """Register the directive."""
    app.add_directive("command-help", CommandHelp)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


class CommandHelp(Directive):
    """Sections of all commands."""

    def run(self) -> list[nodes.Node]:
        """Return a section for each command, in the order of ``dynx --help``."""
        found: list[nodes.Node] = []
        for path in commands(cli, ()):
            name = " ".join(("dynx", *path))
            text = CliRunner().invoke(cli, [*path, "--help"], terminal_width=WIDTH).output
            block = nodes.literal_block(text, text, language="text")
            section = nodes.section("", nodes.title(name, name), block, ids=[name.replace(" ", "-")])
            self.state.document.note_implicit_target(section, section)
            found.append(section)
        return found


def commands(command: click.Command, path: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    """Return the words after ``dynx`` of a command and of all below it."""
    yield path
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            below = command.get_command(context, name)
            if below is not None:
                yield from commands(below, (*path, name))
