"""DX501 inertia-beyond-geometry: A moment of inertia is larger than any body of the link's shape and mass can
have.

A body of mass m that reaches at most R from an axis has a moment of inertia about that axis of at most
m R^2, which it has if all of its mass sits at the far end; real parts have a third of that or less. The
rule takes the principal axes of the tensor through the centre of mass, the reach of all shapes of the
link and of links welded to it, and reports the moments that no distribution of the mass could have.
Shapes are rounded up, never down: a mesh counts as the box that holds it.

The usual reasons: the tensor is in kg mm^2 or g mm^2 where URDF wants kg m^2; it was taken about the link
frame, not the centre of mass; the mesh is scaled by 0.001 and the tensor is not; a placeholder.

All engines use the numbers as they stand, so they agree with one another, and on a motion that the real
robot does not make: torques are too large, and controllers tuned on them too stiff.

Nothing in the file says what the true tensor is, so there is no remedy by edit.
"""

from collections.abc import Iterable, Iterator

import numpy as np

from dynx.model.elements import Inertial
from dynx.rules import Case, Detection, Rule
from dynx.rules.geometry import Extent, welded_extents

_ROUNDING = 1e-9
"""Of a sphere's shell on a sphere's shape the bound is reached exactly; this is beyond any rounding."""


class InertiaBeyondGeometry(Rule):
    kind = "practice"
    advice = "Export the tensor again, in kg m^2 and about the centre of mass."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Links with such a moment, one detection each, for the moment furthest beyond."""
        for link, extent in welded_extents(case):
            assert link.inertial is not None
            excess, moment, bound = max(_against_bounds(link.inertial, extent))
            if excess > 1.0 + _ROUNDING:
                message = (
                    f"a principal moment is {moment:.3g} kg m^2, {excess:.3g} times the {bound:.3g} that "
                    f"{link.inertial.mass:.3g} kg have at the farthest point of the link's shape"
                )
                yield Detection(link.name, None, link.inertial.line, message)


def _against_bounds(inertial: Inertial, extent: Extent) -> Iterator[tuple[float, float, float]]:
    """Each principal moment: how many times its bound it is, itself, and the bound [kg m^2]."""
    T_link_inertial = inertial.origin.matrix
    moments, axes = np.linalg.eigh(inertial.tensor)
    directions = (T_link_inertial[:3, :3] @ axes).T
    for moment, direction in zip(moments.tolist(), directions, strict=True):
        bound = inertial.mass * extent.reach_from_axis(T_link_inertial[:3, 3], direction) ** 2
        yield moment / bound if bound > 0.0 else (np.inf if moment > 0.0 else 0.0), moment, bound
