"""DX503 center-of-mass-outside-geometry: The centre of mass lies outside the bounding box of the link's
shape.

Mass cannot be negative, so the centre of mass of a body lies within its convex hull, and so within its
bounding box. The rule uses the box, along the axes of the link frame, of all shapes of the link and of links
rigidly connected to it, widened by a hundredth of its diagonal for shapes that are slightly too small.

Usual causes: the ``<origin>`` of ``<inertial>`` is in millimetres; it is given in the frame of the CAD
assembly or of the parent, not of the link; it was mirrored for the other side and lost a sign; the mesh was
moved by the ``<origin>`` of ``<visual>`` and the inertial was not.

All engines use the numbers unchanged: gravity torques are equally wrong in all of them.

The file does not contain the true centre of mass, so no edit removes the cause.
"""

from collections.abc import Iterable

import numpy as np

from dynx.rules import Case, Detection, Rule
from dynx.rules.geometry import group_extents

_MARGIN = 0.01
"""Ratio of the margin of the box to its diagonal."""


class CenterOfMassOutsideGeometry(Rule):
    kind = "practice"
    advice = "Give the origin of the inertial in metres and in the frame of its own link."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links whose centre of mass is outside, and by how much."""
        for link, extent in group_extents(case):
            assert link.inertial is not None
            low, high = extent.box()
            center = link.inertial.origin.matrix[:3, 3]
            outside = float(np.max(np.maximum(low - center, center - high)))
            if outside > _MARGIN * extent.diagonal():
                message = (
                    f"the centre of mass is {outside:.3g} m outside the box of {extent.diagonal():.3g} m "
                    "across that holds the link's shape"
                )
                yield Detection(link.name, None, link.inertial.line, message)
