"""Run of ``dynx contacts``: the measurement with progress, a JSON document, tables, files and exit code.

Errors in the document are relative; its lists run over `steps`, the largest first.
"""

from __future__ import annotations

import textwrap
import time
from collections.abc import Sequence
from functools import partial
from typing import Any, Literal, TypedDict

from rich.console import Console
from rich.text import Text

from dynx.cli.contacts.page import contacts_page
from dynx.cli.contacts.wording import (
    RANKS,
    SINGLE_STEP,
    figure_name,
    figures_by_name,
    span_text,
    step_text,
    steps_text,
    verdict_text,
    worst_figure,
)
from dynx.cli.shell.exits import (
    BAD_INPUT,
    DONE,
    INTERRUPTED,
    complain,
    exit_code,
    failure_of,
    interruptible,
    one_line,
    short_line,
)
from dynx.cli.shell.inputs import settings_by_engine
from dynx.cli.shell.output import (
    Entry,
    check_json,
    check_writable,
    command_line,
    console,
    counted,
    entry_of,
    present,
    progress_bar,
)
from dynx.contacts import (
    STEPS,
    Attribution,
    AttributionOutcome,
    Conformance,
    ContactCase,
    FigureResult,
    VerdictKind,
    conform,
    find_cases,
)
from dynx.contacts.candidates import SUBSTEPS
from dynx.errors import ArgumentError
from dynx.files.figures import new_figure
from dynx.files.writing import write_text
from dynx.steppers.registry import installed_worlds
from dynx.steppers.settings import Setting


def contacts(
    engines: tuple[str, ...] | None,
    cases: tuple[str, ...] | None,
    steps: tuple[float, ...] | None,
    settings: Sequence[tuple[str, str]],
    jobs: int | None,
    only_list: bool,
    json_path: str | None,
    html_path: str | None,
    quiet: bool,
) -> int:
    """Measure the engines; return the exit code."""
    chosen_cases = find_cases(cases)
    if only_list:
        if json_path is not None or html_path is not None:
            raise ArgumentError("--list runs nothing, so that it has no results for --json and --html")
        _list_cases(chosen_cases)
        return DONE
    check_json(json_path)
    if html_path is not None:
        check_writable(html_path)
        if html_path == json_path:
            raise ArgumentError(f"two formats would be written to {html_path!r}")
        # An error of a package that is missing comes before a run of minutes.
        new_figure(1.0, 1.0)
    chosen = engines or installed_worlds()
    given = settings_by_engine(
        chosen, settings, {SUBSTEPS: Setting(1, "steps of the engine in each step", 1)}
    )
    started = time.perf_counter()
    with interruptible() as interruption:
        with progress_bar(len(chosen), enabled=not quiet) as advance:
            found = conform(
                chosen,
                steps or STEPS,
                chosen_cases,
                settings=given,
                jobs=jobs,
                progress=lambda done, total: advance(done, "measuring", total),
                interruptible=True,
            )
        interruption.finishing = True
        if found.not_done:
            how = "interrupted" if interruption.code in (None, INTERRUPTED) else "terminated"
            complain(f"{how}: {counted(found.not_done, 'trial')} not done")
        report = document(found, time.perf_counter() - started)
        code = _conclude(report, found, json_path, html_path, quiet=quiet, every_figure=cases is not None)
    return code if interruption.code is None else interruption.code


def _conclude(
    report: ContactsDocument,
    found: Conformance,
    json_path: str | None,
    html_path: str | None,
    *,
    quiet: bool,
    every_figure: bool,
) -> int:
    errors = []
    if html_path is not None:
        page = contacts_page(report, command=command_line())
        errors.append(failure_of(write_text, html_path, page))
    tables = (lambda *_: None) if quiet else partial(show, every_figure=every_figure)
    errors.append(present(report, tables, json_path))
    nothing = not found.results and not found.not_done
    code = exit_code(*errors, negative=bool(nothing or found.unexplained or found.failures))
    if nothing and code != BAD_INPUT:
        lost = (*found.failures, *found.refusals)
        complain("nothing was measured" + (f"; {lost[0].engine}: {lost[0].message}" if lost else ""))
    return code


def _list_cases(cases: Sequence[ContactCase]) -> None:
    """Print name and title of each case, and its law below."""
    out = console()
    for case in cases:
        out.print(Text.assemble((one_line(case.name), "bold"), f"  {one_line(case.title)}"))
        for line in textwrap.wrap(one_line(case.law), max(out.width - 4, 40), break_long_words=False):
            out.print(Text(f"    {line}"))


SCHEMA: Literal["dynx.contacts/1"] = "dynx.contacts/1"


class EngineEntry(TypedDict):
    """An engine, the settings given to it, and its number of figures with each verdict.

    `in_effect` has the values in effect at each step of settings given that the engine changes.
    """

    engine: str
    version: str
    settings: dict[str, Any]
    in_effect: dict[str, list[float]]
    verdicts: dict[VerdictKind, int]


