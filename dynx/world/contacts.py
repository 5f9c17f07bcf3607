"""Contacts, nearest points and ray hits, by the names of bodies and links, in world axes.

A name is that of a body of the scene, or ``robot/link`` for a link of a robot.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from dynx.spatial.scalar import Floats

MAX_RAY_LENGTH = 1e4
"""Length of rays without a given one [m]."""


@dataclass(frozen=True, eq=False)
class Contact:
    """A point at which two bodies touch, with the force of the last step there.

    The force on `a` is ``normal_force * normal + friction_force``; that on `b` is its opposite.
    """

    a: str
    b: str
    point_a: Floats
    """Point (3,) on the surface of `a` [m]."""
    point_b: Floats
    """Point (3,) on the surface of `b` [m]."""
    normal: Floats
    """Unit vector (3,) from `b` to `a`."""
    distance: float
    """Distance [m] of the surfaces along the normal; negative where they penetrate."""
    normal_force: float
    """Force along the normal, on `a` [N]; at least 0."""
    friction_force: Floats
    """Force (3,) on `a` perpendicular to the normal [N]. On a bent surface, for which Drake has one contact,
    friction may also pull along the mean normal."""

    @property
    def point(self) -> Floats:
        """Middle (3,) of the two points [m]."""
        return 0.5 * (self.point_a + self.point_b)

    @property
    def force(self) -> Floats:
        """Force (3,) on `a` [N]."""
        return self.normal_force * self.normal + self.friction_force


@dataclass(frozen=True, eq=False)
class MeanContact:
    """Mean contact force and moment between two bodies over an interval.

    Force and moment times the length of the interval are the impulses of the contacts.
    """

    a: str
    b: str
    force: Floats
    """Mean force (3,) on `a` [N]; that on `b` is its opposite."""
    moment: Floats
    """Mean moment (3,) of the forces on `a` about the origin of the world [N m]."""
    normal_force: float
    """Mean of the sum of the forces along the normals [N]."""
    touching: float
    """Share of the interval in which the two had a contact, from 0 to 1."""


@dataclass(frozen=True, eq=False)
class ClosestPoints:
    """The nearest points of two bodies or links."""

    a: str
    b: str
    point_a: Floats
    """Point (3,) on the surface of `a` [m]."""
    point_b: Floats
    """Point (3,) on the surface of `b` [m]."""
    normal: Floats
    """Unit vector (3,) from `b` to `a`."""
    distance: float
    """Distance [m] of the surfaces; negative where they penetrate."""


class RayHits(NamedTuple):
    """First hit of each of n rays."""

    names: tuple[str | None, ...]
    """Name of the part that each ray hits first; None where it hits nothing."""
    distance: Floats
    """Distance (n,) from the origin of the ray [m]; infinity without a hit."""
    points: Floats
    """Point hit (n, 3) [m]; NaN without a hit."""
    normals: Floats
    """Unit normal (n, 3) of the surface, outward; NaN without a hit."""
