"""``dynx backends``: which engines there are, and which work here."""

from __future__ import annotations

from typing import Any

import click

from dynx.cli.shell.options import json_flag


@click.command(short_help="List the backends, and which are installed.")
@json_flag
def backends(as_json: bool) -> None:
    """List every backend, whether its engine is installed, its version, and what would bring it.

    \b
    Examples:
      dynx backends
      dynx backends --json
    """
    from dynx.backends.registry import backend_names
    from dynx.cli.shell.exits import one_line
    from dynx.cli.shell.tables import Table
    from dynx.cli.shell.terminal import console, echo_json

    found = [_tried(name) for name in backend_names()]
    if as_json:
        echo_json({"schema": 1, "backends": found})
        return
    table = Table("backend", "installed", "engine")
    for each in found:
        mark = "yes" if each["installed"] else "no"
        table.add_row(each["name"], mark, one_line(each["version"] or each["reason"]))
    console().print(table)


def _tried(name: str) -> dict[str, Any]:
    from dynx.backends.registry import backend
    from dynx.errors import BackendError
    from dynx.model import Link, Model

    try:
        with backend(name, Model.build("probe", [Link("base")], [])) as engine:
            return {"name": name, "installed": True, "version": engine.engine_version, "reason": None}
    except BackendError as error:
        return {"name": name, "installed": False, "version": None, "reason": str(error)}
