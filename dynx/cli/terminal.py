"""Where output goes: tables through rich, JSON as text, both fit for pipes and old terminals."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

PIPE_WIDTH = 10_000
"""Columns where nobody watches: nothing is wrapped or cut in a file or a pipe."""


def console(*, err: bool = False) -> Console:
    """A console on standard output or error; `err` also sends tables away from JSON on stdout.

    Names of robots may hold anything, so neither markup nor emoji codes are read. NO_COLOR, TERM
    and COLUMNS are honoured.
    """
    from rich.console import Console

    stream = sys.stderr if err else sys.stdout
    width = None if stream.isatty() or "COLUMNS" in os.environ else PIPE_WIDTH
    return Console(file=stream, width=width, markup=False, emoji=False, highlight=False)


def plain_table(*columns: str, right: Sequence[str] = ()) -> Table:
    """An empty table in the one style of dynx; columns named in `right` are aligned right."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for column in columns:
        table.add_column(column, justify="right" if column in right else "left", overflow="fold")
    return table


def json_text(document: object) -> str:
    """`document` as JSON that every parser reads: numbers that JSON does not know become null."""
    return json.dumps(_finite(document), indent=2, ensure_ascii=True, allow_nan=False)


def echo_json(document: object) -> None:
    """Write `document` to standard output."""
    click.echo(json_text(document))


def number(value: float) -> str:
    """A number of a table: nine significant digits, and zero as 0 whatever its sign."""
    return "0" if value == 0.0 else f"{value:.9g}"


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _finite(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
