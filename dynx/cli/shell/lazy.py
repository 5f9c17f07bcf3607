"""Commands that are imported when they are needed, so that ``--help`` imports nothing heavy.

`LazyGroup` imports the declaration of a command (its options and help) when that command is named;
`runs` imports the body of a command when the command runs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import wraps
from importlib import import_module
from typing import Any, NamedTuple

import click

from dynx.errors import nearest, shown


class LazyCommand(NamedTuple):
    """A command that is not imported yet: ``module:attribute`` and its line in the list of commands."""

    target: str
    help: str


class LazyGroup(click.Group):
    """A group whose commands come from a table, and are imported when they are named.

    They are listed with the help of the table, so that listing imports none of them.
    """

    def __init__(
        self,
        *args: Any,
        table: Mapping[str, LazyCommand] | None = None,
        synonyms: Mapping[str, str] | None = None,
        **extra: Any,
    ) -> None:
        """`synonyms` are words that are no commands, with the command that errors name for them."""
        super().__init__(*args, **extra)
        self.table = dict(table or {})
        self.synonyms = dict(synonyms or {})

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of the commands: the table in its order, then those that were added by name."""
        return [*self.table, *super().list_commands(ctx)]

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """Import the command `name`; None where there is none."""
        if name not in self.table:
            return super().get_command(ctx, name)
        command: click.Command = import_object(self.table[name].target)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the name and the command that arguments begin with, and the others.

        Raises UsageError, which names the nearest command, where there is none.
        """
        if args and self.get_command(ctx, args[0]) is None and not args[0].startswith("-"):
            word = args[0].lower().replace("_", "-")
            near = nearest(args[0], self.list_commands(ctx))
            if self.synonyms.get(word) is not None:
                near = f"; did you mean {shown(self.synonyms[word])}?"
            ctx.fail(f"no command {shown(args[0])}{near}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of commands, one line each."""
        if not self.table:
            super().format_commands(ctx, formatter)
            return
        with formatter.section("Commands"):
            formatter.write_dl([(name, command.help) for name, command in self.table.items()])


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
