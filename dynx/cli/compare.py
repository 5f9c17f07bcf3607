"""Run of ``dynx compare``: both files read and compared, with a JSON document, tables and exit code.

Distances in the document are in rad or m, times in s; the tables are made from it alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, TypedDict

from rich.console import Console

from dynx.cli.shell.exits import exit_code, one_line, short_line
from dynx.cli.shell.output import Entry, check_json, counted, entry_of, present, progress_bar
from dynx.cli.shell.tables import MAX_ROWS, Table, print_rest
from dynx.errors import ArgumentError
from dynx.model.loading import load
from dynx.sim.comparison import TOLERANCE, Cause, RolloutComparison, compare
from dynx.sim.record.rollout import Rollout
from dynx.world.separation import Separation


def compare_files(
    first: str,
    second: str,
    tolerance: float | None,
    list_only: bool,
    robot: str | None,
    json_path: str | None,
    quiet: bool,
) -> int:
    """Compare two files of rollouts; return the exit code."""
    check_json(json_path)
    ours, theirs = _read(first, second, robot)
    with progress_bar(1, enabled=not quiet) as advance:

        def progress(done: int, total: int) -> None:
            advance(done, "reruns", total)

        comparison = compare(
            ours,
            theirs,
            tolerance=TOLERANCE if tolerance is None else tolerance,
            rerun=not list_only,
            progress=progress,
        )
    error = present(document(comparison, first, second), show, json_path, quiet=quiet)
    return exit_code(error, negative=not comparison.alike)


def _read(first: str, second: str, robot: str | None) -> tuple[Rollout, Rollout]:
    """Read both files; a table has the robot that is given, or that of the other file."""
    paths = (first, second)
    tables = [_is_table(path) for path in paths]
    if robot is not None and not any(tables):
        raise ArgumentError("--robot is the robot of a .csv file; both of these files have their own")
    model = None if robot is None else load(robot)
    complete = {path: Rollout.load(path) for path, table in zip(paths, tables, strict=True) if not table}
    if model is None and complete:
        model = next(iter(complete.values())).model
    if any(tables) and model is None:
        raise ArgumentError("a .csv file does not have its robot: name it by --robot")
    ours, theirs = (complete[path] if path in complete else Rollout.load(path, model=model) for path in paths)
    return ours, theirs


def _is_table(path: str) -> bool:
    return Path(path).suffix.lower() == ".csv"


SCHEMA: Literal["dynx.compare/1"] = "dynx.compare/1"

THRESHOLDS = (1e-6, 1e-3, 1e-2, 1e-1)
"""Distances [rad or m] whose first time is reported."""


class PartingEntry(TypedDict):
    """First time at which a coordinate or body is farther apart than `distance`; null for never."""

    distance: float
    time: float | None
    name: str | None


class CoordinateEntry(TypedDict):
    """Largest distance of a coordinate or body, its time, and the distance at the end."""

    name: str
    unit: str
    largest: float | None
    time: float
    end: float | None


class CauseEntry(TypedDict):
    """A difference of the scenarios: `alone` is the largest distance from A after only this change to A,
    `without` that from B after all other changes to A. Null: not simulated, or infinite; `obstacle` says why.
    """

    name: str
    first: str
    second: str
    alone: float | None
    without: float | None
    acts: bool
    obstacle: str | None


class CompareDocument(TypedDict):
    """Two rollouts; `repeated` and `remaining` are the distances of a rerun of A from A, and of A with all
    differences from B."""

    schema: Literal["dynx.compare/1"]
    first: str
    second: str
    robot: str
    tolerance: float
    alike: bool
    proved: bool
    duration: float
    largest: float | None
    parted: list[PartingEntry]
    coordinates: list[CoordinateEntry]
    causes: list[CauseEntry]
    repeated: float | None
    remaining: float | None
    notes: list[str]


def document(comparison: RolloutComparison, first: str, second: str) -> CompareDocument:
    """Return the document of a comparison of the files `first` and `second`."""
    apart = comparison.separation
    return {
        "schema": SCHEMA,
        "first": first,
        "second": second,
        "robot": comparison.ours.model.name,
        "tolerance": comparison.tolerance,
        "alike": comparison.alike,
        "proved": comparison.proved,
        "duration": float(apart.times[-1] - apart.times[0]),
        "largest": _finite(apart.largest),
        "parted": [_parting(apart, each) for each in sorted({comparison.tolerance, *THRESHOLDS})],
        "coordinates": [_coordinate(apart, column) for column in range(len(apart.names))],
        "causes": [_cause(each, comparison.tolerance) for each in comparison.causes],
        "repeated": _finite(comparison.repeated),
        "remaining": _finite(comparison.remaining),
        "notes": list(comparison.notes),
    }


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def _parting(apart: Separation, distance: float) -> PartingEntry:
    time, name = apart.first_beyond(distance) or (None, None)
    return {"distance": distance, "time": time, "name": name}


def _coordinate(apart: Separation, column: int) -> CoordinateEntry:
    distances = apart.distances[:, column]
    k = int(distances.argmax())
    return {
        "name": apart.names[column],
        "unit": apart.units[column],
        "largest": _finite(float(distances[k])),
        "time": float(apart.times[k]),
        "end": _finite(float(distances[-1])),
    }


def _cause(cause: Cause, tolerance: float) -> CauseEntry:
    return entry_of(
        CauseEntry,
        cause,
        name=cause.factor.name,
        first=cause.factor.ours,
        second=cause.factor.theirs,
        alone=_finite(cause.alone),
        without=_finite(cause.without),
        acts=cause.acts(tolerance),
    )


def show(out: Console, report: Entry) -> None:
    """Print the verdict, the times at which the rollouts part, and the causes."""
    out.print(verdict(report), style="bold")
    _show_partings(out, report)
    _show_coordinates(out, report["coordinates"])
    _show_causes(out, report)
    for note in report["notes"]:
        out.print(f"note: {one_line(note)}", style="yellow")


def verdict(report: Entry) -> str:
    """Return the first line: whether the rollouts are alike, or why they separate."""
    names = f"{one_line(report['first'])} and {one_line(report['second'])}"
    if report["alike"]:
        apart = f"{_distance(report['largest'])} rad or m apart in {report['duration']:.6g} s"
        return f"{names} are alike: {apart}"
    if report["causes"] and not _is_simulated(report):
        return f"{names} separate; their differences were not simulated"
    acting = sum(each["acts"] for each in report["causes"])
    unknown = sum(_is_unknown(each) for each in report["causes"])
    rest = f"; the effect of {counted(unknown, 'difference')} is not known" if unknown else ""
    causes = counted(acting, "cause") if acting else "all their differences together"
    if report["proved"]:
        return f"{names} separate: {causes}, proved{rest}"
    if acting:
        return f"{names} separate: {causes}, not proved{rest}"
    return f"{names} separate: no cause is known{rest}"


def _is_simulated(report: Entry) -> bool:
    return report["repeated"] is not None or report["remaining"] is not None


def _is_unknown(cause: Entry) -> bool:
    """Return True for a difference that may be a cause, because an effect of it is not known."""
    return not cause["acts"] and None in (cause["alone"], cause["without"])


def _show_partings(out: Console, report: Entry) -> None:
    if report["alike"]:
        return
    table = Table("distance above", "from time [s]", "first", right=("distance above", "from time [s]"))
    for each in report["parted"]:
        since = "never" if each["time"] is None else f"{each['time']:.4g}"
        table.add_row(f"{each['distance']:g}", since, one_line(each["name"] or ""))
    out.print(f"\n{one_line(report['robot'])}: {report['duration']:.6g} s in common, distances in rad or m")
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
    print_rest(out, len(order) - MAX_ROWS)


def _show_causes(out: Console, report: Entry) -> None:
    causes: Sequence[Entry] = report["causes"]
    if not causes:
        return
    table = Table("difference", "in A", "in B", "alone", "without it", "", right=("alone", "without it"))
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
        "\nalone: A with only this change, and its largest distance from A\n"
        "without it: A with all changes except this one, and its largest distance from B"
    )
    out.print(table)
    print_rest(out, len(causes) - MAX_ROWS)
    for each in causes[:MAX_ROWS]:
        if each["obstacle"] is not None:
            out.print(f"{one_line(each['name'])}: {one_line(each['obstacle'])}", style="yellow")
    if _is_simulated(report):
        out.print(
            f"proof: a rerun of A differs from A by {_distance(report['repeated'])}; A with all changes "
            f"differs from B by {_distance(report['remaining'])} (tolerance {report['tolerance']:g})"
        )


def _distance(value: float | None) -> str:
    return "-" if value is None else "0" if value == 0.0 else f"{value:.2g}"
