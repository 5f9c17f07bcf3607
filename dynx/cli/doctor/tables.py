"""Reports of ``dynx doctor`` on a terminal: one robot in full, several with a line each."""

from __future__ import annotations

import shlex
import textwrap
from collections.abc import Mapping, Sequence
from io import StringIO
from pathlib import PurePath
from typing import get_args

from rich.console import Console
from rich.text import Text

from dynx.cli.shell.exits import one_line, short_line
from dynx.cli.shell.output import counted, summary_line
from dynx.cli.shell.tables import Table
from dynx.doctor.formats import wording
from dynx.doctor.formats.causes import (
    ROUNDING,
    RuleFindings,
    catalogue_entry,
    causes,
    largest_error,
    severity,
)
from dynx.doctor.report import DoctorReport, EngineResult, Finding, Status
from dynx.loaded.difference import Deviation
from dynx.rules import CallingRule

_PLACES = (4, 3, 2, 1)
"""Numbers of places listed for one rule; ``--json`` and ``--html`` have all."""

SCREEN = 40, 100
"""Rows and columns of a terminal: the largest of `_PLACES` is taken with which a report fits it."""


def show_one(
    out: Console, report: DoctorReport, saved: Mapping[int, str], mended: str | None, command: str
) -> None:
    """Print the full report of one robot.

    `saved` has the file with the counterexample of each unexplained difference, by its number, and
    `mended` is the file with the mended description; `command` repeats the examination.
    """
    fitting = (count for count in _PLACES if _rows(report, saved, mended, command, count) <= SCREEN[0])
    _show(out, report, saved, mended, command, next(fitting, 2))


