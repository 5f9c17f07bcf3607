"""HTML page of ``dynx contacts`` with its plots, made from the JSON document alone.

The templates beside this module hold the markup of the results, those of `dynx.files.pages` the frame. A plot
has errors over the step on logarithmic axes, one line for each engine. It is drawn by matplotlib and stands
as SVG in the page, so that lines and text take the colours of a light or a dark page.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

from dynx._version import __version__
from dynx.cli.contacts import wording
from dynx.cli.contacts.wording import (
    MAX_ORDER,
    as_number,
    exact_text,
    figure_name,
    figures_by_name,
    step_text,
)
from dynx.cli.shell.output import Entry
from dynx.errors import escaped
from dynx.files.figures import new_figure, svg_element
from dynx.files.pages import page_environment, page_text

if TYPE_CHECKING:
    from dynx.files.pages import Environment


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
        wording.exact_text,
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
        shapes=MARKER_TEXTS,
    )
    return environment


def _footer(report: Entry) -> str:
    engines = [f"{each['engine']} {each['version']}".strip() for each in report["engines"]]
    return (
        f"{', '.join([f'dynx {__version__}', *engines])}. {report['runs']} runs, {report['seconds']:.1f} s."
    )


WIDTH, HEIGHT = 3.4, 2.2
"""Size of a plot [in]."""

DECADES_BELOW = 2
"""Decades below the tolerance that are drawn: smaller errors lie on the lower edge."""

MAX_ERROR = 1e3
"""Error from which on errors lie on the upper edge, also those that are not finite."""

ENGINE_OFFSET = 0.02
"""Shift of the line of one engine against the next, so that equal errors do not cover each other, as a share
of the logarithmic axis of steps."""

TRIANGLE_DROP = 0.07
"""Distance of an order triangle below its line, as a share of the logarithmic axis of errors."""

MIN_LABEL_DISTANCE = (0.15, 0.08)
"""Distances between the labels of two order triangles that do not touch, as shares of the axes."""

MAX_LABELS = 6
"""Largest number of labels on the axis of errors."""

MARKERS = "os^D"
MARKER_TEXTS = "\u25cf\u25a0\u25b2\u25c6"
"""Shapes of the markers of engines, by matplotlib and in the legend; further engines repeat them."""


class Plot(NamedTuple):
    """One figure of a case, with the lines of all engines as an SVG element."""

    title: str
    exact: str
    svg: str


def plots(case: Entry, steps: Sequence[float], engines: Sequence[str]) -> list[Plot]:
    """Return the plots of a case, one for each figure that is not within the tolerance in every engine."""
    named = figures_by_name(case).values()
    shown = [[*found.values()] for found in named if not _is_within(found)]
    return [
        Plot(
            figure_name(first),
            exact_text(first),
            svg_element(draw_errors([first, *others], steps, engines)),
        )
        for first, *others in shown
    ]


def all_within(case: Entry) -> list[str]:
    """Return the names of the figures that are within the tolerance in every engine."""
    return [name for name, found in figures_by_name(case).items() if _is_within(found)]


def _is_within(figures: Mapping[str, Entry]) -> bool:
    return all(each["verdict"] == "within" for each in figures.values())


def draw_errors(figures: Sequence[Entry], steps: Sequence[float], engines: Sequence[str]) -> Any:
    """Return a `matplotlib.figure.Figure` of the errors of one figure in each engine over the step.

    What the style sheet colours has its class as ``gid``. A line with the setting that is the cause of an
    error is named ``changed``, a triangle with the slope of an order ``order``.
    """
    tolerance = min(each["tolerance"] for each in figures)
    causes = [each["attribution"] for each in figures]
    rows = [
        *(each["errors"] for each in figures),
        *(each["errors"][-1] for each in causes if each is not None),
    ]
    errors = [min(as_number(error), MAX_ERROR) for row in rows for error in row]
    low = math.floor(math.log10(max(min([*errors, tolerance]), tolerance * 10.0**-DECADES_BELOW)))
    high = max(math.ceil(math.log10(max([*errors, 10.0 * tolerance]))), low + 1)
    span = math.log10(max(steps) / min(steps)) or 1.0

    figure = new_figure(WIDTH, HEIGHT)
    axes = figure.subplots()
    axes.set(xscale="log", yscale="log", ylim=(10.0**low, 10.0**high))
    axes.set_xlim(min(steps) / 10.0 ** (0.13 * span), max(steps) * 10.0 ** (0.13 * span))
    axes.set_xticks(steps, [step_text(dt) for dt in steps])
    powers = range(low, high + 1, max(1, math.ceil((high - low) / (MAX_LABELS - 1))))
    axes.set_yticks(
        [10.0**power for power in powers], [f"10{str(power).translate(_RAISED)}" for power in powers]
    )
    axes.minorticks_off()
    axes.tick_params(length=0, labelsize=8)
    axes.grid(visible=True, gid="grid")
    axes.axhspan(10.0**low, tolerance, gid="within")
    for spine in axes.spines.values():
        spine.set_gid("frame")

    labels: list[Sequence[float]] = []
    for each, cause in zip(figures, causes, strict=True):
        number = engines.index(each["engine"])
        aside = 10.0 ** (ENGINE_OFFSET * span * (number - 0.5 * (len(engines) - 1)))
        style = {"marker": MARKERS[number % len(MARKERS)], "clip_on": False, "markersize": 5}
        for row, kind in ((each["errors"], "line"), (cause and cause["errors"][-1], "line changed")):
            if row:
                # Fewer errors than steps belong to the smallest.
                x = [aside * dt for dt in steps[len(steps) - len(row) :]]
                y = [min(max(as_number(error), 10.0**low), 10.0**high) for error in row]
                axes.plot(x, y, gid=f"e{number % ENGINE_STYLES} {kind}", **style)
                if kind == "line" and each["order"] is not None and each["order"] <= MAX_ORDER:
                    _draw_triangle(axes, each["order"], x, y, labels)
    return figure


_RAISED = str.maketrans("-0123456789", "\u207b\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079")


def _draw_triangle(
    axes: Any, order: float, x: Sequence[float], y: Sequence[float], labels: list[Sequence[float]]
) -> None:
    """Draw a triangle below an interval of a line, the steepest where its label touches none of `labels`."""
    place = axes.transScale + axes.transLimits
    drop = math.prod(axes.get_ylim()[k] ** (TRIANGLE_DROP, -TRIANGLE_DROP)[k] for k in (0, 1))
    for k in sorted(range(len(x) - 1), key=lambda k: y[k + 1] / y[k]):
        middle, half = math.sqrt(x[k] * x[k + 1]), (x[k] / x[k + 1]) ** 0.25
        rise, level = half**order, drop * math.sqrt(y[k] * y[k + 1])
        corner = middle * half, level / rise
        at = place.transform((corner[0], level)).tolist()
        free = all(
            any(abs(a - b) > least for a, b, least in zip(at, other, MIN_LABEL_DISTANCE, strict=True))
            for other in labels
        )
        if free and corner[1] >= axes.get_ylim()[0]:
            axes.fill(
                [middle / half, corner[0], corner[0]], [corner[1], level * rise, corner[1]], gid="order"
            )
            axes.text(corner[0], level, f" {order:.1f}", fontsize=8, verticalalignment="center")
            labels.append(at)
            return
