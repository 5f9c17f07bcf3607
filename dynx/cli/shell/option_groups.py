"""Commands with many options, which ``--help`` lists under headings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import click

F = TypeVar("F", bound=Callable[..., Any])

REST = "Other options"
"""The heading of what no group names, such as ``--help``."""


class GroupedCommand(click.Command):
    """A command whose options are listed by `groups`: headings, each with the parameters under it."""

    def __init__(self, *args: Any, groups: Mapping[str, Sequence[str]], **extra: Any) -> None:
        super().__init__(*args, **extra)
        self.groups = groups

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options, group by group."""
        options = [param for param in self.get_params(ctx) if isinstance(param, click.Option)]
        records = {param.name: param.get_help_record(ctx) for param in options}
        grouped = {name for names in self.groups.values() for name in names}
        rest = [name for name in records if name is not None and name not in grouped]
        for title, names in [*self.groups.items(), (REST, rest)]:
            rows = [record for record in map(records.get, names) if record is not None]
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)


def stacked(*options: Callable[[F], F]) -> Callable[[F], F]:
    """Several options as one decorator."""

    def decorate(command: F) -> F:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate
