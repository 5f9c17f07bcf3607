"""Checks of the options of tasks."""

from __future__ import annotations

from collections.abc import Sequence

from dynx.errors import ArgumentError, nearest, shown


def refuse_unknown_choice(name: str, value: object, known: Sequence[str]) -> None:
    """Raise ArgumentError for an option that is not one of the `known` words."""
    if value not in known:
        raise ArgumentError(f"{name} is {shown(value)}{nearest(str(value), known)}")
