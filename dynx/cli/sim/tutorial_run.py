"""Run of ``dynx sim --tutorial``: every controller with progress, then document and table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from dynx._version import __version__
from dynx.cli.shell.exits import BAD_INPUT, DONE, NEGATIVE_RESULT, complain, failure_of, one_line
from dynx.cli.shell.inputs import configuration
from dynx.cli.shell.interruption import interruptible
from dynx.cli.shell.progress import progress_bar
from dynx.cli.shell.terminal import counted, present
from dynx.cli.sim.motion import limit_message
from dynx.cli.sim.tutorial_tables import show
from dynx.errors import ArgumentError, LimitError
from dynx.model.loading import load
from dynx.sim.named_controllers import NATURAL_FREQUENCY
from dynx.sim.scenario.options import OPTIONS
from dynx.sim.tutorial import DURATION, GRAVITY, MODES, ROBOT, Outcome, Row, Tutorial, tutorial
from dynx.sim.tutorial_plot import plot_rows
from dynx.steppers.clock import Clock

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
        for complaint in [*failed, *(str(error) for error in errors if error is not None)]:
            complain(complaint)
    if interruption.code is not None:
        return interruption.code
    if any(error is not None for error in errors):
        return BAD_INPUT
    return NEGATIVE_RESULT if failed else DONE


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


def _entry(outcome: Outcome) -> dict[str, Any]:
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
