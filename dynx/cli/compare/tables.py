"""Tables of ``dynx compare``, made from its JSON document alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console

from dynx.cli.shell.exits import one_line, short_line
from dynx.cli.shell.tables import Table
from dynx.cli.shell.terminal import counted

Entry = Mapping[str, Any]

MAX_ROWS = 30
"""Largest number of rows of a table; the JSON document has them all."""


def show(out: Console, report: Entry) -> None:
    """Print the verdict, the times at which the rollouts part, and the causes."""
    out.print(verdict(report), style="bold")
    _show_partings(out, report)
    _show_coordinates(out, report["coordinates"])
    _show_causes(out, report)
    for note in report["notes"]:
        out.print(f"note: {one_line(note)}", style="yellow")


def verdict(report: Entry) -> str:
    """Return the first line: whether the rollouts are alike, or why they part."""
    names = f"{one_line(report['first'])} and {one_line(report['second'])}"
    if report["alike"]:
        apart = f"{_distance(report['largest'])} rad or m apart in {report['duration']:.6g} s"
        return f"{names} are alike: {apart}"
    if report["causes"] and not _is_simulated(report):
        return f"{names} part; their differences were not simulated"
    acting = sum(each["acts"] for each in report["causes"])
    unknown = sum(_is_unknown(each) for each in report["causes"])
    rest = f"; the effect of {counted(unknown, 'difference')} is not known" if unknown else ""
    causes = counted(acting, "cause") if acting else "all their differences together"
    if report["proved"]:
        return f"{names} part, for {causes}, proved{rest}"
    if acting:
        return f"{names} part; {causes}, not proved{rest}"
    return f"{names} part, for no cause that is known{rest}"


def _is_simulated(report: Entry) -> bool:
    return report["repeated"] is not None or report["remaining"] is not None


def _is_unknown(cause: Entry) -> bool:
    """Return True for a difference that may be a cause, because an effect of it is not known."""
    return not cause["acts"] and None in (cause["alone"], cause["without"])


def _show_partings(out: Console, report: Entry) -> None:
    if report["alike"]:
        return
    table = Table("farther apart than", "since [s]", "first", right=("farther apart than", "since [s]"))
    for each in report["parted"]:
        since = "never" if each["time"] is None else f"{each['time']:.4g}"
        table.add_row(f"{each['distance']:g}", since, one_line(each["name"] or ""))
    out.print(f"\n{one_line(report['robot'])}, {report['duration']:.6g} s that both have [rad; m]")
    out.print(table)


def _show_coordinates(out: Console, coordinates: Sequence[Entry]) -> None:
    numbers = ("largest distance", "at [s]", "at the end")
    table = Table("of", "unit", *numbers, right=numbers)

    def largest(each: Entry) -> float:
        return float("inf") if each["largest"] is None else float(each["largest"])

    order = sorted(coordinates, key=largest, reverse=True)
    for each in order[:MAX_ROWS]:
        table.add_row(
            one_line(each["name"]),
            each["unit"],
            _distance(each["largest"]),
            f"{each['time']:.4g}",
            _distance(each["end"]),
        )
    if order:
        out.print("")
        out.print(table)
    _tell_rest(out, len(order) - MAX_ROWS)


def _show_causes(out: Console, report: Entry) -> None:
    causes: Sequence[Entry] = report["causes"]
    if not causes:
        return
    table = Table("difference", "in A", "in B", "alone", "left by it", "", right=("alone", "left by it"))
    for each in causes[:MAX_ROWS]:
        word = "cause" if each["acts"] else "not known" if _is_unknown(each) else "no effect"
        if not _is_simulated(report):
            word = ""
        table.add_row(
            one_line(each["name"]),
            short_line(each["first"]),
            short_line(each["second"]),
            _distance(each["alone"]),
            _distance(each["without"]),
            word,
        )
    out.print(
        "\ndifferences, and the largest distance: from A if this one alone is taken over, "
        "left to B if all others are"
    )
    out.print(table)
    _tell_rest(out, len(causes) - MAX_ROWS)
    for each in causes[:MAX_ROWS]:
        if each["obstacle"] is not None:
            out.print(f"{one_line(each['name'])}: {one_line(each['obstacle'])}", style="yellow")
    if _is_simulated(report):
        out.print(
            f"proof: a rerun of A is {_distance(report['repeated'])} from A; with all differences taken over "
            f"it is {_distance(report['remaining'])} from B (tolerance {report['tolerance']:g})"
        )


def _distance(value: float | None) -> str:
    return "-" if value is None else "0" if value == 0.0 else f"{value:.2g}"


def _tell_rest(out: Console, rest: int) -> None:
    if rest > 0:
        out.print(f"... and {rest} more (--json has all)")
