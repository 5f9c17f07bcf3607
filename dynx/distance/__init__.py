"""Distances of convex shapes, each between a lower and an upper bound that can be checked; contact points.

Contact points are imported when they are first used.
"""

from typing import TYPE_CHECKING

from dynx.distance.cores import ConvexShape, Hull
from dynx.distance.distance import Distance, distance, separation, support
from dynx.registry import moved_names

if TYPE_CHECKING:
    from dynx.distance.contact_manifold import ContactPoint, contact_points
    from dynx.distance.placed_solids import PlacedSolid

__all__ = [
    "ContactPoint",
    "ConvexShape",
    "Distance",
    "Hull",
    "PlacedSolid",
    "contact_points",
    "distance",
    "separation",
    "support",
]

_HOME = {
    "ContactPoint": "dynx.distance.contact_manifold",
    "PlacedSolid": "dynx.distance.placed_solids",
    "contact_points": "dynx.distance.contact_manifold",
}

# Hidden from type checkers, which would take any name for an attribute.
if not TYPE_CHECKING:
    __getattr__ = moved_names(__name__, {}, _HOME)
