"""Geometry of the plots of the page: errors over the step on logarithmic axes, one line for each engine.

The template draws it as SVG in the page, so that lines and text take the colours of a light or a dark page.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from dynx.cli.contacts.wording import (
    MAX_ORDER,
    as_number,
    figure_name,
    figures_by_name,
    quantity_text,
    step_text,
)

Entry = Mapping[str, Any]

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
