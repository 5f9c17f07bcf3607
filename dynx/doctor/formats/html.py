"""A page for people: one HTML file that needs no other, without scripts, for screen and paper."""

from __future__ import annotations

import math
from collections.abc import Sequence
from importlib.resources import files
from string import Template

from dynx._version import __version__
from dynx.doctor.formats import wording
from dynx.doctor.formats.baseline import Baseline
from dynx.doctor.formats.causes import causes, status
from dynx.doctor.formats.html_causes import rule_pages
from dynx.doctor.formats.html_elements import cell, code, escape, name, pre, table
from dynx.doctor.formats.html_heat import heat_cell, heat_style, legend
from dynx.doctor.formats.html_robot import robot_section, robot_summary
from dynx.doctor.formats.vote import largest_error
from dynx.doctor.report import DoctorReport

_SHOWN_RULES = 6
"""Rules in the row of one robot among many."""


def html_page(
    reports: Sequence[DoctorReport], *, command: str | None = None, baseline: Baseline | None = None
) -> str:
    """The page, in ASCII. `command` is what the page says to run for the same result."""
    called = wording.titles([report.robot for report in reports])
    if len(reports) == 1:
        title = f"{escape(called[0])}, {escape(reports[0].base)} base"
        header = f"<h1>{title}</h1>"
        body = robot_section(reports[0], baseline)
    else:
        title = "Do engines load these robots alike?"
        header = f"<h1>{title}</h1><p>{escape(_counted(reports))}</p>"
        body = (
            _summary(reports, called)
            + "\n"
            + "\n".join(
                robot_summary(report, called[number], f"r{number}", baseline)
                for number, report in enumerate(reports)
            )
        )
    pages = rule_pages(cause for report in reports for cause in causes(report))
    if pages:
        body += f"\n<h3>The rules</h3>\n{pages}"
    page = Template(_template("page.html")).substitute(
        version=escape(__version__),
        title=f"{title} - dynx doctor",
        style=_template("page.css") + heat_style(),
        header=header,
        body=body,
        footer=_footer(reports, command),
    )
    return page.encode("ascii", "xmlcharrefreplace").decode("ascii")


def _summary(reports: Sequence[DoctorReport], called: Sequence[str]) -> str:
    """A row for each robot, which leads to it."""
    rows = []
    for number, report in enumerate(reports):
        word = status(report)
        found = [cause for cause in causes(report) if cause.worst is not None]
        rules = " ".join(code(cause.rule) for cause in found[:_SHOWN_RULES])
        rules += f" and {len(found) - _SHOWN_RULES} more" if len(found) > _SHOWN_RULES else ""
        measured = report.error is None
        refusing = [each.engine for each in report.engines if each.refused is not None]
        rows.append(
            (
                f'<a href="#r{number}">{escape(called[number])}</a>',
                [
                    cell(escape(report.base)),
                    cell(f'<span class="tag {word}">{word}</span>'),
                    heat_cell(largest_error(report) if measured else None, report.tolerance),
                    heat_cell(report.residual if measured else None, report.tolerance),
                    cell(", ".join(map(name, refusing))),
                    cell(rules),
                ],
            )
        )
    tolerance = max((report.tolerance for report in reports), default=0.0)
    return legend(tolerance) + table(
        ["robot", "base", "verdict", ">as loaded", ">mended", "refused by", "causes"], rows, "heat-some"
    )


def _counted(reports: Sequence[DoctorReport]) -> str:
    words = [status(report) for report in reports]
    parts = [f"{words.count('alike')} alike", f"{words.count('explained')} differ, with every cause proved"]
    parts += [f"{words.count('unexplained')} differ without a full explanation"]
    parts += [f"{words.count('refused')} not examined"]
    robots = len({report.robot for report in reports})
    what = f"{robots} robots" if robots == len(reports) else f"{len(reports)} examinations of {robots} robots"
    return f"{what}: " + ", ".join(part for part in parts if not part.startswith("0 ")) + "."


def _footer(reports: Sequence[DoctorReport], command: str | None) -> str:
    found = {each.engine: each.version for report in reports for each in report.engines}
    engines = ", ".join(f"{name(engine)} {name(version)}" for engine, version in found.items())
    measured = [report for report in reports if report.error is None]
    settings = ""
    if measured:
        one = measured[0]
        settings = f" {one.samples} random states, seed {one.seed}, tolerance {one.tolerance:g}."
    again = "" if command is None else f"<h3>How to reproduce</h3>{pre(command)}"
    seconds = math.fsum(report.seconds for report in reports)
    versions = ", ".join(filter(None, [f"dynx {escape(__version__)}", engines]))
    return f"{again}<p>{versions}.{settings} {seconds:.1f} s.</p>"


def _template(file: str) -> str:
    return files("dynx.doctor.formats").joinpath(file).read_text(encoding="utf-8")
