"""Conclusion of `dynx doctor` after the examination: files, tables, errors, exit code."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence

from rich.console import Console

from dynx.cli.doctor.mending import write_mended
from dynx.cli.doctor.outputs import ReportFiles, save_counterexamples
from dynx.cli.doctor.overview import show_many, show_summary
from dynx.cli.doctor.repetition import doctor_command
from dynx.cli.doctor.tables import show_one
from dynx.cli.shell.exits import BAD_INPUT, DONE, NEGATIVE_RESULT, complain, one_line, short_line
from dynx.cli.shell.run import TaskRun
from dynx.cli.shell.terminal import command_line, console, counted
from dynx.doctor.formats.baseline import Baseline
from dynx.doctor.report import DoctorReport
from dynx.doctor.task import DoctorTask, missing_engines
from dynx.errors import DynxError

DoctorRun = TaskRun[DoctorTask, DoctorReport]

_MAX_DIFFERENCES = 6
"""Number of differences listed for each robot against a baseline."""


class Conclusion:
    """The reports of a run, and the paths of their files.

    `targets` has the file for the mended description of each input, or None where none is wanted. Where any
    is wanted, each input has one task. `folder` is for counterexamples, `engines` are those that the user
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
        """Check whether engines differ in a way that no baseline, read or just written, contains."""
        if self._baseline is not None:
            return not report.alike and bool(self._baseline.compare(report).new)
        return not report.alike and self._outputs.baseline is None

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
            return save_counterexamples(self._folder, report)
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
                self._show_comparison(out, report)

    def _show_comparison(self, out: Console, report: DoctorReport) -> None:
        assert self._baseline is not None
        found = self._baseline.compare(report)
        who = f"{short_line(report.robot)}, {report.base} base"
        if found.known or found.new or found.vanished:
            out.print(
                f"{who}: {len(found.known)} known, {len(found.new)} new, {len(found.vanished)} gone",
                style="bold red" if found.new else "bold",
            )
        for word, style, group in (("new", "red", found.new), ("gone", "green", found.vanished)):
            for each in group[:_MAX_DIFFERENCES]:
                out.print(f"  {word}: {each.place} ({', '.join(sorted(each.engines))})", style=style)
            if len(group) > _MAX_DIFFERENCES:
                out.print(f"  {word}: and {len(group) - _MAX_DIFFERENCES} more", style=style)


def refusal(report: DoctorReport) -> str:
    """Write the reason why a robot was refused, after its name where the message does not contain that."""
    assert report.error is not None
    message = report.error.message
    return message if report.robot in message else f"{short_line(report.robot)}: {message}"
