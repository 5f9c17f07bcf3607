"""Shapes, frames, constraints and configurations that two robots have at different places of their bodies.

Several sets of elements may explain a difference of inertias. What else is fixed to the links says which of
them moved: a link whose shapes moved along stands at another place, and its inertia is as it was.
"""

from __future__ import annotations

from dataclasses import replace

from dynx.same.attributes import Attribute, frame_differences
from dynx.same.configurations import configuration_pairs
from dynx.same.constraints import equality_differences
from dynx.same.decimals import fifty_digits
from dynx.same.fit import Fit
from dynx.same.shapes import SHAPE_KINDS, matched_shapes


def count_misplaced(found: Fit, tolerance: float, body: int | None = None) -> int:
    """Count the shapes and frames that stand elsewhere in their bodies, the constraints that hold other
    places, and the configurations that differ; of a description that leaves these open there are none.

    With the number of a `body` of the second robot, shapes and frames of that body alone count.
    """
    ours, theirs = found.ours.model, found.theirs.model
    of_bodies = tuple(each for each in found.bodies if body is None or each.theirs == body)
    count = 0
    for each in of_bodies:
        for kind in SHAPE_KINDS:
            pair = found.ours, found.theirs, each.ours, each.theirs
            count += matched_shapes(kind, *pair, each.D, tolerance).count_misplaced()
    with fifty_digits():
        frames = frame_differences(ours, theirs, replace(found, bodies=of_bodies), tolerance)
        constraints = equality_differences(ours, theirs, found, tolerance)
        count += sum(isinstance(each, Attribute) for each in (*frames, *constraints))
        pairs = configuration_pairs(ours, theirs, found, tolerance)
        count += sum(None not in (each.mine, each.other) and not each.equal for each in pairs)
    return count