class PriceEntry(TypedDict):
    """Another figure of the case, whose error at the smallest step a change at least doubles."""

    trial: str
    figure: str
    before: float
    after: float


class AttributionEntry(TypedDict):
    """Settings whose change removes an error or makes it fall, proved by running again.

    `settings` has the values of each setting: the one in use, then those that were tried. `errors` has the
    errors at every step for each of the values in turn. `outcome` is removed where the last of them are
    within the tolerance at every step, falls where they fall with the step, and proportion where the error
    at the smallest step falls with the setting; `order` is the order at which they fall, null under removed.
    """

    settings: dict[str, list[Any]]
    reason: str
    errors: list[list[float]]
    outcome: AttributionOutcome
    order: float | None
    price: list[PriceEntry]


class FigureEntry(TypedDict):
    """A figure of one engine at every step, with the verdict on its error.

    An error is abs(measured - exact) / scale. Where mechanics gives bounds, `exact` is the least value and
    `most` the largest, else null; the error is then the distance from the interval. `order` is that of the
    error in the step, under ``falls``; `reason` states why the engine cannot give the exact value, under
    ``cannot``.
    """

    engine: str
    trial: str
    figure: str
    unit: str
    exact: float
    most: float | None
    scale: float
    tolerance: float
    measured: list[float]
    errors: list[float]
    verdict: VerdictKind
    order: float | None
    reason: str | None
    attribution: AttributionEntry | None


class NoResultEntry(TypedDict):
    """A trial that one engine refused, or in which it failed, at the step `dt`."""

    engine: str
    trial: str
    dt: float
    kind: str
    message: str


class CaseEntry(TypedDict):
    """A case with a closed form, and what was measured in it."""

    name: str
    title: str
    law: str
    source: str
    figures: list[FigureEntry]
    no_results: list[NoResultEntry]


class ContactsDocument(TypedDict):
    """Errors of engines against mechanics, by case.

    `not_done` is the number of trials of an engine that Ctrl-C left without a verdict.
    """

    schema: Literal["dynx.contacts/1"]
    steps: list[float]
    engines: list[EngineEntry]
    cases: list[CaseEntry]
    runs: int
    seconds: float
    not_done: int


def document(found: Conformance, seconds: float) -> ContactsDocument:
    """Return the document of a conformance."""
    return {
        "schema": SCHEMA,
        "steps": list(found.steps),
        "engines": [
            {
                "engine": name,
                "version": found.versions[name],
                "settings": dict(found.settings[name]),
                "in_effect": {key: list(values) for key, values in found.in_effect.get(name, {}).items()},
                "verdicts": found.counts(name),
            }
            for name in found.engines
        ],
        "cases": [_case_entry(found, each) for each in found.cases],
        "runs": found.runs,
        "seconds": seconds,
        "not_done": found.not_done,
    }


def _case_entry(found: Conformance, case: ContactCase) -> CaseEntry:
    lost = [each for each in (*found.refusals, *found.failures) if each.case == case.name]
    return entry_of(
        CaseEntry,
        case,
        figures=[_figure_entry(each) for each in found.results if each.case == case.name],
        no_results=[entry_of(NoResultEntry, each) for each in lost],
    )


def _figure_entry(result: FigureResult) -> FigureEntry:
    verdict = result.verdict
    cause = None if verdict.attribution is None else _attribution(verdict.attribution)
    return entry_of(
        FigureEntry,
        result,
        verdict=verdict.kind,
        order=verdict.order,
        reason=verdict.reason,
        attribution=cause,
    )


def _attribution(attribution: Attribution) -> AttributionEntry:
    return entry_of(
        AttributionEntry,
        attribution,
        settings={
            name: [list(each) if isinstance(each, tuple) else each for each in tried]
            for name, tried in attribution.values.items()
        },
        errors=[list(each) for each in attribution.errors],
        price=[entry_of(PriceEntry, each) for each in attribution.price],
    )


STYLES = {"unexplained": "bold red", "setting": "yellow", "cannot": "yellow", "falls": "", "within": "green"}
"""Style of each verdict."""

MIN_VERDICT_WIDTH = 24
"""Smallest width of the column of verdicts, which are wrapped in it."""


