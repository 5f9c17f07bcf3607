"""DX501 inertia-beyond-geometry: A moment of inertia is larger than any body of the link's shape and mass can
have.

A body of mass m that reaches at most R from an axis has a moment of inertia about that axis of at most m R^2,
reached only if all mass is at the farthest point; real parts have a third of that or less. The rule uses the
principal axes of the tensor through the centre of mass, the reach of all shapes of the link and of links
rigidly connected to it, and reports moments that no distribution of the mass can have. Shapes are enlarged,
never reduced: a mesh counts as its bounding box.

Usual causes: the tensor is in kg mm^2 or g mm^2 where URDF requires kg m^2; it was taken about the link
frame, not the centre of mass; the mesh is scaled by 0.001 and the tensor is not; a placeholder.

All engines use the numbers unchanged, so they agree with each other, but not with the real robot: torques are
too large, and controllers tuned on them too stiff.

The file does not contain the true tensor, so no edit removes the cause.
"""

from collections.abc import Iterable, Iterator

import numpy as np

from dynx.model.elements import Inertial
from dynx.rules import Case, Detection, Rule
from dynx.rules.geometry import Extent, group_extents

_ROUNDING = 1e-9
"""Relative margin for rounding: a spherical shell on a sphere reaches the bound exactly."""


class InertiaBeyondGeometry(Rule):
    kind = "practice"
    advice = "Export the tensor again, in kg m^2 and about the centre of mass."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links with such a moment, one detection each, for the moment furthest beyond."""
        for link, extent in group_extents(case):
            assert link.inertial is not None
            excess, moment, bound = max(_against_bounds(link.inertial, extent))
            if excess > 1.0 + _ROUNDING:
                message = (
                    f"a principal moment is {moment:.3g} kg m^2, {excess:.3g} times the {bound:.3g} that "
                    f"{link.inertial.mass:.3g} kg have at the farthest point of the link's shape"
                )
                yield Detection(link.name, None, link.inertial.line, message)


def _against_bounds(inertial: Inertial, extent: Extent) -> Iterator[tuple[float, float, float]]:
    """Yield each principal moment: how many times its bound it is, itself, and the bound [kg m^2]."""
    T_link_inertial = inertial.origin.matrix
    moments, axes = np.linalg.eigh(inertial.tensor)
    directions = (T_link_inertial[:3, :3] @ axes).T
    for moment, direction in zip(moments.tolist(), directions, strict=True):
        bound = inertial.mass * extent.reach_from_axis(T_link_inertial[:3, 3], direction) ** 2
        yield moment / bound if bound > 0.0 else (np.inf if moment > 0.0 else 0.0), moment, bound
