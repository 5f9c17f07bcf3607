"""Body of ``dynx backends``: the backends, and which work here."""

from __future__ import annotations

from typing import Any

from dynx.backends.registry import backend, backend_names
from dynx.cli.shell.exits import one_line
from dynx.cli.shell.tables import Table
from dynx.cli.shell.terminal import console, write_json
from dynx.errors import BackendError
from dynx.model import Link, Model


def backends(json_path: str | None) -> None:
    """Print the table or the document of the backends."""
    entries = [_entry(name) for name in backend_names()]
    if write_json({"schema": 1, "backends": entries}, json_path):
        return
    table = Table("backend", "installed", "engine")
    for each in entries:
        mark = "yes" if each["installed"] else "no"
        table.add_row(each["name"], mark, one_line(each["version"] or each["reason"]))
    console().print(table)


def _entry(name: str) -> dict[str, Any]:
    try:
        with backend(name, Model.build("probe", [Link("base")], [])) as engine:
            return {"name": name, "installed": True, "version": engine.engine_version, "reason": None}
    except BackendError as error:
        return {"name": name, "installed": False, "version": None, "reason": str(error)}
