"""Tables of ``dynx contacts``, made from its JSON document alone."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.text import Text

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
from dynx.cli.shell.exits import one_line, short_line
from dynx.cli.shell.terminal import counted

Entry = Mapping[str, Any]

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
