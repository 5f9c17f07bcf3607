"""Distances of convex shapes, each between a lower and an upper bound that can be checked."""

from dynx.distance.cores import ConvexShape, Hull
from dynx.distance.distance import Distance, distance, separation, support

__all__ = ["ConvexShape", "Distance", "Hull", "distance", "separation", "support"]
