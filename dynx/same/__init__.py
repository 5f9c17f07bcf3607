"""Equality of two robot descriptions for every state, or the elements of the file that differ."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dynx.registry import moved_names

if TYPE_CHECKING:
    from dynx.same.comparison import same_robot
    from dynx.same.report import SameReport

__all__ = ["SameReport", "same_robot"]

# Hidden from type checkers, which would take any name for an attribute: they know the imports above.
if not TYPE_CHECKING:
    __getattr__ = moved_names(
        __name__, {}, {"SameReport": "dynx.same.report", "same_robot": "dynx.same.comparison"}
    )
