"""HTML page for people: one self-contained file without scripts, for screen and paper.

The templates beside this module hold the markup. Everything they print is escaped, and control characters are
made visible: names in a robot description may hold anything.
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

if TYPE_CHECKING:
    from jinja2 import Environment

LIMITS = {"SHOWN_RULES": 6, "OPEN_PLACES": 2, "SHOWN_PLACES": 40, "OPEN_VALUES": 25, "OPEN_LINES": 80}
"""Largest numbers of rules in a robot's row of the overview, of expanded and of listed places of a cause,
and of engine values and changed lines in an expanded table."""

LOWEST_BAR = -16
"""Power of ten at which the bar of an error starts: the last digit of a double; it is full at 100 %."""


def html_page(
    reports: Sequence[DoctorReport], *, command: str | None = None, baseline: Baseline | None = None
) -> str:
    """Make the page, in ASCII, with the `command` line that reproduces it."""
    entries = {cause.rule: cause.entry for report in reports for cause in causes(report) if cause.entry}
    page = template_environment().get_template("page.html.j2")
    text = page.render(
        reports=reports,
        titles=wording.titles([report.robot for report in reports]),
        counts=Counter(report.status for report in reports),
        rules=[entries[rule] for rule in sorted(entries)],
        baseline=baseline,
        command=command,
        version=__version__,
        footer=_footer(reports),
    )
    return text.encode("ascii", "xmlcharrefreplace").decode("ascii")


@cache
def template_environment() -> Environment:
    """Return the templates with the functions that they use. Only this function imports Jinja2."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("dynx.doctor.formats"),
        autoescape=True,
        finalize=_printable,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    words = (wording.name, wording.relative, wording.quantity, wording.effect, wording.part)
    more = (wording.unexplained, wording.finding_effect, wording.variant, wording.change)
    filters = (*words, *more, wording.unread_meshes, wording.loads_mended, wording.refusal)
    environment.filters.update({each.__name__: each for each in filters})
    environment.filters["capitalized"] = lambda text: text[:1].upper() + text[1:]
    views: tuple[Callable[..., Any], ...] = (causes, step_of, bar_position, largest_error)
    views += (wording.difference, engine_map, pair_map, joint_map, model_tables, changes, excerpt)
    environment.globals.update({each.__name__: each for each in views}, steps=ALL_STEPS, **LIMITS)
    return environment


def _printable(value: Any) -> Any:
    """Make the control characters of a text visible, except line breaks and tabs; markup stays as it is."""
    if not isinstance(value, str) or hasattr(value, "__html__"):
        return value
    return "".join(c if c.isprintable() or c in "\n\t" else repr(c)[1:-1] for c in value)


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
