"""Table of ``dynx train``, made from its JSON document alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console

from dynx.cli.shell.exits import one_line
from dynx.cli.shell.tables import Table

Entry = Mapping[str, Any]


def show(out: Console, report: Entry) -> None:
    """Print the return of each run, their mean, and where the policies are."""
    engine = f" on {one_line(report['engine'])}" if report["engine"] else ""
    out.print(f"{one_line(report['task'])}{engine}, {report['algorithm']}", style="bold")
    right = ("seed", "steps", "episodes", "return", "deviation", "least", "time [s]")
    table = Table(
        "seed", "steps", "episodes", "return", "deviation", "least", "time [s]", "policy", right=right
    )
    for run in report["runs"]:
        table.add_row(
            str(run["seed"]),
            f"{run['steps']:,}",
            str(run["episodes"]),
            f"{run['mean']:.5g}",
            f"{run['deviation']:.3g}",
            f"{run['least']:.5g}",
            f"{run['seconds']:.0f}",
            f"{one_line(run['folder'])}/final.zip",
        )
    out.print(table)
    if len(report["runs"]) > 1:
        out.print(
            f"mean of the runs {report['mean']:.5g}, with 95 % confidence between {report['low']:.5g} and "
            f"{report['high']:.5g}"
        )
    out.print(f"to see it: dynx play {one_line(report['runs'][0]['folder'])}/final.zip --view")
