"""Table of the tutorial's controllers, made from their JSON document alone."""

from __future__ import annotations

from typing import Any

from rich.console import Console

from dynx.cli.shell.exits import one_line
from dynx.cli.shell.tables import Table
from dynx.cli.shell.terminal import counted, number
from dynx.cli.sim.tables import error_text

Entry = dict[str, Any]

_NAMES = {"pybullet": "PyBullet"}
"""Plants with a stepper of their own, by their title; all others use the stepper of dynx."""


def show(out: Console, report: Entry) -> None:
    """Print the motion, a line for each controller, and why some have no numbers."""
    out.print(
        f"{one_line(report['robot'])}, {report['base']} base: cycloidal motion of "
        f"{number(report['duration'])} s in steps of {number(report['dt'])} s, "
        f"gravity {' '.join(map(number, report['gravity']))} m/s^2",
        style="bold",
    )
    out.print(f"to {' '.join(number(q) for q in report['to'])}; controllers compute with {report['backend']}")
    gains = f"kp {number(report['kp'])} 1/s^2, kd {number(report['kd'])} 1/s"
    out.print(f"{gains}; times the inertia of the joint for gains in N m")
    plants: list[str] = report["plants"]
    heads = [f"{_NAMES.get(plant, 'dynx')}\n{what}" for plant in plants for what in ("max", "RMS")]
    table = Table("controller", *heads, "torque", right=heads, keys=1)
    for mode in report["modes"]:
        outcomes = [mode["plants"][plant] for plant in plants]
        errors = [outcome[key] for outcome in outcomes for key in ("max_error", "rms_error")]
        table.add_row(mode["mode"], *map(error_text, errors), mode["what"])
    out.print("\nlargest and RMS tracking error of all joints [rad or m]")
    out.print(table)
    steppers = ", ".join(
        "PyBullet: its own stepper" if plant in _NAMES else f"dynx: semi-implicit Euler over {plant}"
        for plant in plants
    )
    out.print(f"\n{steppers}")
    for (where, problem), modes in _problems(report).items():
        out.print(f"{', '.join(modes)} on {where}: {one_line(problem)}")
    if report["not_done"]:
        out.print(f"{counted(len(report['not_done']), 'controller')} not done", style="yellow")


def _problems(report: Entry) -> dict[tuple[str, str], list[str]]:
    """Return the controllers without numbers, by the plants and the reason."""
    found: dict[tuple[str, str], list[str]] = {}
    for mode in report["modes"]:
        of_mode: dict[str, list[str]] = {}
        for plant, outcome in mode["plants"].items():
            if outcome["problem"] is not None:
                of_mode.setdefault(outcome["problem"], []).append(_NAMES.get(plant, "dynx"))
        for problem, where in of_mode.items():
            found.setdefault((" and ".join(where), problem), []).append(mode["mode"])
    return found
