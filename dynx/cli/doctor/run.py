"""Run of ``dynx doctor``: each robot is examined in a worker process, then come files, tables and errors."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Mapping, Sequence
from typing import Literal

from rich.console import Console

from dynx.agreement.tolerances import BAR
from dynx.cli.doctor.files import ReportFiles, planned_targets, save_counterexamples, write_mended
from dynx.cli.doctor.tables import show_many, show_one, show_summary
from dynx.cli.shell.exits import BAD_INPUT, DONE, NEGATIVE_RESULT, complain, one_line, short_line
from dynx.cli.shell.output import command_line, console, counted
from dynx.cli.shell.reports import show_comparison
from dynx.cli.shell.run import TaskRun, carry_out
from dynx.doctor.diagnosis import DEFAULT_SAMPLES
from dynx.doctor.formats.baseline import Baseline, accepted_by
from dynx.doctor.report import DoctorReport
from dynx.doctor.task import DoctorTask, check_engines, examine, missing_engines, refused
from dynx.errors import DynxError
from dynx.model.expansion import expand, refusals
from dynx.model.tree import Base
from dynx.rules.registry import checked_choices, ignored_rules
from dynx.rules.rule import Level


def doctor(
    robots: tuple[str, ...],
    base: Literal["fixed", "floating", "both"] | None,
    engines: tuple[str, ...] | None,
    samples: int | None,
    seed: int,
    tolerance: float | None,
    choose: tuple[tuple[str, str], ...],
    fix: str | None,
    level: Level,
    ignore: tuple[str, ...],
    only: tuple[str, ...],
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
    ignored_rules(ignore, only)  # Checked once, so that an error is not reported for every robot.
    check_engines(engines)
    baseline = None if baseline_path is None else Baseline.load(baseline_path)
    found = expand(robots)
    inputs = found.robots
    bases: tuple[Base | None, ...] = ("fixed", "floating") if base == "both" else (base,)
    targets = planned_targets(inputs, fix, in_place=in_place, bases=bases)
    outputs.keep_apart((each.robot for each in inputs), () if in_place else targets, baseline_path)
    examined = [(each, one) for each in inputs for one in bases]
    run = doctor_run(
        [
            DoctorTask(
                each.robot,
                one,
                engines,
                samples,
                seed,
                tolerance,
                choices,
                level,
                ignore,
                only,
                fix_tolerance=(tolerance or FIX_TOLERANCE) if fix or in_place else None,
            )
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


FIX_TOLERANCE = 1e-9
"""Largest effect that a mended file keeps by default: nobody merges changes of digits for less."""

DoctorRun = TaskRun[DoctorTask, DoctorReport]


class Conclusion:
    """The reports of a run, and the paths of their files.

    `targets` has the file for the mended description of each task, or None where none is wanted. `folder` is
    for counterexamples, `engines` are those that the user
    chose.
    """

    def __init__(
        self,
        run: DoctorRun,
        outputs: ReportFiles,
        baseline: Baseline | None,
        targets: Sequence[str | None],
        in_place: bool,
        folder: str,
        engines: Sequence[str] | None,
    ) -> None:
        self._run = run
        self._outputs = outputs
        self._baseline = baseline
        self._targets = targets
        self._in_place = in_place
        self._folder = folder
        self._engines = engines
        self._problems: list[str] = []
        self._replaced: list[str] = []
        self._counterexamples: set[str] = set()

    def reach(self, *, quiet: bool) -> int:
        """Write and show everything; return the exit code."""
        reports = self._run.results
        # Files are written first, so that they are not lost if a pipe closes while a table is written.
        errors = self._outputs.write(
            reports, self._run.not_done, self._run.left_out, self._baseline, command_line()
        )
        self._problems += map(str, errors)
        mended = self._mend()
        saved = [self._save_counterexamples(report) for report in reports]
        self._outputs.echo(reports, self._run.not_done, self._run.left_out, self._baseline)
        if not quiet:
            self._show(console(err=self._outputs.on_stdout), saved, mended)
        refusals = [refusal(report) for report in reports if report.error is not None]
        for problem in dict.fromkeys([*refusals, *self._problems]):
            complain(problem)
        if self._problems or any(report.error is not None for report in reports):
            return BAD_INPUT
        return NEGATIVE_RESULT if any(self._fails(report) for report in reports) else DONE

    def _fails(self, report: DoctorReport) -> bool:
        """Check whether engines differ in a way that neither a baseline nor the ignored rules accept."""
        accepted = accepted_by(report, self._baseline)
        if accepted is not None and not accepted.compare(report).new:
            return False
        return not report.alike and (self._baseline is not None or self._outputs.baseline is None)

    def _mend(self) -> Mapping[int, str]:
        """Write the mended descriptions; return their files by the number of the result."""
        written: dict[int, str] = {}
        done = {task: number for number, task in enumerate(self._run.done)}
        for index, path in enumerate(self._targets):
            if path is None or index not in done:
                continue
            report = self._run.results[done[index]]
            replaced = os.path.lexists(path) and not self._in_place
            try:
                if write_mended(path, report, over_input=self._in_place):
                    written[done[index]] = path
                    self._replaced += [path] if replaced else []
            except DynxError as error:
                self._problems.append(str(error))
        return written

    def _save_counterexamples(self, report: DoctorReport) -> Mapping[int, str]:
        try:
            return save_counterexamples(self._folder, report, self._counterexamples)
        except DynxError as error:
            self._problems.append(str(error))
            return {}

    def _show(self, out: Console, saved: Sequence[Mapping[int, str]], mended: Mapping[int, str]) -> None:
        reports = self._run.results
        if len(self._run.tasks) <= 2 and len({task.robot for task in self._run.tasks}) == 1:
            for number, report in enumerate(reports):
                if number:
                    out.print()
                again = doctor_command(self._run.tasks[self._run.done[number]])
                show_one(out, report, saved[number], mended.get(number), again)
            for path in self._replaced:
                out.print(f"replaced the file {one_line(path)} that was there", style="yellow")
        else:
            show_many(out, reports)
            show_summary(out, reports, self._run.seconds, len(self._run.not_done))
            for files in saved:
                for file in dict.fromkeys(files.values()):
                    out.print(f"counterexample: {one_line(file)}")
            if mended:
                same = sum(reports[number].mended is None for number in mended)
                copies = f", {same} of them unchanged" if same else ""
                old = f"; {len(self._replaced)} of that name replaced" if self._replaced else ""
                out.print(f"{counted(len(mended), 'file')} written{copies}{old}", style="bold green")
        if self._engines is None:
            for line in missing_engines(reports):
                out.print(f"note: {one_line(line)}", style="yellow")
        if self._baseline is not None:
            for report in reports:
                who = f"{short_line(report.robot)}, {report.base} base"
                show_comparison(out, who, self._baseline.compare(report))


def refusal(report: DoctorReport) -> str:
    """Write the reason why a robot was refused, after its name where the message does not contain that."""
    assert report.error is not None
    message = report.error.message
    return message if report.robot in message else f"{short_line(report.robot)}: {message}"


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
    if task.base not in (None, "fixed"):
        words += ["--base", task.base]
    if task.engines is not None:
        words += ["--engine", ",".join(task.engines)]
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
    for option, rules in (("--ignore", task.ignore), ("--only", task.only)):
        words += [option, ",".join(rules)] if rules else []
    return shlex.join(words)
