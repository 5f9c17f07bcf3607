"""Body of ``dynx robots``: the robots that have a name."""

from __future__ import annotations

import os
from itertools import groupby

from dynx.cli.shell.tables import Table
from dynx.cli.shell.terminal import console, counted, write_json
from dynx.model import library


def robots(words: tuple[str, ...], json_path: str | None) -> None:
    """Print the robots whose name or path contains one of `words`, or all."""
    entries = [
        entry
        for entry in library.robots()
        if not words or any(word.lower() in f"{entry.name} {entry.path}".lower() for word in words)
    ]
    if json_path is not None:
        listed = [
            {
                "name": entry.name,
                "aliases": list(entry.aliases),
                "source": entry.source,
                "path": str(entry.path),
            }
            for entry in entries
        ]
        if write_json({"schema": 1, "robots": listed}, json_path):
            return
    out = console()
    for source, group in groupby(entries, key=lambda entry: entry.source):
        members = list(group)
        folder = os.path.commonpath([entry.path.parent for entry in members])
        out.print(f"{source}: {folder}", style="bold")
        # The whole list fits 80 columns; a part of it shows where each file is.
        table = Table("name", "file")
        for entry in members:
            table.add_row(entry.name, os.path.relpath(entry.path, folder) if words else entry.path.name)
        out.print(table)
        out.print()
    out.print(f"{counted(len(entries), 'robot')}; dynx robots WORD shows the folders of those with WORD")