def show(out: Console, report: Entry, *, every_figure: bool = False) -> None:
    """Print for each case and engine the figure that deserves the first look, or every figure."""
    names = ", ".join(f"{each['engine']} {each['version']}".strip() for each in report["engines"])
    out.print(
        f"contacts against mechanics: {one_line(names)}, steps {steps_text(report['steps'])}", style="bold"
    )
    for each in report["engines"]:
        if each["settings"]:
            given = ", ".join(f"{name}={value}" for name, value in each["settings"].items())
            out.print(f"{one_line(each['engine'])} with {one_line(given)}")
        for name, values in each["in_effect"].items():
            listed = ", ".join(f"{value:g}" for value in values)
            out.print(f"{one_line(each['engine'])} has {one_line(name)} {listed} in effect at these steps")
    shown = {
        case["name"]: _by_name(case) if every_figure else worst_of_engines(case)
        for case in report["cases"]
        if case["figures"] or case["no_results"]
    }
    ends = " .. ".join(step_text(each) for each in dict.fromkeys((report["steps"][0], report["steps"][-1])))
    out.print(f"relative errors at {ends}")
    rows = [each for found in shown.values() for each in found]
    layout = _FigureColumns(out, report["steps"], rows, tolerances=every_figure)
    for case in report["cases"]:
        if case["name"] not in shown:
            continue
        out.print()
        out.print(Text.assemble((one_line(case["name"]), "bold"), f"  {one_line(case['title'])}"))
        for figure in shown[case["name"]]:
            layout.show(figure)
        for lost in _first_of_engines(case["no_results"]):
            where = f" at {step_text(lost['dt'])}" + (f", {lost['trial']}" if lost["trial"] else "")
            what = f"{lost['engine']}{where}: {lost['kind']}: {lost['message']}"
            out.print(f"  {short_line(what)}", style="yellow")
    _show_conclusion(out, report, layout.steps)
    if len(report["steps"]) == 1:
        out.print(SINGLE_STEP)
    if not every_figure and sum(len(case["figures"]) for case in report["cases"]) > sum(
        map(len, shown.values())
    ):
        out.print("of each engine and case one figure is shown; --case NAME shows all of a case")


def worst_of_engines(case: Entry) -> list[Entry]:
    """Return the figure of each engine in a case that deserves the first look."""
    engines = dict.fromkeys(each["engine"] for each in case["figures"])
    return [
        worst_figure([each for each in case["figures"] if each["engine"] == engine]) for engine in engines
    ]


def _by_name(case: Entry) -> list[Entry]:
    """Return the figures of a case with those of all engines together."""
    return [each for found in figures_by_name(case).values() for each in found.values()]


class _FigureColumns:
    """Columns of the lines of figures: engine, errors, name of the figure, verdict."""

    def __init__(
        self, out: Console, steps: Sequence[float], figures: Sequence[Entry], *, tolerances: bool
    ) -> None:
        self._tolerances = tolerances
        self.steps = steps
        self._out = out
        self._engine = max((len(one_line(each["engine"])) for each in figures), default=0)
        self._error = max((len(span_text(each["errors"])) for each in figures), default=0)
        self._name = max((len(one_line(figure_name(each))) for each in figures), default=0)

    def show(self, figure: Entry) -> None:
        """Print a figure in one line, or more where the verdict is too long for the terminal."""
        name, engine = one_line(figure_name(figure)), one_line(figure["engine"])
        error = span_text(figure["errors"])
        head = f"  {engine:<{self._engine}}  {error:>{self._error}}  {name:<{self._name}}  "
        room = self._out.width - len(head)
        verdict = one_line(verdict_text(figure))
        if self._tolerances:
            verdict = f"{verdict} (tolerance {figure['tolerance']:.0e})"
        lines = [verdict]
        if room < len(verdict):
            lines = textwrap.wrap(verdict, max(room, MIN_VERDICT_WIDTH), break_long_words=False)
        style = STYLES[figure["verdict"]]
        self._out.print(Text.assemble(head, (lines[0], style)))
        for line in lines[1:]:
            self._out.print(Text.assemble(" " * len(head), (line, style)))


def _show_conclusion(out: Console, report: Entry, steps: Sequence[float]) -> None:
    figures = [each for case in report["cases"] for each in case["figures"]]
    lost = [each for case in report["cases"] for each in case["no_results"]]
    out.print()
    counts = {verdict: sum(each["verdict"] == verdict for each in figures) for verdict in RANKS}
    parts = [f"{count} {verdict}" for verdict, count in counts.items() if count]
    out.print(
        f"{counted(len(figures), 'figure')} at {step_text(steps[-1])}: {', '.join(parts) or 'none'}; "
        f"{counted(report['runs'], 'run')} in {report['seconds']:.1f} s",
        style="bold",
    )
    refused = sum(each["kind"] == "refused" for each in lost)
    if refused:
        out.print(f"{counted(refused, 'run')} refused by the engine")
    if len(lost) > refused:
        out.print(f"{counted(len(lost) - refused, 'run')} failed", style="bold red")
    if report["not_done"]:
        out.print(f"{counted(report['not_done'], 'trial')} not done", style="yellow")


def _first_of_engines(lost: Sequence[Entry]) -> list[Entry]:
    """Return the first entry of each engine and kind."""
    return [*{(each["engine"], each["kind"]): each for each in reversed(lost)}.values()][::-1]
