"""Table of ``dynx play``, made from its JSON document alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console

from dynx.cli.shell.exits import one_line
from dynx.cli.shell.tables import Table
from dynx.cli.shell.terminal import counted

Entry = Mapping[str, Any]


def show(out: Console, report: Entry) -> None:
    """Print what the policy is worth on each engine."""
    engine = f" on {one_line(report['trained_on'])}" if report["trained_on"] else ""
    out.print(
        f"{one_line(report['task'])}: {report['algorithm']}, {report['steps']:,} steps{engine}", style="bold"
    )
    right = ("return", "deviation", "mean between", "least", "mean length")
    table = Table("engine", *right, right=right)
    for each in report["engines"]:
        table.add_row(
            one_line(each["engine"] or "its own"),
            f"{each['mean']:.5g}",
            f"{each['deviation']:.3g}",
            f"{each['low']:.5g} and {each['high']:.5g}",
            f"{min(each['returns']):.5g}",
            f"{each['mean_length']:.4g}",
        )
    out.print(table)
    episodes = counted(len(report["engines"][0]["returns"]), "episode")
    out.print(
        f"{episodes}, the first with seed {report['seed']}; the true mean lies between the two with 95 %"
    )
