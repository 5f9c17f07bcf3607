"""DX519 mass-beyond-size: A body without shapes is far too heavy for the distances between its joints.

Where no shape tells the size of a body (no shapes, or meshes that are missing), the distances from its frame
to its centres of mass and to the joints that it carries do, or those of its neighbours if they are larger; a
fiftieth of the sum of such distances in the whole robot is the least that counts. Reported are bodies of more
than 1e7 kg per cube of that length. In example-robot-data no body has more than 2e4 (an ankle of 0.6 kg
between joints 3 cm apart): 500 times less.

Usual causes: a mass in grams; a tensor or a mass that an exporter computed from a mesh in millimetres, which
makes a finger of 56 g one of 56 tonnes; an extra digit.

All engines use the numbers unchanged. Torques of all joints before such a body are those of that body alone,
and inverse dynamics of one engine may refuse it (DX119). Bodies with shapes are in DX517.

The file does not contain the true mass, so no edit removes the cause.
"""

import math
from collections.abc import Iterable

import numpy as np

from dynx.rules import Case, Detection, Rule
from dynx.rules.geometry import body_extents
from dynx.rules.inertia import rigid_groups
from dynx.spatial.scalar import Floats

_BOUND = 1e7
"""Largest mass per cube of the length [kg/m^3]."""

_LEAST_SHARE, _LEAST_ROBOT = 0.02, 1e-3
"""Least length that counts, as a share of the sum of all; least sum [m] of a robot that is examined."""


class MassBeyondSize(Rule):
    kind = "practice"
    advice = "Give the mass in kilograms."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the heaviest link of each such body."""
        lengths = _lengths(case)
        shaped = {group.head for group, _ in body_extents(case)}
        for group in dict.fromkeys(rigid_groups(case).values()):
            masses = {name: case.model.inertial(name).mass for name in group.links}
            mass, heaviest = math.fsum(masses.values()), max(masses, key=lambda name: masses[name])
            length = lengths.get(group.head, math.inf)
            if group.head not in shaped and mass > _BOUND * length**3:
                message = f"the body has {mass:.3g} kg, and the joints around it are {length:.2g} m apart"
                yield Detection(heaviest, None, case.model.inertial(heaviest).line, message)


def _lengths(case: Case) -> dict[str, float]:
    """Return the length [m] that tells the size of each rigid group, by its head; none for a tiny robot."""
    groups = rigid_groups(case)
    points: dict[str, list[Floats]] = {group.head: [np.zeros(3)] for group in groups.values()}
    for link in case.model.links:
        if link.inertial is not None and link.inertial.mass > 0.0:
            points[groups[link.name].head].append(_in_head(case, link.name, link.inertial.origin.xyz))
    neighbours: dict[str, list[str]] = {head: [head] for head in points}
    for joint in case.model.joints:
        parent, child = groups[joint.parent].head, groups[joint.child].head
        if parent != child:
            points[parent].append(_in_head(case, joint.parent, joint.origin.xyz))
            neighbours[parent].append(child)
            neighbours[child].append(parent)
    own = {head: _diameter(np.stack(found)) for head, found in points.items()}
    robot = math.fsum(own.values())
    if robot < _LEAST_ROBOT:
        return {}
    least = _LEAST_SHARE * robot
    return {head: max(least, *(own[each] for each in near)) for head, near in neighbours.items()}


def _in_head(case: Case, link: str, xyz: tuple[float, float, float]) -> Floats:
    """Return a point given in the frame of a link in that of the head of its rigid group (3,)."""
    R, p = rigid_groups(case)[link].poses[link]
    return np.asarray(R @ np.array(xyz) + p, dtype=np.float64)


def _diameter(points: Floats) -> float:
    """Return the diagonal of the bounding box of points (n, 3)."""
    return float(np.linalg.norm(points.max(axis=0) - points.min(axis=0)))
