"""HTML page of ``dynx contacts`` and the geometry of its plots, made from the JSON document alone.

The templates beside this module hold the markup of the results, those of `dynx.files.pages` the frame. A plot
has errors over the step on logarithmic axes, one line for each engine; the template draws it as SVG in the
page, so that lines and text take the colours of a light or a dark page.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

from dynx._version import __version__
from dynx.cli.contacts import wording
from dynx.cli.contacts.wording import (
    MAX_ORDER,
    as_number,
    figure_name,
    figures_by_name,
    quantity_text,
    step_text,
)
from dynx.cli.shell.output import Entry
from dynx.errors import escaped
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


WIDTH, HEIGHT = 320.0, 210.0
"""Size of a plot [pixels]."""

LEFT, RIGHT, TOP, BOTTOM = 46.0, 14.0, 8.0, 30.0
"""Margins beside the axes [pixels]."""

DECADES_BELOW = 2
"""Decades below the tolerance that are drawn: smaller errors lie on the lower edge."""

MAX_ERROR = 1e3
"""Error from which on errors lie on the upper edge, also those that are not finite."""

STEP_AXIS_SHARE = 0.8
"""Share of the length of the axis of steps that lies between the smallest and the largest step."""

ENGINE_OFFSET = 5.0
"""Shift of the line of one engine against the next, so that equal errors do not cover each other [pixels]."""

TRIANGLE_OFFSET = 10.0
"""Distance of an order triangle below its line [pixels]."""

MIN_LABEL_DISTANCE_X, MIN_LABEL_DISTANCE_Y = 40.0, 14.0
"""Distances between the labels of two order triangles that do not touch [pixels]."""

MAX_LABELS = 6
"""Largest number of labels on the axis of errors."""


@dataclass(frozen=True)
class Triangle:
    """Triangle below a falling line, whose longest side has the slope of its order."""

    points: str
    label: str
    x: float
    y: float


@dataclass(frozen=True)
class Line:
    """Errors of one engine: points in pixels, and the order triangle of a line that falls.

    `changed` has the points with the setting that is the cause of the error.
    """

    engine: str
    number: int
    points: tuple[tuple[float, float], ...]
    changed: tuple[tuple[float, float], ...] = ()
    triangle: Triangle | None = None


@dataclass(frozen=True)
class Plot:
    """One figure of a case: its axes and the line of each engine."""

    title: str
    exact: str
    x_ticks: tuple[tuple[float, str], ...]
    y_ticks: tuple[tuple[float, int], ...]
    tolerance_y: float
    lines: tuple[Line, ...]

    left: float = LEFT
    right: float = WIDTH - RIGHT
    top: float = TOP
    bottom: float = HEIGHT - BOTTOM


def plots(case: Entry, steps: Sequence[float], engines: Sequence[str]) -> list[Plot]:
    """Return the plots of a case, one for each figure that is not within the tolerance in every engine."""
    named = figures_by_name(case).values()
    return [_plot([*found.values()], steps, engines) for found in named if not _is_within(found)]


def all_within(case: Entry) -> list[str]:
    """Return the names of the figures that are within the tolerance in every engine."""
    return [name for name, found in figures_by_name(case).items() if _is_within(found)]


def _is_within(figures: Mapping[str, Entry]) -> bool:
    return all(each["verdict"] == "within" for each in figures.values())


def _plot(figures: Sequence[Entry], steps: Sequence[float], engines: Sequence[str]) -> Plot:
    first = figures[0]
    axes = _Axes.around(figures, steps)
    lines: list[Line] = []
    for figure in figures:
        number = engines.index(figure["engine"])
        aside = ENGINE_OFFSET * (number - 0.5 * (len(engines) - 1))
        points = axes.points(figure["errors"], aside)
        cause = figure["attribution"]
        changed = () if cause is None else axes.points(cause["errors"][-1], aside)
        placed = [each.triangle for each in lines if each.triangle is not None]
        triangle = None if figure["order"] is None else _triangle(figure["order"], points, axes, placed)
        lines.append(Line(figure["engine"], number, points, changed, triangle))
    return Plot(
        figure_name(first),
        quantity_text(first["exact"], first["unit"]),
        tuple((axes.x(dt), step_text(dt)) for dt in steps),
        axes.labels(),
        axes.y(first["tolerance"]),
        tuple(lines),
    )


def _triangle(
    order: float, points: Sequence[tuple[float, float]], axes: _Axes, placed: Sequence[Triangle]
) -> Triangle | None:
    """Return the triangle below an interval of a line, the steepest where there is room; None without any."""
    intervals = sorted(pairwise(points), key=lambda pair: pair[0][1] - pair[1][1])
    for (right, upper), (left, lower) in intervals if order <= MAX_ORDER else ():
        half = 0.25 * (right - left)
        rise = axes.slope(order) * 2.0 * half
        x, y = 0.5 * (left + right), 0.5 * (upper + lower) + TRIANGLE_OFFSET
        corners = ((x - half, y + 0.5 * rise), (x + half, y - 0.5 * rise), (x + half, y + 0.5 * rise))
        found = Triangle(
            " ".join(f"{a:.1f},{b:.1f}" for a, b in corners), f"{order:.1f}", x + half + 3.0, y + 4.0
        )
        free = all(
            abs(found.x - each.x) > MIN_LABEL_DISTANCE_X or abs(found.y - each.y) > MIN_LABEL_DISTANCE_Y
            for each in placed
        )
        if free and corners[0][1] <= HEIGHT - BOTTOM:
            return found
    return None


@dataclass(frozen=True)
class _Axes:
    """Logarithmic axes that span the steps, and powers of ten of the errors."""

    steps: tuple[float, ...]
    low: int
    high: int

    @classmethod
    def around(cls, figures: Sequence[Entry], steps: Sequence[float]) -> _Axes:
        """Return the axes that show the errors of some figures, and the tolerance."""
        tolerance = min(each["tolerance"] for each in figures)
        rows = [each["errors"] for each in figures]
        rows += [each["attribution"]["errors"][-1] for each in figures if each["attribution"] is not None]
        errors = [min(as_number(error), MAX_ERROR) for row in rows for error in row]
        least = tolerance * 10.0**-DECADES_BELOW
        low = math.floor(math.log10(max(min([*errors, tolerance]), least)))
        high = math.ceil(math.log10(max([*errors, 10.0 * tolerance])))
        return cls(tuple(steps), low, max(high, low + 1))

    def x(self, dt: float) -> float:
        """Return the place of a step, which is the middle where there is only one [pixels]."""
        return LEFT + (0.5 if self._span == 0.0 else self._part(dt)) * (WIDTH - LEFT - RIGHT)

    def y(self, error: float | None) -> float:
        """Return the place of an error, on an edge where it lies outside [pixels]."""
        number = as_number(error)
        power = self.high if number >= MAX_ERROR else math.log10(max(number, 10.0**self.low))
        part = (min(power, self.high) - self.low) / (self.high - self.low)
        return HEIGHT - BOTTOM - part * (HEIGHT - TOP - BOTTOM)

    def points(self, errors: Sequence[float | None], aside: float) -> tuple[tuple[float, float], ...]:
        """Return the places of the errors, moved aside by some pixels.

        Fewer errors than steps belong to the smallest.
        """
        steps = self.steps[len(self.steps) - len(errors) :]
        return tuple((self.x(dt) + aside, self.y(error)) for dt, error in zip(steps, errors, strict=True))

    def slope(self, order: float) -> float:
        """Return the pixels by which a line of that order rises for each pixel to the right."""
        decade_x = STEP_AXIS_SHARE * (WIDTH - LEFT - RIGHT) / self._span
        decade_y = (HEIGHT - TOP - BOTTOM) / (self.high - self.low)
        return order * decade_y / decade_x

    def labels(self) -> tuple[tuple[float, int], ...]:
        """Return the places of powers of ten, and the powers."""
        every = max(1, math.ceil((self.high - self.low) / (MAX_LABELS - 1)))
        powers = range(self.low, self.high + 1, every)
        return tuple((self.y(10.0**power), power) for power in powers)

    @property
    def _span(self) -> float:
        return math.log10(max(self.steps) / min(self.steps))

    def _part(self, dt: float) -> float:
        return 0.5 - 0.5 * STEP_AXIS_SHARE + STEP_AXIS_SHARE * math.log10(dt / min(self.steps)) / self._span
