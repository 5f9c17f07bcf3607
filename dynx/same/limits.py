"""Limits of two joints that correspond, compared in the sign of the first one's position."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Literal

from dynx.model.elements import Limits
from dynx.model.sdf.reader import UNLIMITED

LimitKind = Literal["lower limit", "upper limit", "velocity limit", "effort limit"]


def differs(first: float, second: float, tolerance: float) -> bool:
    """Check whether two values differ by more than `tolerance` of the larger one; from 1e16 on they limit
    nothing, as SDF has it."""
    size = max(abs(first), abs(second))
    if min(first, second) >= UNLIMITED or max(first, second) <= -UNLIMITED:
        return False
    return first != second and (math.isinf(size) or abs(first - second) > tolerance * size)


def limit_pairs(first: Limits, second: Limits, sign: int) -> tuple[tuple[LimitKind, float, float], ...]:
    """Return each limit of two joints; positions of the second joint are those of the first times `sign`."""
    low, high = sorted((first.lower, first.upper))
    other_low, other_high = sorted((sign * second.lower, sign * second.upper))
    return (
        ("lower limit", low, other_low),
        ("upper limit", high, other_high),
        ("velocity limit", first.velocity, second.velocity),
        ("effort limit", first.effort, second.effort),
    )


def limit_differences(
    first: Limits, second: Limits, sign: int, tolerance: float
) -> Iterator[tuple[LimitKind, float, float]]:
    """Yield the limits that differ."""
    yield from (row for row in limit_pairs(first, second, sign) if differs(row[1], row[2], tolerance))
