"""Trend of an error along a series of steps, or of values of a setting: none, falling or staying.

Errors below the tolerance may be rounding and count as the tolerance. An error falls if it does so in every
interval of the series that begins above the tolerance: at an order of at least `MIN_ORDER`, or to the
tolerance. The order is the slope of the straight line through the logarithms of all errors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

MIN_ORDER = 0.5
"""Least order at which an error counts as falling: half the step leaves at most 71 % of it."""

TrendKind = Literal["within", "falls", "stays"]


@dataclass(frozen=True)
class Trend:
    """Trend of a series of errors, with the order at which they fall (None unless they do)."""

    kind: TrendKind
    order: float | None = None


def judge(steps: Sequence[float], errors: Sequence[float], tolerance: float) -> Trend:
    """Return the trend of `errors` at `steps`, largest step first."""
    if not all(math.isfinite(error) for error in errors):
        return Trend("stays")
    counted = [max(error, tolerance) for error in errors]
    if max(counted) <= tolerance:
        return Trend("within")
    if len(counted) < 2:
        return Trend("stays")
    logs = [math.log(error) for error in counted]
    sizes = [math.log(step) for step in steps]
    for (a, b), (s, t) in zip(pairwise(logs), pairwise(sizes), strict=True):
        to_tolerance = b == math.log(tolerance)
        if not to_tolerance and a - b < MIN_ORDER * (s - t):
            return Trend("stays")
    return Trend("falls", float(np.polyfit(sizes, logs, 1)[0]))
