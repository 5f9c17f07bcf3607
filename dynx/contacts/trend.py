"""Trend of an error along a series of steps, or of values of a setting: none, falling or staying.

An error that falls does so in every interval of the series, at an order of at least `LEAST_ORDER`. Below the
tolerance errors may be rounding, so they need not fall any further.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

LEAST_ORDER = 0.5
"""Least order at which an error counts as falling: half the step leaves at most 71 % of it."""

ROUNDING = 1e-3
"""Fraction of the tolerance below which an error counts as that fraction in the fit of the order."""

TrendKind = Literal["exact", "falls", "stays"]


@dataclass(frozen=True)
class Trend:
    """Trend of a series of errors, with the order at which they fall (None unless they do)."""

    kind: TrendKind
    order: float | None = None


def judge(steps: Sequence[float], errors: Sequence[float], tolerance: float) -> Trend:
    """Return the trend of `errors` at `steps`, largest step first.

    The order is the slope of the straight line through the logarithms of the errors from the largest step to
    the first error within the tolerance.
    """
    if not all(math.isfinite(error) for error in errors):
        return Trend("stays")
    above = [error > tolerance for error in errors]
    if not any(above):
        return Trend("exact")
    # The last error above the tolerance, and the one after it if there is one.
    last = len(above) - 1 - above[::-1].index(True)
    used = min(last + 2, len(errors))
    if used < 2:
        return Trend("stays")
    # An error of 0 would have no logarithm; errors below the tolerance may be rounding.
    logs = [math.log(max(error, ROUNDING * tolerance)) for error in errors[:used]]
    sizes = [math.log(step) for step in steps[:used]]
    orders = [(a - b) / (s - t) for (a, b), (s, t) in zip(pairwise(logs), pairwise(sizes), strict=True)]
    if min(orders) < LEAST_ORDER:
        return Trend("stays")
    return Trend("falls", float(np.polyfit(sizes, logs, 1)[0]))
