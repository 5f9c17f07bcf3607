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


def show(out: Console, made: Entry) -> None:
    """Print the motion, a line for each controller, and why some have no numbers."""
    out.print(
        f"{one_line(made['robot'])}, {made['base']} base: cycloidal motion of {number(made['duration'])} s "
        f"in steps of {number(made['dt'])} s, gravity {' '.join(number(g) for g in made['gravity'])} m/s^2",
        style="bold",
    )
    out.print(f"to {' '.join(number(q) for q in made['to'])}; controllers compute with {made['backend']}")
    gains = f"kp {number(made['kp'])} 1/s^2, kd {number(made['kd'])} 1/s"
    out.print(f"{gains}; times the inertia of the joint for gains in N m")
    plants: list[str] = made["plants"]
    heads = [f"{_NAMES.get(plant, 'dynx')}\n{what}" for plant in plants for what in ("max", "RMS")]
    table = Table("controller", *heads, "torque", right=heads, keys=1)
    for mode in made["modes"]:
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
    for (where, problem), modes in _problems(made).items():
        out.print(f"{', '.join(modes)} on {where}: {one_line(problem)}")
    if made["not_done"]:
        out.print(f"{counted(len(made['not_done']), 'controller')} not done", style="yellow")


def _problems(made: Entry) -> dict[tuple[str, str], list[str]]:
    """Controllers without numbers, by the plants and the reason."""
    found: dict[tuple[str, str], list[str]] = {}
    for mode in made["modes"]:
        of_mode: dict[str, list[str]] = {}
        for plant, outcome in mode["plants"].items():
            if outcome["problem"] is not None:
                of_mode.setdefault(outcome["problem"], []).append(_NAMES.get(plant, "dynx"))
        for problem, where in of_mode.items():
            found.setdefault((" and ".join(where), problem), []).append(mode["mode"])
    return found
