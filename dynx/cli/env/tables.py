"""Tables of ``dynx env distance``, made from its JSON document alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console

from dynx.cli.shell.exits import one_line
from dynx.cli.shell.tables import Table

Entry = Mapping[str, Any]


def show(out: Console, report: Entry) -> None:
    """Print where every two engines part, and what each policy is worth on each engine."""
    seeds = len(report["pairs"][0]["episodes"])
    out.print(
        f"{one_line(report['task'])}: {seeds} episode{'s' * (seeds != 1)} with the same actions, on "
        f"{', '.join(report['engines'])}",
        style="bold",
    )
    right = ("parted", "first step", "median step", "largest difference", "returns")
    columns = (*right[:2], "parts first", *right[2:])
    table = Table("engines", *columns, right=right)
    for pair in report["pairs"]:
        table.add_row(
            ", ".join(pair["engines"]),
            f"{pair['parted']} of {len(pair['episodes'])}",
            "never" if pair["first_step"] is None else str(pair["first_step"]),
            _first_entry(pair),
            "never" if pair["median_step"] is None else f"{pair['median_step']:g}",
            f"{pair['largest']:.2e}",
            ", ".join(f"{each:.5g}" for each in pair["mean_returns"]),
        )
    out.print(table)
    out.print(
        f"two engines part where an entry of the observation differs by more than {report['tolerance']:g}; "
        "the one that differs most at the first step is named"
    )
    if report["policies"]:
        _show_policies(out, report)


def _first_entry(pair: Entry) -> str:
    if pair["first_step"] is None:
        return ""
    return "end of the episode" if pair["first_entry"] is None else one_line(pair["first_entry"])


def _show_policies(out: Console, report: Entry) -> None:
    columns = [f"on {engine}" for engine in report["engines"]]
    table = Table("policy", "trained on", *columns, right=tuple(columns))
    for each in report["policies"]:
        cells = (f"{row['mean']:.4g} +- {row['deviation']:.2g}" for row in each["engines"])
        table.add_row(one_line(each["file"]), each["trained_on"] or "", *cells)
    episodes = report["policies"][0]["episodes"]
    out.print(f"\nreturn of each policy, mean and deviation of {episodes} episodes")
    out.print(table)
