"""Commands that are imported when they are needed, so that ``--help`` imports nothing heavy.

`LazyGroup` imports the declaration of a command (its options and help) when that command is named;
`runs` imports the body of a command when the command runs. An installed package adds a command with
an entry point in the group ``dynx.commands``: ``name = "package.module:click_command"``.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cached_property, wraps
from importlib import import_module
from typing import Any, NamedTuple

import click

from dynx.errors import nearest, shown

GROUP = "dynx.commands"
"""Entry-point group of the commands of installed packages."""


class LazyCommand(NamedTuple):
    """A command that is not imported yet: ``module:attribute`` and its line in the list of commands."""

    target: str
    help: str


class LazyGroup(click.Group):
    """A group whose commands come from a table and from entry points, imported when they are named.

    A command of the table is listed with the help of the table, so that listing imports none of them.
    An entry point never replaces a command of the table.
    """

    def __init__(self, *args: Any, table: Mapping[str, LazyCommand] | None = None, **extra: Any) -> None:
        super().__init__(*args, **extra)
        self.table = dict(table or {})

    @cached_property
    def _entry_points(self) -> dict[str, Any]:
        """Entry points of installed packages by the name of the command."""
        if not _may_have_entry_points():
            return {}
        from importlib.metadata import entry_points  # imported only here: it takes as long as click itself

        return {each.name: each for each in entry_points(group=GROUP) if each.name not in self.table}

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of the commands: the table in its order, then those of other packages by name."""
        return [*self.table, *sorted({*self._entry_points, *self.commands} - {*self.table})]

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """Import the command `name`; None where there is none.

        Raises ClickException for an entry point that cannot be loaded.
        """
        if name in self.table:
            return _command(import_object(self.table[name].target))
        if name in self.commands or name not in self._entry_points:
            return super().get_command(ctx, name)
        point = self._entry_points[name]
        try:
            return _command(point.load())
        except Exception as error:  # code of another package can raise anything
            raise click.ClickException(
                f"the command {shown(name)} of the entry point {point.value} cannot be loaded: "
                f"{type(error).__name__}: {error}"
            ) from error

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the name and the command that arguments begin with, and the others.

        Raises UsageError, which names the nearest command, where there is none.
        """
        if args and self.get_command(ctx, args[0]) is None and not args[0].startswith("-"):
            ctx.fail(f"no command {shown(args[0])}{nearest(args[0], self.list_commands(ctx))}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of commands, one line each."""
        names = self.list_commands(ctx)
        width = formatter.width - 6 - max(map(len, names))
        with formatter.section("Commands"):
            formatter.write_dl([(name, self._short_help(ctx, name, width)) for name in names])

    def _short_help(self, ctx: click.Context, name: str, width: int) -> str:
        if name in self.table:
            return self.table[name].help
        try:
            command = self.get_command(ctx, name)
        except click.ClickException:
            return "(cannot be loaded)"
        return "" if command is None else command.get_short_help_str(width)


def runs(target: str) -> Callable[[Callable[[], None]], Callable[..., Any]]:
    """Make the callback of a command from a function that has its name and its help (the docstring).

    The callback imports ``module:function``, calls it with the parameters of the command and returns
    what that returns: the exit code, or None.
    """

    def decorate(described: Callable[[], None]) -> Callable[..., Any]:
        @wraps(described)
        def callback(**parameters: Any) -> Any:
            return import_object(target)(**parameters)

        return callback

    return decorate


def import_object(target: str) -> Any:
    """Import the object that ``module:attribute`` names."""
    module, _, attribute = target.partition(":")
    return getattr(import_module(module), attribute)


def _may_have_entry_points() -> bool:
    """Check whether metadata on ``sys.path`` names the entry-point group (or may, inside an archive)."""
    for folder in sys.path:
        try:
            names = os.listdir(folder or os.curdir)
        except NotADirectoryError:
            return True
        except OSError:
            continue
        for name in names:
            if name.endswith((".dist-info", ".egg-info")):
                with suppress(OSError), open(os.path.join(folder, name, "entry_points.txt"), "rb") as file:
                    if GROUP.encode() in file.read():
                        return True
    return False


def _command(found: object) -> click.Command:
    if not isinstance(found, click.Command):
        raise TypeError(f"{shown(found)} is no click.Command")
    return found
