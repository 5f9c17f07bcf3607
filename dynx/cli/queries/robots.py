"""``dynx robots``: the robots that have a name."""

from __future__ import annotations

import click

from dynx.cli.shell.options import json_flag


@click.command(short_help="List the robots that have a name.")
@click.argument("words", nargs=-1, metavar="[WORD]...")
@json_flag
def robots(words: tuple[str, ...], as_json: bool) -> None:
    """List every robot that has a name: where it comes from, and its file.

    With WORDs, only the robots whose name or path contains one of them.

    \b
    Examples:
      dynx robots
      dynx robots ur talos
      dynx robots --json
    """
    from dynx.cli.shell.tables import Table
    from dynx.cli.shell.terminal import console, counted, echo_json
    from dynx.model.library import robots as library

    entries = [
        entry
        for entry in library()
        if not words or any(word.lower() in f"{entry.name} {entry.path}".lower() for word in words)
    ]
    if as_json:
        echo_json(
            {
                "schema": 1,
                "robots": [
                    {
                        "name": entry.name,
                        "aliases": list(entry.aliases),
                        "source": entry.source,
                        "path": str(entry.path),
                    }
                    for entry in entries
                ],
            }
        )
        return
    table = Table("name", "from", "path")
    for entry in entries:
        table.add_row(entry.name, entry.source, str(entry.path))
    out = console()
    out.print(table)
    out.print(f"\n{counted(len(entries), 'robot')}")
