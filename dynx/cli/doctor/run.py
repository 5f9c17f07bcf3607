"""Run of ``dynx doctor``: the examination of each robot in a worker process, then its conclusion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

from dynx.cli.doctor.conclusion import Conclusion, DoctorRun
from dynx.cli.doctor.mending import planned_targets
from dynx.cli.doctor.outputs import ReportFiles
from dynx.cli.shell.run import TaskRun, carry_out
from dynx.doctor.formats.baseline import load_baseline
from dynx.doctor.report import DoctorReport
from dynx.doctor.task import DoctorTask, check_engines, examine, refused
from dynx.errors import DynxError
from dynx.model.expansion import expand, refusals
from dynx.model.tree import Base
from dynx.rules.registry import checked_choices
from dynx.rules.rule import Level


def doctor(
    robots: tuple[str, ...],
    base: Literal["fixed", "floating", "both"],
    engines: tuple[str, ...] | None,
    samples: int | None,
    seed: int,
    tolerance: float,
    choose: tuple[tuple[str, str], ...],
    fix: str | None,
    level: Level,
    in_place: bool,
    json_path: str | None,
    html: str | None,
    junit: str | None,
    sarif: str | None,
    github: bool,
    baseline_path: str | None,
    write_baseline: str | None,
    counterexamples: str,
    jobs: int | None,
    timeout: float,
    quiet: bool,
) -> int:
    """Examine each robot; return the exit code."""
    outputs = ReportFiles(json_path, html, junit, sarif, write_baseline, github)
    outputs.check()
    choices = tuple(checked_choices(choose).items())
    check_engines(engines)
    baseline = None if baseline_path is None else load_baseline(baseline_path)
    found = expand(robots)
    inputs = found.robots
    bases: tuple[Base, ...] = ("fixed", "floating") if base == "both" else (base,)
    targets = planned_targets(inputs, fix, in_place=in_place, bases=len(bases))
    outputs.keep_apart((each.robot for each in inputs), () if in_place else targets, baseline_path)
    examined = [(each, one) for each in inputs for one in bases]
    run = doctor_run(
        [
            DoctorTask(each.robot, one, engines, samples, seed, tolerance, choices, level)
            for each, one in examined
        ],
        refusals=refusals([each for each, _ in examined]),
        left_out=found.left_out,
    )
    conclusion = Conclusion(run, outputs, baseline, targets, in_place, counterexamples, engines)
    return carry_out(run, jobs, timeout, quiet, lambda: conclusion.reach(quiet=quiet))


def doctor_run(
    tasks: Sequence[DoctorTask],
    target: Callable[[DoctorTask], DoctorReport] = examine,
    refusals: dict[int, DynxError] | None = None,
    left_out: Sequence[str] = (),
) -> DoctorRun:
    """Prepare the run of ``dynx doctor`` or of ``dynx agree --as-loaded``."""
    return TaskRun(tasks, target, refused, _problem, _verdict, "examining", refusals, left_out)


def _verdict(report: DoctorReport) -> str:
    return report.verdict


def _problem(report: DoctorReport) -> str | None:
    if report.error is not None:
        return "refused"
    return None if report.alike else "differ"
