"""Checks of the options of tasks."""

from __future__ import annotations

from collections.abc import Sequence

from dynx.errors import ArgumentError, nearest, shown
from dynx.model.numbers import MAX_MAGNITUDE, is_real


def refuse_unknown_choice(name: str, value: object, known: Sequence[str]) -> None:
    """Raise ArgumentError for an option that is not one of the `known` words."""
    if value not in known:
        raise ArgumentError(f"{name} is {shown(value)}{nearest(str(value), known)}")


def refuse_unphysical(name: str, value: object, unit: str, *, zero: bool = False) -> None:
    """Raise ArgumentError for an option that is no number above 0, or with `zero` of at least 0."""
    if not is_real(value) or not (value >= 0.0 if zero else value > 0.0) or not value < MAX_MAGNITUDE:
        wanted = "of at least 0" if zero else "above 0"
        raise ArgumentError(f"{name} is {shown(value)}; wanted a number {wanted} [{unit}]")
