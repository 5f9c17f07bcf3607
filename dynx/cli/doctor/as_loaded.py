"""Run of ``dynx agree --as-loaded``: files as each engine loads them, without a search for causes."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich.console import Console
from rich.text import Text

from dynx.cli.doctor.files import ReportFiles
from dynx.cli.doctor.run import DoctorRun, doctor_command, doctor_run, refusal
from dynx.cli.doctor.tables import error_text, heading, sentence, show_engines, show_errors
from dynx.cli.shell.exits import BAD_INPUT, DONE, NEGATIVE_RESULT, complain, one_line, short_line
from dynx.cli.shell.output import console, counted, summary_line
from dynx.cli.shell.run import carry_out
from dynx.cli.shell.tables import Table
from dynx.doctor.formats import wording
from dynx.doctor.formats.causes import Vote, largest_error, largest_quantity_error, vote
from dynx.doctor.report import DoctorReport, EngineResult
from dynx.doctor.task import DoctorTask, check_engines, missing_engines
from dynx.model.expansion import expand, refusals
from dynx.model.tree import Base


def compare(
    robots: Sequence[str],
    base: Base,
    engines: tuple[str, ...] | None,
    samples: int | None,
    seed: int,
    *,
    jobs: int | None,
    timeout: float,
    json_path: str | None,
    quiet: bool,
) -> int:
    """Compare the engines on each robot, and print or write the result.

    Returns 0 if all engines load every robot alike, 1 if any differ, 2 if a robot cannot be read or a report
    cannot be written, and 130 or 143 after an interruption (`dynx.cli.shell.exits`). Raises ArgumentError for
    an output path and the errors of `check_engines`.
    """
    outputs = ReportFiles(json=json_path)
    outputs.check()
    check_engines(engines)
    found = expand(robots)
    inputs = found.robots
    outputs.keep_apart((each.robot for each in inputs), (), None)
    tasks = [DoctorTask(each.robot, base, engines, samples, seed, causes=False) for each in inputs]
    run = doctor_run(tasks, refusals=refusals(inputs), left_out=found.left_out)
    return carry_out(run, jobs, timeout, quiet, lambda: _conclude(run, outputs, engines, quiet))


def _conclude(run: DoctorRun, outputs: ReportFiles, engines: tuple[str, ...] | None, quiet: bool) -> int:
    reports = run.results
    errors = outputs.write(reports, run.not_done, run.left_out)
    outputs.echo(reports, run.not_done, run.left_out)
    if not quiet:
        out = console(err=outputs.on_stdout)
        if len(run.tasks) == 1:
            for report in reports:
                _show_one(out, report, run.tasks[0])
        else:
            _show_many(out, reports, run.seconds, len(run.not_done))
        for line in missing_engines(reports) if engines is None else ():
            out.print(f"note: {one_line(line)}", style="yellow")
    for report in reports:
        if report.error is not None:
            complain(refusal(report))
    for error in errors:
        complain(str(error))
    if errors or any(report.error is not None for report in reports):
        return BAD_INPUT
    return DONE if all(report.alike for report in reports) else NEGATIVE_RESULT


def _show_one(out: Console, report: DoctorReport, task: DoctorTask) -> None:
    who = f"{short_line(report.robot)}, {report.base} base"
    if report.error is not None:
        out.print(f"{who}: not examined", style="yellow")
        return
    words = "all engines load it alike" if report.alike else "engines DIFFER on this file"
    if report.refusal is not None:
        words = f"dynx refuses it ({one_line(report.refusal.message)})"
    out.print(f"{who}: {words}", style="bold green" if report.alike else "bold red")
    if report.source is not None:
        out.print(f"({short_line(report.source)})", style="dim")
    show_engines(out, report)
    show_errors(out, report, mended=False)
    _show_pairs(out, report)
    found = vote(report)
    heading(out, "vote")
    for line in vote_lines(report, found):
        sentence(out, line, 2)
    if not report.alike:
        out.print()
        out.print(f"causes, and a mended file: {doctor_command(task)}", style="bold")


def _show_pairs(out: Console, report: DoctorReport) -> None:
    """Print the difference of each pair of engines."""
    pairs = list(dict.fromkeys(pair.engines for pair in report.pairs))
    if not pairs:
        return
    heading(out, "relative difference between two engines, as loaded")
    heads = ["\n~".join(pair) for pair in pairs]
    table = Table("quantity", *heads, right=heads, keys=1)
    by_cell = {(pair.quantity, pair.engines): pair.relative_error for pair in report.pairs}
    for quantity in dict.fromkeys(pair.quantity for pair in report.pairs):
        cells = [by_cell.get((quantity, pair)) for pair in pairs]
        table.add_row(
            wording.quantity(quantity),
            *("" if error is None else error_text(error, report.tolerance) for error in cells),
        )
    out.print(table)


def _show_many(out: Console, reports: Sequence[DoctorReport], seconds: float, not_done: int) -> None:
    engines = list(dict.fromkeys(each.engine for report in reports for each in report.engines))
    table = Table("robot", *engines, "alone", "verdict", right=engines, keys=1)
    for report in reports:
        results = {each.engine: each for each in report.engines}
        cells: list[str | Text] = []
        for engine in engines:
            result = results.get(engine)
            far = None if result is None else largest_quantity_error(result)
            if result is not None and result.no_results is not None:
                cells.append("not used" if result.refused is None else "refuses")
            else:
                cells.append("" if far is None else error_text(far[1], report.tolerance))
        found = vote(report)
        every = len(found.alone) == len(found.groups) > 2
        alone = "each" if every else ", ".join(found.alone)
        words = "alike" if report.alike else "DIFFER"
        table.add_row(short_line(report.robot), *cells, alone, words if report.error is None else "refused")
    out.print("largest relative error of each engine as it loads the file", style="bold")
    out.print(table)
    refusals = sum(report.error is not None for report in reports)
    same = sum(report.alike for report in reports)
    counts = {"alike": same, "differ": len(reports) - same - refusals, "refused": refusals}
    out.print()
    out.print(summary_line(counted(len(reports), "robot"), counts, not_done, seconds))


def vote_lines(report: DoctorReport, found: Vote) -> list[str]:
    """Write the vote as sentences: which engines agree, which stand alone, and which match the file."""
    if not found.groups:
        return ["no engine has results on the file"]
    lines = [f"{_and(group)} agree with each other" for group in found.groups if len(group) > 1]
    if len(found.alone) == len(found.groups) > 1:
        lines.append("no two engines agree")
    else:
        lines += [f"{engine} stands alone" for engine in found.alone]
    without = [each for each in report.engines if each.engine in found.refused]
    lines += [f"{each.engine} {_absence(each)}" for each in without]
    wrong = [
        each.engine for each in report.engines if each.no_results is None and each.engine not in found.right
    ]
    if found.right:
        verb = "matches" if len(found.right) == 1 else "match"
        lines.append(f"{_and(found.right)} {verb} the reference values of the file")
    for engine in report.engines:
        far = largest_quantity_error(engine)
        if engine.engine in wrong and far is not None:
            quantity, error = far
            missing = f"returns no valid {wording.quantity(quantity)}"
            off = f"is off by up to {wording.size(error)} ({wording.quantity(quantity)})"
            lines.append(f"{engine.engine} {off if math.isfinite(error) else missing}")
    if largest_error(report) <= report.tolerance:
        lines.append(f"no engine that loads the file is off by more than {report.tolerance:g}")
    for variant in report.variants_off:
        lines += [f"another common call, {variant.engine}: {line}" for line in wording.variant(variant)]
    return lines


def _absence(each: EngineResult) -> str:
    return "is not used on the file" if each.refused is None else "does not load the file"


def _and(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
