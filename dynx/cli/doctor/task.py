"""What a worker process does for `dynx doctor`: one robot and base in, one report out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from dynx.cli.shell.run import Run, error_of
from dynx.errors import DynxError
from dynx.workers import Failure

if TYPE_CHECKING:
    from collections.abc import Callable

    from dynx.doctor.report import DoctorReport
    from dynx.model.model import Base


@dataclass(frozen=True)
class DoctorTask:
    """A robot, and how it is to be examined; options that are None are left to `dynx.diagnose`.

    `causes` says whether causes are looked for, or only what differs (``agree --as-loaded``).
    """

    robot: str
    base: Base
    engines: tuple[str, ...] | None = None
    samples: int | None = None
    seed: int = 0
    tolerance: float | None = None
    choose: tuple[tuple[str, str], ...] = ()
    causes: bool = True


def examine(task: DoctorTask) -> DoctorReport:
    """The report of one robot; one that cannot be used gives a report with its error."""
    from dynx.doctor import compare_as_loaded, diagnose

    chosen: dict[str, Any] = {"base": task.base, "engines": task.engines, "seed": task.seed}
    if task.samples is not None:
        chosen["samples"] = task.samples
    if task.tolerance is not None:
        chosen["tolerance"] = task.tolerance
    try:
        if task.causes:
            report = diagnose(task.robot, choose=dict(task.choose), **chosen)
        else:
            report = compare_as_loaded(task.robot, **chosen)
    except DynxError as error:
        return refused(task, error)
    return replace(report, robot=task.robot)


def refused(task: DoctorTask, error: DynxError) -> DoctorReport:
    """The report of a robot that could not be examined."""
    from dynx.doctor.diagnosis import refused_report

    return refused_report(task.robot, error, base=task.base)


def doctor_run(
    tasks: Sequence[DoctorTask], target: Callable[[DoctorTask], DoctorReport] = examine
) -> Run[DoctorTask, DoctorReport]:
    """The run of ``dynx doctor`` and of ``dynx agree --as-loaded``."""
    return Run(tasks, target, _failed, _progress)


def check_engines(names: tuple[str, ...] | None) -> None:
    """Raise for an engine asked for that is unknown or not installed: once, not for every robot."""
    from dynx.loaded.registry import loader_class

    for name in names or ():
        loader_class(name)


def missing_engines(reports: Sequence[DoctorReport]) -> list[str]:
    """For every engine that took no part though any could: the line that says how to install it."""
    from dynx.errors import BackendError
    from dynx.loaded.registry import ENGINES, loader_class

    present = {each.engine for report in reports for each in report.engines}
    said = []
    for name in ENGINES if present else ():
        if name not in present:
            try:
                loader_class(name)
            except BackendError as error:
                said.append(str(error))
    return said


def _failed(task: DoctorTask, failure: Failure) -> DoctorReport:
    return refused(task, error_of(failure))


def _progress(reports: Sequence[DoctorReport]) -> str:
    differ = sum(report.error is None and not report.alike for report in reports)
    refused = sum(report.error is not None for report in reports)
    said = [f"{differ} differ"] if differ else []
    return ", ".join([*said, *([f"{refused} refused"] if refused else [])]) or "examining"
