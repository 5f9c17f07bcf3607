"""Steps of a world for some time, with loads from a function and in step with the clock."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import Any

from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.model.numbers import positive_seconds

TIME_ROUNDING = 1e-9
"""Tolerance within which the ratio of two times counts as a whole number."""


def run_for(
    duration: float,
    dt: float,
    step: Callable[..., None],
    fixed: Mapping[str, Any],
    loads: Callable[[], object] | None,
    *,
    real_time: bool,
) -> None:
    """Take steps for `duration` [s], rounded up to a multiple of `dt`, with the loads of a function or fixed
    ones."""
    n = max(1, math.ceil(positive_seconds("duration", duration) / dt - TIME_ROUNDING))
    if loads is None and not real_time:
        step(n, **fixed)
        return
    began = time.perf_counter()
    for k in range(n):
        step(1, **(fixed if loads is None else _loads_of(loads, fixed)))
        if real_time:
            time.sleep(max(0.0, began + (k + 1) * dt - time.perf_counter()))


def _loads_of(loads: Callable[[], object], fixed: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of the next step: those that `loads` gives, or else the fixed ones.

    Raises ArgumentError unless it gives a dict of torques, motors and forces.
    """
    given = loads()
    if not isinstance(given, Mapping):
        raise ArgumentError(f"loads returned {shown(given)}; wanted a dict of {', '.join(fixed)}")
    for name in given:
        if name not in fixed:
            raise UnknownNameError(f"loads returned {shown(name)}{nearest(str(name), fixed)}")
    return {**fixed, **given}
