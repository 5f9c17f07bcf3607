"""Distances of convex shapes, each between a lower and an upper bound that can be checked."""

from typing import TYPE_CHECKING

from dynx.distance.cores import ConvexShape, Hull
from dynx.distance.distance import Distance, distance, separation, support
from dynx.registry import moved_names

__all__ = ["ConvexShape", "Distance", "Hull", "distance", "separation", "support"]

# Hidden from type checkers, which would take any name for an attribute.
if not TYPE_CHECKING:
    __getattr__ = moved_names(__name__, {})
