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
from dynx.cli.contacts.plots import HEIGHT, WIDTH, all_within, plots
from dynx.errors import escaped
from dynx.files.pages import page_environment, page_text

if TYPE_CHECKING:
    from dynx.files.pages import Environment

Entry = Mapping[str, Any]

NAME_LENGTH = 400
"""Number of characters of a name or message that are shown: a package may bring cases of its own."""

ENGINE_STYLES = 6
"""Number of colours and markers of engines in the style sheet; more engines repeat them."""


class CausedErrors(NamedTuple):
    """Errors of figures of one case before and after the change of a setting: the largest at each step."""

    case: str
    figures: str
    before: tuple[float, ...]
    after: tuple[float, ...]
    outcome: str
    price: tuple[Entry, ...]
    """Errors of the case that the change makes worse."""


@dataclass(frozen=True)
class SettingCause:
    """A change of an engine's settings, and the errors that it removes or makes fall, by case."""

    engine: str
    change: str
    reason: str
    errors: tuple[CausedErrors, ...]


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
        causes=causes(cases),
        pairs=[case for case in cases if case["name"] in wording.PAIR_CASES and case["figures"]],
        command=command,
        footer=_footer(report),
    )


def causes(cases: Sequence[Entry]) -> list[SettingCause]:
    """Return the changes of settings to which errors are attributed."""
    found: dict[tuple[str, str, str], dict[str, list[Entry]]] = defaultdict(lambda: defaultdict(list))
    for case in cases:
        for figure in case["figures"]:
            cause = figure["attribution"]
            if cause is not None:
                change = wording.change_text(cause["settings"], arrow="\N{RIGHTWARDS ARROW}")
                found[figure["engine"], change, cause["reason"]][case["name"]].append(figure)
    return [
        SettingCause(
            *key,
            tuple(each for name, figures in by_case.items() for each in _caused_errors(name, figures)),
        )
        for key, by_case in sorted(found.items())
    ]


def _caused_errors(case: str, figures: Sequence[Entry]) -> list[CausedErrors]:
    """Return the errors of figures of a case, those with the same outcome together."""
    by_outcome: dict[str, list[Entry]] = defaultdict(list)
    for each in figures:
        by_outcome[each["attribution"]["outcome"]].append(each)
    return [_largest_errors(case, found) for found in by_outcome.values()]


def _largest_errors(case: str, figures: Sequence[Entry]) -> CausedErrors:
    """Return the largest errors of figures of a case that have the same outcome."""
    found = [each["attribution"] for each in figures]
    before, after = (
        tuple(
            max(map(wording.as_number, errors))
            for errors in zip(*(each["errors"][k] for each in found), strict=True)
        )
        for k in (0, -1)
    )
    price = {(one["trial"], one["figure"]): one for each in found for one in each["price"]}
    if len(figures) == 1:
        outcome, name = wording.outcome_text(found[0]), wording.figure_name(figures[0])
    else:
        name = f"{len(figures)} figures"
        outcome = {
            "removed": "removed",
            "falls": "fall with the step",
            "proportion": "fall with the setting",
        }[found[0]["outcome"]]
    return CausedErrors(case, name, before, after, outcome, tuple(price.values()))


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
        wording.headline,
        wording.price_text,
        wording.span_text,
        wording.step_text,
        wording.steps_text,
        cell_figure,
        all_within,
    )
    environment.globals.update(
        {each.__name__: each for each in more},
        meanings=wording.VERDICT_MEANINGS,
        single_step=wording.SINGLE_STEP,
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
