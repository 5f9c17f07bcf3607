"""Tables of `dynx doctor` for several robots: one line each, then the number of robots with each verdict."""

from __future__ import annotations

from collections.abc import Sequence
from typing import get_args

from rich.console import Console
from rich.text import Text

from dynx.cli.doctor.tables import error_text, level_clause
from dynx.cli.doctor.text import STYLES
from dynx.cli.shell.exits import short_line
from dynx.cli.shell.tables import Table
from dynx.cli.shell.terminal import counted, summary_line
from dynx.doctor.formats import wording
from dynx.doctor.formats.causes import causes, severity
from dynx.doctor.formats.vote import largest_error
from dynx.doctor.report import DoctorReport, Status

_CAPTION = (
    "largest relative error of any engine, as loaded (refused: an engine refuses it;",
    "not used: an engine would crash on it, or its results mean nothing),",
    "and the error that remains when mended{level}",
)

_MAX_RULES = 3
"""Number of rules listed for one of several robots."""


def show_many(out: Console, reports: Sequence[DoctorReport]) -> None:
    """Print one line for each robot and base."""
    bases = len({report.base for report in reports}) > 1
    columns = ["robot", *(["base"] if bases else []), "verdict", "error", "mended", "causes"]
    table = Table(*columns, right=["error", "mended"], keys=1)
    for report in reports:
        table.add_row(
            short_line(report.robot),
            *([report.base or ""] if bases else []),
            _verdict_text(report),
            _largest(report),
            _remaining(report),
            _rules(report),
        )
    levels = "".join(sorted({level_clause(report) for report in reports}))
    for line in _CAPTION:
        out.print(line.format(level=levels), style="bold")
    out.print(table)
    _count_variants(out, reports)
    unread = sum(bool(report.unread_meshes) for report in reports)
    if unread:
        share = f"{unread} of {counted(len(reports), 'robot')}"
        checked = f"their links are not checked against the size of shapes ({wording.SHAPE_RULES})"
        refusing = dict.fromkeys(name for report in reports for name in report.refused_without_meshes)
        without = wording.refused_without_mesh([*refusing])
        out.print(f"meshes could not be read: {share}; {checked}{without}", style="yellow")
    out.print()


def _count_variants(out: Console, reports: Sequence[DoctorReport]) -> None:
    """Print for each variant the number of robots that it loads otherwise."""
    off = [each for report in reports for each in report.variants_off]
    for name in dict.fromkeys(each.engine for each in off):
        mine = [each for each in off if each.engine == name]
        rules = ", ".join(sorted({finding.rule for each in mine for finding in each.findings}))
        share = f"{len(mine)} of {counted(len(reports), 'robot')}"
        out.print(f"{name}: {share} loaded otherwise by this call{f' ({rules})' if rules else ''}")


def show_summary(out: Console, reports: Sequence[DoctorReport], seconds: float, not_done: int) -> None:
    """Print the last line: the number of robots with each verdict, and of those not done."""
    verdicts = [report.status for report in reports]
    counts = {word: verdicts.count(word) for word in get_args(Status)}
    if not counts["massless"]:
        del counts["massless"]
    bases = len({report.base for report in reports}) > 1
    what = counted(len(reports), "examination" if bases else "robot")
    out.print(summary_line(what, counts, not_done, seconds))


def _largest(report: DoctorReport) -> Text:
    if report.error is not None:
        return Text("")
    without = [each for each in report.engines if each.no_results is not None]
    if without:
        word = "not used" if all(each.refused is None for each in without) else "refused"
        return Text(word, STYLES["error"])
    return error_text(largest_error(report), report.tolerance)


def _remaining(report: DoctorReport) -> Text:
    """Write the error after mending."""
    if report.error is not None:
        return Text("")
    without = [each for each in report.engines if each.no_results_after is not None]
    if without:
        word = "not used" if all(each.refused_after is None for each in without) else "refused"
        return Text(word, STYLES["error"])
    return error_text(report.remaining, report.tolerance)


def _rules(report: DoctorReport) -> Text:
    found = [cause for cause in causes(report) if cause.largest_effect is not None]
    parts = [Text(wording.name(cause.rule), STYLES[cause.severity]) for cause in found[:_MAX_RULES]]
    if len(found) > _MAX_RULES:
        parts.append(Text(f"+{len(found) - _MAX_RULES}"))
    return Text(" ").join(parts)


def _verdict_text(report: DoctorReport) -> Text:
    word = report.status
    if word == "refused":  # the reason is on standard error
        return Text("refused", "yellow")
    if word == "alike":
        return Text("alike, parts skipped", "yellow") if report.skipped else Text("alike", "green")
    if word == "unexplained":
        return Text("UNEXPLAINED", "bold red")
    if word == "massless":
        return Text("no inertial data", "yellow")
    alarming = any(severity(finding) == "error" for finding in report.differences)
    return Text("explained", "" if alarming else "dim")
