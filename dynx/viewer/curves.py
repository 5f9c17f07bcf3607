"""Curves over time in the panel, drawn up to the time that is shown."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from dynx.spatial.scalar import Floats
from dynx.viewer.colours import DASHES, SERIES, css
from dynx.viewer.library import uplot

MAX_POINTS = 400
"""Largest number of points of a curve."""

UPDATES_PER_SECOND = 5.0
"""Largest rate at which curves are redrawn while a motion plays."""

VALUES_PER_SECOND = 20_000.0
"""Largest number of values of one plot that are sent a second while a motion plays."""

_SMALL = 0.05
"""Values below which a plot shows a power of ten: the numbers at its axis have three decimals."""
_NOTHING = 1e-12
"""Values below which they count as zero."""

_PADDING = (8, 16, 0, 0)
"""Space above, right of, below and left of a plot for half of a number at the end of an axis [pixels]."""

_LARGEST_LEGEND = 7
"""Number of curves up to which the legend is shown."""


class Curves:
    """Some quantities over time; what comes after the time that is shown is left out."""

    def __init__(self, gui: Any, title: str, t: Floats, values: Floats, names: Sequence[str]) -> None:
        """`values` (n, m) are those of m quantities `names` at the times t (n,) [s]."""
        picked = np.unique(np.linspace(0, len(t) - 1, min(len(t), MAX_POINTS)).round().astype(int))
        self._t, self._values = np.ascontiguousarray(t[picked]), np.array(values[picked], dtype=np.float64)
        self._drawn_at = -math.inf
        self._period = max(1.0 / UPDATES_PER_SECOND, self._values.size / VALUES_PER_SECOND)
        power = _power(self._values)
        if power:
            self._values *= 10.0**power
            title = f"{title} x 1e-{power}"
        finite = self._values[np.isfinite(self._values)]
        low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
        margin = 0.05 * (high - low) or max(abs(high), 1.0) * 0.05
        self._plot = gui.add_uplot(
            self._data(len(self._t)),
            series=(
                uplot.Series(label="t"),
                *(_series(k, name) for k, name in enumerate(names)),
            ),
            title=title,
            scales={
                "x": uplot.Scale(time=False, auto=False, range=(float(t[0]), float(t[-1]))),
                "y": uplot.Scale(range=(low - margin, high + margin)),
            },
            legend=uplot.Legend(show=len(names) <= _LARGEST_LEGEND),
            aspect=1.6,
            padding=_PADDING,
        )

    def put(self, now: float, *, at_once: bool = False) -> None:
        """Draw the curves up to the time `now` [s]; not more often than the page can follow, or `at_once`."""
        clock = time.monotonic()
        if not at_once and clock - self._drawn_at < self._period:
            return
        self._drawn_at = clock
        self._plot.data = self._data(int(np.searchsorted(self._t, now + 1e-9, side="right")))

    def _data(self, count: int) -> tuple[Floats, ...]:
        shown = self._values.copy()
        shown[count:] = np.nan
        return (self._t, *(np.ascontiguousarray(column) for column in shown.T))


def _power(values: Floats) -> int:
    """Return the power of ten by which values are multiplied, so that three decimals show them."""
    finite = values[np.isfinite(values)]
    largest = float(np.abs(finite).max(initial=0.0))
    if largest >= _SMALL or largest < _NOTHING:
        return 0
    return 3 * math.ceil(-math.log10(largest) / 3.0)


def _series(k: int, name: str) -> Any:
    """Return the look of the curve with the number k."""
    stroke, (look, dashes) = css(SERIES[k % len(SERIES)]), DASHES[k // len(SERIES) % len(DASHES)]
    if dashes is None:
        return uplot.Series(label=name, stroke=stroke, width=2)
    # The legend shows only the colour.
    return uplot.Series(label=f"{name} ({look})", stroke=stroke, width=2, dash=dashes)
