"""Tables of ``dynx world``, made from its JSON document alone."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from rich.console import Console

from dynx.cli.shell.exits import one_line
from dynx.cli.shell.tables import Table
from dynx.cli.shell.terminal import counted

Entry = Mapping[str, Any]

MAX_ROWS = 30
"""Largest number of rows of a table; the JSON document has them all."""


def show(out: Console, report: Entry) -> None:
    """Print the final states, the contacts, and the distances between the engines."""
    engines: Sequence[Entry] = report["engines"]
    names = ", ".join(f"{each['engine']} {each['version']}" for each in engines)
    step = f"dt {report['dt']:g} s" + (f" in {report['substeps']} steps" if report["substeps"] > 1 else "")
    out.print(
        f"{one_line(report['scene'])}: {report['duration']:g} s, {step}, by {one_line(names)}", style="bold"
    )
    for each in engines:
        if each["error"] is not None:
            out.print(
                f"{each['engine']} ended at {each['time']:.6g} s: {one_line(each['error'])}", style="red"
            )
    _show_notes(out, engines)
    _show_bodies(out, engines)
    _show_robots(out, engines)
    _show_contacts(out, engines)
    _show_separations(out, report["separations"])


def _show_notes(out: Console, engines: Sequence[Entry]) -> None:
    """Print the notes on the start, once where the engines have the same."""
    found: dict[str, list[str]] = defaultdict(list)
    for each in engines:
        for note in each["notes"]:
            found[note].append(each["engine"])
    for note, names in list(found.items())[:MAX_ROWS]:
        where = "" if len(names) == len(engines) else f" ({', '.join(names)})"
        out.print(f"note: {one_line(note)}{where}", style="yellow")


def _show_bodies(out: Console, engines: Sequence[Entry]) -> None:
    count = len(engines[0]["bodies"])
    if not count:
        return
    table = Table(
        "body", "engine", "x [m]", "y [m]", "z [m]", "speed [m/s]", right=("x [m]", "y [m]", "z [m]")
    )
    for k in range(min(count, MAX_ROWS)):
        for each in engines:
            body = each["bodies"][k]
            speed = float(np.linalg.norm(body["twist"][:3]))
            place = (f"{x:.4f}" for x in body["position"])
            table.add_row(one_line(body["name"]), each["engine"], *place, f"{speed:.3g}")
    out.print("\nbodies at the end")
    out.print(table)
    _tell_rest(out, count - MAX_ROWS, "body", "bodies")


def _show_robots(out: Console, engines: Sequence[Entry]) -> None:
    for k, robot in enumerate(engines[0]["robots"]):
        columns = [each["engine"] for each in engines]
        table = Table("coordinate", *columns, right=tuple(columns))
        states = [each["robots"][k] for each in engines]
        base = ["base x", "base y", "base z", "base qx", "base qy", "base qz", "base qw"]
        floating = len(robot["q"]) > len(robot["joints"])
        names = [*(base if floating else []), *robot["joints"]]
        for row, name in enumerate(names[:MAX_ROWS]):
            table.add_row(one_line(name), *(f"{state['q'][row]:.5f}" for state in states))
        out.print(f"\n{one_line(robot['name'])} at the end [m; rad]")
        out.print(table)
        _tell_rest(out, len(names) - MAX_ROWS, "coordinate", "coordinates")


def _show_contacts(out: Console, engines: Sequence[Entry]) -> None:
    pairs: dict[tuple[str, str], list[list[float]]] = defaultdict(lambda: [[] for _ in engines])
    for k, each in enumerate(engines):
        for contact in each["contacts"]:
            pairs[min(contact["a"], contact["b"]), max(contact["a"], contact["b"])][k].append(
                contact["normal_force"]
            )
    if not pairs:
        out.print("\nno contacts at the end")
        return
    columns = [f"{each['engine']} [N]" for each in engines]
    table = Table("between", *columns, right=tuple(columns))
    for (a, b), forces in sorted(pairs.items())[:MAX_ROWS]:
        cells = (f"{sum(each):.5g} at {counted(len(each), 'point')}" if each else "-" for each in forces)
        table.add_row(f"{one_line(a)}, {one_line(b)}", *cells)
    out.print("\ncontacts of the last step: normal force")
    out.print(table)
    _tell_rest(out, len(pairs) - MAX_ROWS, "pair", "pairs")


def _show_separations(out: Console, separations: Sequence[Entry]) -> None:
    if not separations:
        return
    distances = [parted["distance"] for parted in separations[0]["parted"]]
    headings = [f"> {1e3 * distance:g} mm" for distance in distances]
    table = Table(
        "engines",
        *headings,
        "first",
        "largest [m]",
        "end [m]",
        "of",
        right=(*headings, "largest [m]", "end [m]"),
    )
    for each in separations:
        times = (
            f"{parted['time']:.3g} s" if parted["time"] is not None else "never" for parted in each["parted"]
        )
        table.add_row(
            ", ".join(each["engines"]),
            *times,
            _first_apart(each, distances[0]),
            f"{max(each['distance']):.2e}",
            f"{each['distance'][-1]:.2e}",
            one_line(each["farthest"][int(np.argmax(each["distance"]))]),
        )
    out.print("\ndistance of the motions, the largest of all bodies and moving links, and when it exceeds")
    out.print(table)


def _first_apart(separation: Entry, distance: float) -> str:
    """Return the part that is farther apart than `distance` first; empty if none is."""
    beyond = np.array(separation["distance"]) > distance
    return one_line(separation["farthest"][int(np.argmax(beyond))]) if beyond.any() else ""


def _tell_rest(out: Console, rest: int, noun: str, plural: str) -> None:
    if rest > 0:
        out.print(f"... and {rest} more {noun if rest == 1 else plural} (--json has all)")
