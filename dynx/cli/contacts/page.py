"""HTML page of ``dynx contacts``, made from its JSON document alone.

The templates beside this module hold the markup of the results, those of `dynx.files.pages` the frame.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

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


@dataclass(frozen=True)
class Removal:
    """A change of an engine's settings, and the figures whose error it removes."""

    engine: str
    change: str
    reason: str
    figures: tuple[tuple[Entry, Entry], ...]
    """Case and figure of each."""


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
    """Return the changes of settings to which errors are attributed, with their figures."""
    found: dict[tuple[str, str, str], list[tuple[Entry, Entry]]] = defaultdict(list)
    for case in cases:
        for figure in case["figures"]:
            cause = figure["attribution"]
            if cause is not None:
                change = wording.change_text(cause["settings"], arrow="\N{RIGHTWARDS ARROW}")
                found[figure["engine"], change, cause["reason"]].append((case, figure))
    return [Removal(*key, tuple(each)) for key, each in sorted(found.items())]


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
