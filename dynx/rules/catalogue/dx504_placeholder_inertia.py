"""DX504 placeholder-inertia: The inertia is a placeholder: the unit matrix, or one tensor for links of
different mass.

Two patterns are reported. A tensor that is exactly the unit matrix: 1 kg m^2 about every axis is the inertia
of a steel ball of 0.15 m radius and 111 kg, and not of a usual link. And one tensor with three equal moments
(0.001 in many tutorials) that at least three links share although their masses differ: the inertias of real
links would differ too.

All engines use the numbers unchanged. With an identity tensor on a link of a few hundred grams the inertia of
the whole arm is that of the placeholder: torques and gains tuned on them are useless.

The file does not contain the true tensor, so no edit removes the cause. Inertias from the shapes, with mass
spread evenly, are a better guess than any placeholder.
"""

from collections import defaultdict
from collections.abc import Iterable

from dynx.model import Inertial
from dynx.rules import Case, Detection, Rule

_LINKS = 3
"""Smallest number of links that share a tensor with equal moments."""


class PlaceholderInertia(Rule):
    kind = "practice"
    advice = "Compute the inertia from the CAD model or from the link's shape and mass."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links with mass whose tensor is the unit matrix, or shared by links of different mass."""
        masses = defaultdict(list)
        for link in case.model.links:
            if link.inertial is not None and (moment := _equal_moments(link.inertial)):
                masses[moment].append(link.inertial.mass)
        for link in case.model.links:
            moment = None if link.inertial is None else _equal_moments(link.inertial)
            if link.inertial is None or not moment:
                continue
            if moment == 1.0:
                message = f"the inertia of {link.inertial.mass:.6g} kg is the unit matrix"
            elif len(masses[moment]) >= _LINKS and len(set(masses[moment])) > 1:
                message = (
                    f"the inertia is {moment:.6g} kg m^2 about every axis, as on {len(masses[moment])} links "
                    f"from {min(masses[moment]):.6g} to {max(masses[moment]):.6g} kg"
                )
            else:
                continue
            yield Detection(link.name, None, link.inertial.line, message)


def _equal_moments(inertial: Inertial) -> float | None:
    """Return the one moment of a diagonal tensor with three equal moments on a link with mass."""
    off_diagonal = (inertial.ixy, inertial.ixz, inertial.iyz)
    if inertial.mass == 0.0 or any(off_diagonal) or not inertial.ixx == inertial.iyy == inertial.izz:
        return None
    return inertial.ixx
