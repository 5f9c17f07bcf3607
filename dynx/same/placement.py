"""Shapes, frames and constraints that two robots have at different places of their bodies.

Several sets of elements may explain a difference of inertias. What else is fixed to the links says which of
them moved: a link whose shapes moved along stands at another place, and its inertia is as it was.
"""

from __future__ import annotations

from dynx.same.attributes import Attribute, frame_differences
from dynx.same.constraints import equality_differences
from dynx.same.decimals import fifty_digits
from dynx.same.fit import Fit
from dynx.same.shapes import SHAPE_KINDS, matched_shapes


def count_misplaced(found: Fit, tolerance: float) -> int:
    """Count the shapes and frames that stand elsewhere in their bodies, and the constraints that hold other
    places; of a description that leaves constraints open there are none."""
    ours, theirs = found.ours.model, found.theirs.model
    count = 0
    for each in found.bodies:
        for kind in SHAPE_KINDS:
            pair = found.ours, found.theirs, each.ours, each.theirs
            count += matched_shapes(kind, *pair, each.D, tolerance).count_misplaced()
    with fifty_digits():
        frames = frame_differences(ours, theirs, found, tolerance)
        constraints = equality_differences(ours, theirs, found, tolerance)
        count += sum(isinstance(each, Attribute) for each in (*frames, *constraints))
    return count
