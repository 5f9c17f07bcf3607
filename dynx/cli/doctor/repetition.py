"""Command line that repeats the examination of one robot with every option that its result depends on."""

from __future__ import annotations

import shlex

from dynx.agreement.tolerances import BAR
from dynx.cli.shell.exits import short_line
from dynx.doctor.diagnosis import DEFAULT_SAMPLES
from dynx.doctor.task import DoctorTask

_MAX_PATH = 4096
"""Largest length of a path; anything longer is the text of a robot."""


def doctor_command(task: DoctorTask) -> str:
    """Return ``dynx doctor ROBOT`` with the options of a task that are not the defaults."""
    # A name that begins with a dash would be read as an option.
    robot = f"./{task.robot}" if task.robot.startswith("-") else task.robot
    words = [
        "dynx",
        "doctor",
        robot if robot.isprintable() and len(robot) <= _MAX_PATH else short_line(robot),
    ]
    if task.base != "fixed":
        words += ["--base", task.base]
    if task.engines is not None:
        words += ["--engines", ",".join(task.engines)]
    if task.samples not in (None, DEFAULT_SAMPLES):
        words += ["--samples", str(task.samples)]
    if task.seed:
        words += ["--seed", str(task.seed)]
    if task.tolerance not in (None, BAR):
        words += ["--tolerance", f"{task.tolerance!r}"]
    for rule, choice in task.choose:
        words += ["--choose", f"{rule}={choice}"]
    if task.level != "physics":
        words += ["--level", task.level]
    return shlex.join(words)
