"""HTML page for people: one self-contained file without scripts, for screen and paper.

The templates beside this module hold the markup of the report, those of `dynx.files.pages` the frame.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

from dynx._version import __version__
from dynx.doctor.formats import wording
from dynx.doctor.formats.baseline import Baseline
from dynx.doctor.formats.causes import causes
from dynx.doctor.formats.heat import ALL_STEPS, engine_map, joint_map, pair_map, step_of
from dynx.doctor.formats.model_tables import model_tables
from dynx.doctor.formats.text_changes import changes, excerpt
from dynx.doctor.formats.vote import largest_error
from dynx.doctor.report import DoctorReport
from dynx.files.pages import page_environment, page_text
from dynx.model.xacro_robots import left_out_note

if TYPE_CHECKING:
    from dynx.files.pages import Environment

LIMITS = {"SHOWN_RULES": 6, "OPEN_PLACES": 2, "SHOWN_PLACES": 40, "OPEN_VALUES": 25, "OPEN_LINES": 80}
"""Largest numbers of rules in a robot's row of the overview, of expanded and of listed places of a cause,
and of engine values and changed lines in an expanded table."""

LOWEST_BAR = -16
"""Power of ten at which the bar of an error starts: the last digit of a double; it is full at 100 %."""


def html_page(
    reports: Sequence[DoctorReport],
    *,
    command: str | None = None,
    baseline: Baseline | None = None,
    left_out: Sequence[str] = (),
) -> str:
    """Make the page, in ASCII, with the `command` line that reproduces it and the robots `left_out`, in xacro
    below a directory."""
    entries = {cause.rule: cause.entry for report in reports for cause in causes(report) if cause.entry}
    page = template_environment().get_template("doctor.html.j2")
    return page_text(
        page,
        reports=reports,
        titles=wording.titles([report.robot for report in reports]),
        counts=Counter(report.status for report in reports),
        rules=[entries[rule] for rule in sorted(entries)],
        baseline=baseline,
        left_out=left_out_note([wording.name(robot) for robot in left_out]) if left_out else "",
        command=command,
        footer=_footer(reports),
    )


@cache
def template_environment() -> Environment:
    """Return the templates with the functions that they use."""
    environment = page_environment("dynx.doctor.formats")
    words = (wording.name, wording.relative, wording.quantity, wording.effect, wording.part)
    more = (wording.unexplained, wording.finding_effect, wording.variant, wording.change)
    filters = (*words, *more, wording.unread_meshes, wording.loads_mended, wording.refusal)
    environment.filters.update({each.__name__: each for each in filters})
    views: tuple[Callable[..., Any], ...] = (causes, step_of, bar_position, largest_error)
    views += (wording.difference, engine_map, pair_map, joint_map, model_tables, changes, excerpt)
    environment.globals.update({each.__name__: each for each in views}, steps=ALL_STEPS, **LIMITS)
    return environment


def bar_position(error: float) -> float:
    """Return the position of an error on its bar [%]; an error that is not finite fills it."""
    if not math.isfinite(error):
        return 100.0
    power = math.log10(max(error, 10.0**LOWEST_BAR))
    return 100.0 * (1.0 - min(power, 0.0) / LOWEST_BAR)


def _footer(reports: Sequence[DoctorReport]) -> str:
    found = {each.engine: each.version for report in reports for each in report.engines}
    engines = [f"{wording.name(engine)} {wording.name(version)}" for engine, version in found.items()]
    settings = ""
    for one in [report for report in reports if report.error is None][:1]:
        settings = f" {one.samples} random states, seed {one.seed}, tolerance {one.tolerance:g}."
    seconds = math.fsum(report.seconds for report in reports)
    return f"{', '.join([f'dynx {__version__}', *engines])}.{settings} {seconds:.1f} s."
