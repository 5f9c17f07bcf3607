"""HTML page of ``dynx contacts``, made from its JSON document alone.

The templates beside this module hold the markup of the results, those of `dynx.files.pages` the frame.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

from dynx._version import __version__
from dynx.cli.contacts import wording
from dynx.cli.contacts.plots import HEIGHT, WIDTH, all_exact, plots
from dynx.errors import escaped
from dynx.files.pages import page_environment, page_text

if TYPE_CHECKING:
    from dynx.files.pages import Environment

Entry = Mapping[str, Any]

NAME_LENGTH = 400
"""Number of characters of a name or message that are shown: a package may bring cases of its own."""

ENGINE_STYLES = 6
"""Number of colours and markers of engines in the style sheet; more engines repeat them."""


class RemovedErrors(NamedTuple):
    """Errors of figures of one case, the largest before and after the change of a setting."""

    case: str
    figures: str
    before: float
    after: float
    order: float | None
    """Order at which the error of a single figure falls with the setting; None where that removes it."""


@dataclass(frozen=True)
class Removal:
    """A change of an engine's settings, and the errors that it removes, by case."""

    engine: str
    change: str
    reason: str
    errors: tuple[RemovedErrors, ...]


def contacts_page(report: Entry, *, command: str | None = None) -> str:
    """Make the page, in ASCII, with the `command` line that reproduces it."""
    engines = [each["engine"] for each in report["engines"]]
    cases = [case for case in report["cases"] if case["figures"] or case["no_results"]]
    figures = [each for case in cases for each in case["figures"]]
    return page_text(
        template_environment().get_template("contacts.html.j2"),
        report=report,
        engines=engines,
        cases=cases,
        plots={case["name"]: plots(case, report["steps"], engines) for case in cases},
        counts={verdict: sum(each["verdict"] == verdict for each in figures) for verdict in wording.RANKS},
        removals=removals(cases),
        pairs=[case for case in cases if case["name"] in wording.PAIR_CASES and case["figures"]],
        command=command,
        footer=_footer(report),
    )


def removals(cases: Sequence[Entry]) -> list[Removal]:
    """Return the changes of settings to which errors are attributed."""
    found: dict[tuple[str, str, str], dict[str, list[Entry]]] = defaultdict(lambda: defaultdict(list))
    for case in cases:
        for figure in case["figures"]:
            cause = figure["attribution"]
            if cause is not None:
                change = wording.change_text(cause["settings"], arrow="\N{RIGHTWARDS ARROW}")
                found[figure["engine"], change, cause["reason"]][case["name"]].append(figure)
    return [
        Removal(*key, tuple(_removed(name, figures) for name, figures in by_case.items()))
        for key, by_case in sorted(found.items())
    ]


def _removed(case: str, figures: Sequence[Entry]) -> RemovedErrors:
    causes = [each["attribution"] for each in figures]
    before, after = (max(wording.as_number(each["errors"][k][-1]) for each in causes) for k in (0, -1))
    if len(figures) > 1:
        return RemovedErrors(case, f"{len(figures)} figures", before, after, None)
    return RemovedErrors(case, wording.figure_name(figures[0]), before, after, causes[0]["order"])


def cell_figure(case: Entry, engine: str) -> Entry | None:
    """Return the figure of an engine in a case that deserves the first look; None where it has none."""
    figures = [each for each in case["figures"] if each["engine"] == engine]
    return wording.worst_figure(figures) if figures else None


@cache
def template_environment() -> Environment:
    """Return the templates with the functions that they use."""
    environment = page_environment("dynx.cli.contacts")
    filters = (wording.error_text, wording.figure_name, wording.verdict_text, wording.order_text)
    environment.filters.update({each.__name__: each for each in filters})
    environment.filters["name"] = lambda text: escaped(text, NAME_LENGTH)
    more = (
        wording.figures_by_name,
        wording.coefficient_text,
        wording.last_error,
        wording.quantity_text,
        wording.step_text,
        wording.steps_text,
        cell_figure,
        all_exact,
    )
    environment.globals.update(
        {each.__name__: each for each in more},
        meanings=wording.VERDICT_MEANINGS,
        styles=ENGINE_STYLES,
        width=WIDTH,
        height=HEIGHT,
    )
    return environment


def _footer(report: Entry) -> str:
    engines = [f"{each['engine']} {each['version']}".strip() for each in report["engines"]]
    return (
        f"{', '.join([f'dynx {__version__}', *engines])}. {report['runs']} runs, {report['seconds']:.1f} s."
    )
