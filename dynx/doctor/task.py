"""Examination of one robot that the user named, as a task of a worker process."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from dynx.doctor.diagnosis import compare_as_loaded, diagnose, refused_report
from dynx.doctor.report import DoctorReport
from dynx.errors import BackendError, DynxError
from dynx.loaded.registry import ENGINES, loader_class
from dynx.model.tree import Base
from dynx.rules.rule import Level


@dataclass(frozen=True)
class DoctorTask:
    """A robot and the options of its examination; None stands for the default of `dynx.diagnose`.

    `causes` selects `dynx.diagnose`; without it `dynx.compare_as_loaded` only measures the differences.
    """

    robot: str
    base: Base | None
    engines: tuple[str, ...] | None = None
    samples: int | None = None
    seed: int = 0
    tolerance: float | None = None
    choose: tuple[tuple[str, str], ...] = ()
    level: Level = "physics"
    ignore: tuple[str, ...] = ()
    only: tuple[str, ...] = ()
    causes: bool = True
    fix_tolerance: float | None = None


def examine(task: DoctorTask) -> DoctorReport:
    """Report on one robot, or the error where it cannot be used."""
    chosen: dict[str, Any] = {"base": task.base, "engines": task.engines, "seed": task.seed}
    if task.samples is not None:
        chosen["samples"] = task.samples
    if task.tolerance is not None:
        chosen["tolerance"] = task.tolerance
    try:
        if task.causes:
            report = diagnose(
                task.robot,
                choose=dict(task.choose),
                level=task.level,
                ignore=task.ignore,
                only=task.only,
                fix_tolerance=task.fix_tolerance,
                **chosen,
            )
        else:
            report = compare_as_loaded(task.robot, **chosen)
    except DynxError as error:
        return refused(task, error)
    return replace(report, robot=task.robot)


def refused(task: DoctorTask, error: DynxError) -> DoctorReport:
    """Report a robot that could not be examined."""
    return refused_report(task.robot, error, base=task.base or "fixed")


def check_engines(names: Sequence[str] | None) -> None:
    """Raise BackendError for a chosen engine that is unknown or not installed."""
    for name in names or ():
        loader_class(name)


def missing_engines(reports: Sequence[DoctorReport]) -> list[str]:
    """List the messages of the engines that are not installed, where any engine took part."""
    present = {each.engine for report in reports for each in report.engines}
    messages = []
    for name in ENGINES if present else ():
        if name not in present:
            try:
                loader_class(name)
            except BackendError as error:
                messages.append(str(error))
    return messages