def _rows(
    report: DoctorReport, saved: Mapping[int, str], mended: str | None, command: str, places: int
) -> int:
    """Return the number of rows of a report on a terminal."""
    text = StringIO()
    out = Console(file=text, width=SCREEN[1], soft_wrap=True, markup=False, emoji=False, highlight=False)
    _show(out, report, saved, mended, command, places)
    return sum(max(1, -(-len(line) // SCREEN[1])) for line in text.getvalue().splitlines())


def _show(
    out: Console,
    report: DoctorReport,
    saved: Mapping[int, str],
    mended: str | None,
    command: str,
    places: int,
) -> None:
    show_verdict(out, report)
    if report.error is not None:
        left = [f"line {each.line}: {each.rule} {each.message}" for each in report.findings]
        _show_list(out, "left undone", left)
        return
    show_engines(out, report)
    show_errors(out, report)
    show_variants(out, report)
    _show_findings(out, [each for each in causes(report) if each.rule not in report.ignored], places)
    show_model_difference(out, report)
    if report.ignored:
        out.print()
        show_ignored(out, report)
    if report.unread_meshes:
        out.print()
        sentence(out, f"not examined: {wording.unread_meshes(report)}", 0, "yellow")
    _show_list(out, "decided", report.choices)
    _show_changes(out, report)
    _show_calls(out, report)
    _show_unexplained(out, report, saved)
    _show_next(out, report, mended, command)


def show_verdict(out: Console, report: DoctorReport) -> None:
    """Print the first line: robot, base and verdict, then the file."""
    if report.error is not None:  # its message is on standard error
        out.print(f"{short_line(report.robot)}, {report.base} base: not examined", style="yellow")
        return
    style = "bold" if report.explained else "bold red"
    if report.alike:
        style = "bold yellow" if report.skipped else "bold green"
    out.print(f"{short_line(report.robot)}, {report.base} base: {one_line(report.verdict)}", style=style)
    mass = "" if report.total_mass is None else f"total mass {report.total_mass:.4g} kg"
    where = "" if report.source is None else short_line(report.source)
    expanded = "lines are those of the URDF that it expands to" if where.endswith(".xacro") else ""
    out.print(f"({'; '.join(filter(None, (where, expanded, mass)))})", style="dim")


def show_engines(out: Console, report: DoctorReport) -> None:
    """Print each engine with its version and the call that loads the file."""
    heading(out, "each engine loads the file with the call of its documentation")
    for each in report.engines:
        call = "; ".join(wording.name(line, 500) for line in each.call.splitlines())
        out.print(Text.assemble((f"  {each.engine} {one_line(each.version)}: ", "bold"), (call, "dim")))
        if each.no_results is not None:
            sentence(out, wording.refusal(each), 6, "red")
            if report.mended is not None and each.no_results_after is None:
                sentence(out, wording.loads_mended(each, report), 6, "green")
            elif report.mended is not None:
                same = each.no_results_after == each.no_results
                after = wording.refusal(each, mended=True)
                sentence(out, after.partition(":")[0] if same else after, 6, "red")
        if each.step_defaults:
            sentence(out, wording.step_defaults(each), 6, "dim")
        for code in each.step_defaults.values():
            out.print(Text(f"      {code}", "dim"))


def show_errors(out: Console, report: DoctorReport, *, mended: bool = True) -> None:
    """Print the error of each engine by quantity, before mending and, with `mended`, after."""
    compared = [each for each in report.engines if each.before or each.after]
    rows = list(dict.fromkeys(key for each in compared for key in (*each.before, *each.after)))
    if not rows:
        return
    title, then = "error against the reference values", _then(report) if mended else ""
    heading(out, f"{title}: as loaded -> {then}" if then else f"{title}, as loaded")
    names = [each.engine for each in compared]
    table = Table("quantity", *names, right=names, keys=1)
    for key in rows:
        table.add_row(
            wording.quantity(key), *(_change(each, key, report.tolerance, bool(then)) for each in compared)
        )
    out.print(table)
    if "inverse_dynamics" in rows and "forward_dynamics" not in rows:
        sentence(out, "forward dynamics is not compared: the mass matrix is singular", 1, "dim")
    known = f", reference values accurate to {report.referee:.0e}" if report.referee else ""
    out.print(
        f" tolerance {report.tolerance:.3g}, {counted(report.samples, 'sample')}, seed {report.seed}{known}",
        style="dim",
    )
    left = [error for each in compared for error in each.after.values()] if then else []
    if any(report.tolerance < error <= ROUNDING for error in left):
        limit = f"{ROUNDING:.0e}"
        kept = f"the mended file keeps errors of up to {limit} (shortened numbers, causes of less effect)"
        sentence(out, f"{kept}: check it with --tolerance {limit}", 1, "dim")


def show_model_difference(out: Console, report: DoctorReport) -> None:
    """Print in which parts the models of the engines differ from a file in MJCF or SDF, with a line for each
    property of an engine."""
    found: dict[tuple[str, str, str], list[Deviation]] = {}
    for each in report.model_difference if report.format != "urdf" else ():
        # No file in SDF or MJCF states the gravity of PyBullet's world.
        if (each.engine, each.part) != ("pybullet", "gravity"):
            found.setdefault((each.engine, each.part, each.property), []).append(each)
    if not found:
        return
    heading(out, "what engines hold otherwise than the file states")
    for (engine, part, quality), places in found.items():
        first = places[0]
        line = "" if first.line is None else f"line {first.line}: "
        more = f"; and of {len(places) - 1} more" if len(places) > 1 else ""
        who = "" if part in ("base", "gravity") else f" of {part} {wording.name(first.name)}"
        values = f"{wording.value(first.file)} -> {wording.value(first.engine_value)}"
        sentence(out, f"{engine}: {line}{quality}{who} {values}{more}", 2, "dim")


def show_variants(out: Console, report: DoctorReport) -> None:
    """Print the variants that differ: the call, the effect of its causes and what to write instead."""
    for each in report.variants_off:
        out.print()
        title = f"another common call, {each.engine}, differs: "
        out.print(Text.assemble((title, "bold"), (wording.name(each.call, 500), "dim")))
        for line in wording.variant(each):
            sentence(out, line, 2)
        for rule in map(catalogue_entry, dict.fromkeys(finding.rule for finding in each.findings)):
            if rule is not None and rule.advice:
                sentence(out, f"-> {one_line(rule.advice)}", 2)


def _show_findings(out: Console, found: Sequence[RuleFindings], places: int) -> None:
    """Print the causes with an effect, those without, and bad practice; above them the command that explains
    a rule."""
    rest = [each for each in found if each.largest_effect is None]
    sections = {
        "causes": [each for each in found if each.largest_effect is not None],
        "present, without effect on this base": [each for each in rest if each.kind == "difference"],
        "bad practice": [each for each in rest if each.kind == "practice"],
    }
    more = f" (more about a rule: dynx explain {shlex.quote(wording.name(found[0].rule))})" if found else ""
    for title, group in sections.items():
        if group:
            out.print()
            out.print(Text.assemble((title, "bold"), (more, "dim")))
            _show_causes(out, group, places)
            more = ""


def show_ignored(out: Console, *reports: DoctorReport) -> None:
    """Print the number of findings of ignored rules, by rule."""
    if line := wording.ignored(*reports):
        sentence(out, line, 0, "yellow")


def _show_causes(out: Console, found: Sequence[RuleFindings], places: int) -> None:
    for cause in found:
        out.print(_cause_line(cause))
        sentence(out, f"{one_line(cause.title)} ({_extent(cause)})", 6)
        _show_places(out, cause, places)
        if cause.advice and (cause.largest_effect is not None or cause.kind == "practice"):
            sentence(out, f"-> {one_line(cause.advice)}", 6)


def _show_places(out: Console, cause: RuleFindings, places: int) -> None:
    shown = cause.findings[:places]
    more = f"; and {len(cause.findings) - len(shown)} more" if len(cause.findings) > len(shown) else ""
    for finding in shown:
        parts = [each for each in (wording.effects(finding), wording.message(finding.message, 300)) if each]
        end = more if finding is shown[-1] else ""
        sentence(out, f"{_place(finding)}: {'; '.join(parts)}{end}", 6, "dim")


def _place(finding: Finding) -> str:
    line = "" if finding.line is None else f"line {finding.line}, "
    return f"{line}{wording.part(finding)}"


def _cause_line(cause: RuleFindings) -> Text:
    """Make the line of a cause: rule, largest effect, and whether it is proved."""
    largest = cause.largest_effect
    line = Text(f"  {wording.name(cause.rule)} {wording.name(cause.name)}", STYLES[cause.severity])
    if largest is not None:
        line.append(f"  {wording.effect(largest)}", STYLES[cause.severity])
        if cause.severity == "warning":
            line.append(" (rounding)", "dim")
    if largest is not None and not cause.proved:
        line.append("  not proved", "bold red")
    return line


def _extent(cause: RuleFindings) -> str:
    """Write the number of places with an effect and the engines, and the number of places without effect."""
    engines = f" in {', '.join(map(wording.name, cause.engines))}" if cause.engines else ""
    acting = sum(each.effect is not None for each in cause.findings) or len(cause.findings)
    idle = len(cause.findings) - acting
    return f"{counted(acting, 'place')}{engines}{f', {idle} without effect' * bool(idle)}"


def _show_list(out: Console, title: str, items: Sequence[str]) -> None:
    if items:
        heading(out, title)
        for item in items:
            sentence(out, one_line(item), 2)


def _show_calls(out: Console, report: DoctorReport) -> None:
    for title, comparison in wording.CALLS.items():
        calls = [call for call in report.calls if call.comparison == comparison]
        if calls:
            heading(out, title)
        for call in calls:
            out.print(f"  {wording.name(call.engine)}")
            block(out, call.code, 6)


def _show_changes(out: Console, report: DoctorReport) -> None:
    """Print what the mended file changes, and what its level leaves undone."""
    made = [wording.change(each) for each in report.changes if each.made]
    left = [wording.change(each) for each in report.undone]
    _show_list(out, "the mended file changes", made)
    _show_list(out, f"left undone at --level {report.level}", left)


def _show_unexplained(out: Console, report: DoctorReport, saved: Mapping[int, str]) -> None:
    if not report.unexplained:
        return
    heading(out, "unexplained: no rule accounts for these differences", "bold red")
    for number, each in enumerate(report.unexplained):
        sentence(out, wording.unexplained(each), 2, "red")
        found = each.counterexample
        if found is not None:
            file = saved.get(number)
            joints = counted(found.moving_joints, "moving joint")
            at = "" if file is None else f": {one_line(file)}"
            sentence(out, f"smallest robot that shows the difference, {joints}{at}", 6)
            for symbol, values in (("q", found.q), ("v", found.v), ("a", found.a)):
                sentence(out, f"{symbol} = [{', '.join(f'{value:g}' for value in values)}]", 6, "dim")


def _show_next(out: Console, report: DoctorReport, mended: str | None, command: str) -> None:
    if mended is None and report.mended is None and report.alike:
        return
    out.print()
    if mended is not None:
        kind = "" if PurePath(mended).suffix else f" (a file; {one_line(mended)}/ would be a directory)"
        out.print(f"{_action(report)} {one_line(mended)}{kind}", style="bold green")
        if by_hand := _by_hand(report):
            sentence(out, f"not mended, because the file does not say what is right: {by_hand}", 0, "yellow")
    elif report.mended is not None:
        suffix = {"urdf": ".urdf", "mjcf": ".xml", "sdf": ".sdf"}[report.format]
        out.print(f"to mend it: {command} --fix OUT{suffix}", style="bold")
    if not report.alike:
        out.print(f"{_residual(report)}; {report.seconds:.1f} s", style="dim")


def _then(report: DoctorReport) -> str:
    """Write what is compared with the file as loaded; empty where that is all."""
    # A lower level that changes nothing leaves errors that are to be seen.
    mended = f"mended{level_clause(report)}" if report.mended is not None or report.undone else ""
    return " ".join(filter(None, (mended, "with the calls below" if report.calls else "")))


def level_clause(report: DoctorReport) -> str:
    """Name a level below the default."""
    return "" if report.level == "physics" else f" at level {report.level}"


def _action(report: DoctorReport) -> str:
    """Write what was done to make a written file, before its name."""
    if report.mended is not None:
        return f"mended{level_clause(report)}{_conditions(report)}:"
    if report.kinematics_only:
        return "no inertial data, which --fix does not invent; copied unchanged to"
    return f"nothing to change in the text{level_clause(report)}; copied unchanged to"


def _by_hand(report: DoctorReport) -> str:
    """Write the rules of bad practice that the written file keeps, such as a unit that it does not state."""
    changed = {change.rule for change in report.changes}
    kept = dict.fromkeys(
        each.rule
        for each in report.findings
        if each.kind == "practice" and each.rule not in changed and each.rule not in report.ignored
    )
    entries = ((rule, catalogue_entry(rule)) for rule in kept)
    return ", ".join(wording.name(rule) + (f" {entry.name}" if entry else "") for rule, entry in entries)


def _conditions(report: DoctorReport) -> str:
    """Write on which conditions engines load the mended file alike."""
    refusing = " and ".join(map(wording.name, report.refused_without_meshes))
    meshes = f"for {refusing}, once its meshes are there" if refusing else ""
    conditions = "; ".join(filter(None, (_without_calls(report), meshes)))
    return f" ({conditions})" if conditions else ""


def _without_calls(report: DoctorReport) -> str:
    """Name the causes that the mended text keeps, because only calls remove them."""
    changed = {change.rule for change in report.changes}
    kept = list(
        dict.fromkeys(
            each.rule
            for each in report.differences
            if each.rule not in changed and (_is_removed_by_calls(each) or _exceeds(each, report.remaining))
        )
    )
    if not (kept and report.calls):
        return ""
    verb = "remains" if len(kept) == 1 else "remain"
    return f"without the calls above, {', '.join(map(wording.name, kept))} {verb}"


def _is_removed_by_calls(finding: Finding) -> bool:
    return isinstance(catalogue_entry(finding.rule), CallingRule)


def _exceeds(finding: Finding, error: float) -> bool:
    """Check whether an effect is much larger than an error; one that is not was left because it is small."""
    return finding.effect is not None and finding.effect.relative_error > 10.0 * error


def _residual(report: DoctorReport) -> str:
    """Write the error that remains without the causes, and the engines that have none."""
    missing = [each.engine for each in report.engines if each.no_results_after is not None]
    without = f" (without {', '.join(map(wording.name, missing))})" if missing else ""
    residual = f"{wording.relative(report.residual)}{without}"
    if report.kinematics_only:
        return f"residual error of poses and Jacobians: {residual}; dynamics is not compared"
    return f"residual error without all causes: {residual}"


def _change(engine: EngineResult, key: str, tolerance: float, mended: bool) -> Text:
    """Write the error before mending, and the one after where either exceeds the tolerance."""
    before, after = engine.before.get(key), engine.after.get(key)
    if before is None:
        word = "-" if engine.no_results is None else "not used" if engine.refused is None else "refused"
        first = Text(word, "red")
    else:
        first = error_text(before, tolerance)
    if after is None or not mended or (before is not None and before <= tolerance and after <= tolerance):
        return first
    return Text.assemble(first, " -> ", error_text(after, tolerance))


def error_text(error: float, tolerance: float) -> Text:
    """Write an error in the style of its severity."""
    if error <= tolerance:
        return Text(wording.relative(error), "green")
    return Text(wording.relative(error), STYLES["warning" if error <= ROUNDING else "error"])


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
    _count_practice(out, reports)
    show_ignored(out, *reports)
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


def _count_practice(out: Console, reports: Sequence[DoctorReport]) -> None:
    """Print the number of robots with bad practice, which no verdict counts, and the rules that name it."""
    found = [
        sorted({each.rule for each in causes(report) if each.kind == "practice"} - report.ignored.keys())
        for report in reports
    ]
    affected = sum(map(bool, found))
    if affected:
        share = f"{affected} of {counted(len(reports), 'robot')}"
        rules = ", ".join(sorted({rule for each in found for rule in each}))
        out.print(f"bad practice: {share} ({rules}); for a single file the report shows the places")


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
    found = [
        cause
        for cause in causes(report)
        if cause.largest_effect is not None and cause.rule not in report.ignored
    ]
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


STYLES = {"error": "bold red", "warning": "yellow", "note": "dim"}
"""Style of each severity."""


def heading(out: Console, text: str, style: str = "bold") -> None:
    """Print a blank line and a title."""
    out.print()
    out.print(text, style=style)


def sentence(out: Console, text: str, indent: int, style: str = "") -> None:
    """Print text wrapped to the terminal's width, each line indented; words are not broken."""
    blanks = " " * indent
    lines = textwrap.wrap(
        text,
        max(out.width, indent + 20),
        initial_indent=blanks,
        subsequent_indent=blanks,
        break_long_words=False,
        break_on_hyphens=False,
    )
    for line in lines:
        out.print(line, style=style)


def block(out: Console, code: str, indent: int) -> None:
    """Print lines of code without wrapping, so that they can be copied."""
    for line in code.splitlines():
        blanks = " " * (indent + len(line) - len(line.lstrip(" ")))
        out.print(f"{blanks}{one_line(line)}")
