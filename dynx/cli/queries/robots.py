"""Body of ``dynx robots``: the robots that have a name."""

from __future__ import annotations

from dynx.cli.shell.tables import Table
from dynx.cli.shell.terminal import console, counted, echo_json
from dynx.model import library


def robots(words: tuple[str, ...], as_json: bool) -> None:
    """Print the robots whose name or path contains one of `words`, or all."""
    entries = [
        entry
        for entry in library.robots()
        if not words or any(word.lower() in f"{entry.name} {entry.path}".lower() for word in words)
    ]
    if as_json:
        listed = [
            {
                "name": entry.name,
                "aliases": list(entry.aliases),
                "source": entry.source,
                "path": str(entry.path),
            }
            for entry in entries
        ]
        echo_json({"schema": 1, "robots": listed})
        return
    table = Table("name", "from", "path")
    for entry in entries:
        table.add_row(entry.name, entry.source, str(entry.path))
    out = console()
    out.print(table)
    out.print(f"\n{counted(len(entries), 'robot')}")
