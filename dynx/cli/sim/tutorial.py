"""Run of ``dynx sim --tutorial``: every controller with progress, then its JSON document and its table, which
is made from the document alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypedDict

import numpy as np
from rich.console import Console

from dynx._version import __version__
from dynx.cli.shell.exits import (
    complain,
    exit_code,
    failure_of,
    interruptible,
    one_line,
)
from dynx.cli.shell.inputs import configuration
from dynx.cli.shell.output import Entry, counted, number, present, progress_bar
from dynx.cli.shell.tables import Table
from dynx.cli.sim.report import error_text
from dynx.cli.sim.request import limit_message
from dynx.errors import ArgumentError, LimitError
from dynx.model.loading import load
from dynx.sim.named_controllers import NATURAL_FREQUENCY
from dynx.sim.scenario.options import OPTIONS
from dynx.sim.tutorial import (
    DURATION,
    GRAVITY,
    MODES,
    ROBOT,
    Row,
    Tutorial,
    TutorialResult,
    plot_rows,
    tutorial,
)
from dynx.steppers.clock import Clock


class ModeOnPlant(TypedDict):
    """Tracking errors of one mode of control on one plant; null where it failed, for the reason `problem`."""

    max_error: float | None
    rms_error: float | None
    final_error: float | None
    joint_max_errors: list[float] | None
    steps: int
    problem: str | None


class ModeEntry(TypedDict):
    """One mode of control on each plant."""

    mode: str
    what: str
    plants: dict[str, ModeOnPlant]


TutorialEnds = TypedDict("TutorialEnds", {"from": list[float], "to": list[float]})


class TutorialDocument(TutorialEnds):
    """All modes of control on one motion; `not_done` are the modes that an interrupted run left out."""

    schema: int
    dynx: str
    robot: str
    source: str | None
    base: str
    gravity: list[float]
    joint_names: list[str]
    duration: float
    dt: float
    plants: list[str]
    backend: str
    kp: float
    kd: float
    modes: list[ModeEntry]
    not_done: list[str]


SCHEMA = 1


def run_tutorial(
    robot: str | None, given: dict[str, Any], picture: str | None, *, json_path: str | None
) -> int:
    """Simulate all controllers and show the results, also after Ctrl-C; return the exit code.

    `given` are the values of the command's options by parameter name.
    """
    experiments = _experiments(robot, given)
    rows: list[Row] = []
    with interruptible() as interruption:
        try:
            with progress_bar(len(MODES), words=MODES[0]) as advance:
                for row in experiments.rows():
                    rows.append(row)
                    advance(len(rows), MODES[min(len(rows), len(MODES) - 1)])
        except KeyboardInterrupt:
            complain(f"interrupted: {counted(len(MODES) - len(rows), 'controller')} not done")
        interruption.finishing = True
        made = document(experiments, rows)
        plot_error = None if picture is None else failure_of(plot_rows, rows, experiments, picture)
        errors = [plot_error, present(made, show, json_path)]
        failed = [
            f"{row.mode} on {plant}: {outcome.problem}"
            for row in rows
            for plant, outcome in row.outcomes.items()
            if outcome.failed
        ]
        for complaint in failed:
            complain(complaint)
        code = exit_code(*errors, negative=bool(failed))
    return code if interruption.code is None else interruption.code


def document(experiments: Tutorial, rows: Sequence[Row]) -> dict[str, Any]:
    """Make the JSON document of ``dynx sim --tutorial``."""
    model, motion = experiments.model, experiments.motion
    return {
        "schema": SCHEMA,
        "dynx": __version__,
        "robot": model.name,
        "source": model.source,
        "base": model.base,
        "gravity": list(model.gravity),
        "joint_names": list(model.joint_names),
        "from": motion.start.q.tolist(),
        "to": motion.end.q.tolist(),
        "duration": motion.duration,
        "dt": experiments.dt,
        "plants": list(experiments.plants),
        "backend": experiments.backend,
        "kp": NATURAL_FREQUENCY**2,
        "kd": 2.0 * NATURAL_FREQUENCY,
        "modes": [
            {
                "mode": row.mode,
                "what": row.what,
                "plants": {plant: _entry(outcome) for plant, outcome in row.outcomes.items()},
            }
            for row in rows
        ],
        "not_done": list(MODES[len(rows) :]),
    }


def _entry(outcome: TutorialResult) -> dict[str, Any]:
    rollout = outcome.rollout
    error = None if rollout is None or outcome.failed else np.abs(rollout.error)
    return {
        "max_error": outcome.max_error,
        "rms_error": outcome.rms_error,
        "final_error": None if error is None else float(error[-1].max()),
        "joint_max_errors": None if error is None else error.max(axis=0).tolist(),
        "steps": 0 if rollout is None else len(rollout),
        "problem": None if outcome.problem is None else one_line(outcome.problem),
    }


def _experiments(robot: str | None, given: dict[str, Any]) -> Tutorial:
    gravity = GRAVITY if given["gravity"] is None else given["gravity"]
    model = load(robot or ROBOT, lock=dict(given["lock"]), gravity=gravity)
    start = configuration(model, given["start"], "--from", model.clip(model.neutral()))
    to = None if given["to"] is None else configuration(model, given["to"], "--to", start)
    duration = DURATION if given["duration"] is None else given["duration"]
    dt = OPTIONS["dt"].default if given["dt"] is None else given["dt"]
    Clock.of(dt, duration, None, 0.0)
    try:
        return tutorial(model, start=start, to=to, duration=duration, dt=dt, backend=given["backend"])
    except LimitError as error:
        raise ArgumentError(limit_message(error, model.name, ignorable=False)) from error


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
