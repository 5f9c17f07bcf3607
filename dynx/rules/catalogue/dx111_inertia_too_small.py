"""DX111 inertia-too-small: A moment of inertia is below 1e-14 kg m^2, which MuJoCo refuses.

Some engines compare moments of inertia with fixed small numbers, whatever the size of the robot.

- MuJoCo 4.0.0 refuses a file ("inertia must have positive eigenvalues") in which a principal moment is
  below 1e-14 kg m^2, unless the whole tensor is zero: a thin rod with a moment of 0 about its axis, or
  tensors that are zero but for dust such as -1e-20. It refuses a point mass on a joint ("mass and inertia
  of moving bodies must be larger than mjMINVAL"), and where it fuses links welded together, any step of
  the sum that is still a point or a rod. For links that cannot move it checks the tensor all the same.
- PyBullet 3.2.7 takes dust with a negative moment for zero, which changes nothing. Its simulation holds
  a joint still beyond which the inertia about the axis is below 2.2e-16 kg m^2.
- Pinocchio 4.1.0 and Drake 1.51.1 calculate with the numbers as they stand.

The effect: the file does not load in MuJoCo.

What to do: for a robot of ordinary size such a moment means nothing, and 1e-14 does as well. For a robot of
micrometres change the unit of length or mass.

``dynx doctor --fix`` lumps such a link with what it is welded to, which is the same rigid body; where that is
not enough the moments are raised to 1.5e-14 kg m^2. The report says that the physics changed where that is
more than rounding of the robot's largest inertia. Nothing is done where it would be more than a thousandth
of that.
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from dynx.model.elements import Inertial
from dynx.rules import Case, Detection, Remedy, Rule, measured_on
from dynx.rules.inertia.central import CentralInertia
from dynx.rules.inertia.edits import line_of, with_inertials
from dynx.rules.inertia.merging import lumped_into, written
from dynx.rules.inertia.physical import (
    ENOUGH,
    ROUNDING,
    SMALLEST_MASS,
    SMALLEST_MOMENT,
    clear_fault,
    lift_inside,
    lifted,
    nearest_moments,
    principal_moments,
)
from dynx.rules.inertia.rigid_groups import RigidGroup, rigid_groups

_NEGLIGIBLE = 1e-3
"""Share of the robot's largest inertia that may be added to a body of it."""


class InertiaTooSmall(Rule):
    engines = measured_on("mujoco")
    advice = "Raise the moment to 1e-14 kg m^2, or change the unit for a robot that is really so small."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Links with such a tensor, and moving links that are points or rods with what is welded to them."""
        groups = rigid_groups(case)
        inertials, found = case.inertials, {}
        for name, inertial in inertials.items():
            if inertial is not None and _small(inertial, static=groups[name].static):
                smallest = float(principal_moments(inertial)[0])
                found[name] = f"the principal moment {smallest:.3g} is below {SMALLEST_MOMENT:g} kg m^2"
        for group in dict.fromkeys(groups.values()):
            if group.static or any(name in found for name in group.links):
                continue
            if (what := _thin(group, inertials)) is not None:
                found[group.head] = what
        return [
            Detection(link.name, None, line_of(case, link.name, "inertia"), found[link.name])
            for link in case.model.links
            if link.name in found
        ]

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Lumped with what is welded to them; raised where that is not enough."""
        before, lumps, raised, largest = case, 0, 0, 0.0
        for name in (detection.link for detection in detections):
            if name is None:
                continue
            group = rigid_groups(case)[name]
            still = case.inertials[name]
            if group.static and still is not None and still.mass == 0.0:
                # What the world holds and has no mass has no use for a tensor either.
                case = with_inertials(case, {name: Inertial(0.0, still.origin)})
                raised += 1
                continue
            heavy = [each for each in group.links if case.model.inertial(each).mass > 0.0]
            into = group.head
            if name != into or (len(heavy) > 1 and not group.static):
                links = (into, name) if group.static else tuple(dict.fromkeys((into, *heavy)))
                bodies = lumped_into(case, group, links, into)
                case = with_inertials(case, bodies)
                lumps += 1
            held = case.inertials[into]
            if held is None or not (
                _small(held, static=group.static) or (_is_point(held) and not group.static)
            ):
                continue
            central = CentralInertia.of(held)
            moments, axes = central.principal(held.origin.rpy)
            near = central.about(nearest_moments(moments), axes)
            if lift_inside(near, ENOUGH) > _NEGLIGIBLE * _largest_inertia(before) and not group.static:
                continue
            largest = max(largest, lift_inside(near, ENOUGH))
            case = with_inertials(
                case, {into: written(case, into, CentralInertia.of(lifted(near, ENOUGH)), held)}
            )
            raised += 1
        if not (lumps or raised):
            return None
        parts = [f"lumped {lumps} links with links they are welded to"] if lumps else []
        parts += [f"raised moments of {raised} links to {ENOUGH:g} kg m^2"] if raised else []
        changes_physics = largest > ROUNDING * _largest_inertia(before)
        return Remedy(case, " and ".join(parts), changes_physics=changes_physics)


def _small(inertial: Inertial, *, static: bool) -> bool:
    """Whether MuJoCo refuses the tensor by itself; of a link that moves without mass DX108 speaks."""
    if inertial.mass == 0.0 and not static:
        return False
    if not inertial.tensor.any() or clear_fault(inertial) is not None:
        return False
    return bool(principal_moments(inertial)[0] < SMALLEST_MOMENT)


def _is_point(inertial: Inertial) -> bool:
    return inertial.mass >= SMALLEST_MASS and not inertial.tensor.any()


def _thin(group: RigidGroup, inertials: Mapping[str, Inertial | None]) -> str | None:
    """What is too thin in a moving group where its links are added up, from the head on; None if nothing."""
    total: CentralInertia | None = None
    for count, name in enumerate(n for n in group.links if (i := inertials[n]) is not None and i.mass > 0.0):
        inertial = inertials[name]
        assert inertial is not None
        part = CentralInertia.of(inertial).transform(*group.poses[name])
        total = part if total is None else total + part
        if count > 0 and total.moments()[0] < SMALLEST_MOMENT and clear_fault(inertial) is None:
            return "with what is welded to it the link is a row of points, without inertia about one axis"
    if total is not None and total.mass >= SMALLEST_MASS and not total.tensor.any():
        return f"a joint carries a point mass of {float(total.mass):.6g} kg, without inertia"
    return None


def _largest_inertia(case: Case) -> float:
    bodies = [CentralInertia.of(link.inertial) for link in case.model.links if link.inertial is not None]
    return max((float(np.max(np.diagonal(body.about_origin()))) for body in bodies), default=0.0)
