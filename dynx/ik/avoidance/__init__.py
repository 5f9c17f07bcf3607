"""Collisions in inverse kinematics: which bodies stay how far apart, and how near they are.

A scene makes an `Avoidance` (`dynx.world.Scene.avoidance`); this package knows no scene.
`dynx.ik.clear_solutions` finds configurations that keep the margins.
"""

from dynx.ik.avoidance.avoidance import Avoidance, AvoidanceSource, NearPair
from dynx.ik.avoidance.parts import Pair, Part

__all__ = ["Avoidance", "AvoidanceSource", "NearPair", "Pair", "Part"]
