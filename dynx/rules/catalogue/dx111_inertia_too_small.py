"""DX111 inertia-too-small: A moment of inertia is below 1e-14 kg m^2, which MuJoCo refuses.

Some engines compare moments of inertia with fixed small numbers, whatever the size of the robot.

- MuJoCo 4.0.0 refuses a file ("inertia must have positive eigenvalues") in which a principal moment is below
  1e-14 kg m^2, unless the whole tensor is zero: a thin rod with a moment of 0 about its axis, or tensors that
  are zero except for residues such as -1e-20. It refuses a point mass on a joint ("mass and inertia of moving
  bodies must be larger than mjMINVAL"), and where it merges rigidly connected links, any partial sum that is
  a point or a rod. For links that cannot move it checks the tensor all the same.
- PyBullet 3.2.7 replaces residues with a negative moment by zero, which has no effect. Its simulation does
  not move a joint that carries an inertia about its axis below 2.2e-16 kg m^2.
- Pinocchio 4.1.0 and Drake 1.51.1 use the numbers unchanged.

The effect: the file does not load in MuJoCo.

What to do: for a robot of ordinary size such a moment has no effect, and 1e-14 has none either. For a robot
of micrometres change the unit of length or mass.

``dynx doctor --fix`` merges such a link with the links rigidly connected to it, which is the same rigid body;
where that is not enough the moments are raised to 1.5e-14 kg m^2. The report says that the physics changed
where that is more than rounding of the robot's largest inertia. Nothing is done where it would be more than a
thousandth of that.
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from dynx.model.elements import Inertial
from dynx.model.mechanism import pose_arrays
from dynx.rules import Case, Detection, Remedy, Rule, links_of, measured_on
from dynx.rules.inertia import (
    ACCEPTED_MOMENT,
    MIN_MASS,
    MIN_MOMENT,
    ROUNDING,
    CentralInertia,
    RigidGroup,
    as_inertial,
    fault_beyond_rounding,
    line_of,
    merged_inertials,
    moment_increase,
    nearest_moments,
    principal_moments,
    rigid_groups,
    with_inertials,
    with_raised_moments,
)
from dynx.spatial.extended import longdouble

_MAX_ADDED_SHARE = 1e-3
"""Largest addition to the moments of a body, as a share of the robot's largest moment of inertia."""


class InertiaTooSmall(Rule):
    engines = measured_on("mujoco")
    advice = "Raise the moment to 1e-14 kg m^2, or change the unit for a robot that is really so small."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links with such a tensor, and moving links whose rigid group is a point or a rod."""
        groups = rigid_groups(case)
        inertials, found = case.inertials, {}
        for name, inertial in inertials.items():
            if inertial is not None and _is_too_small(inertial, static=groups[name].static):
                smallest = float(principal_moments(inertial)[0])
                found[name] = f"the principal moment {smallest:.3g} is below {MIN_MOMENT:g} kg m^2"
        for group in dict.fromkeys(groups.values()):
            if group.static or any(name in found for name in group.links):
                continue
            if (what := _group_defect(group, inertials)) is not None:
                found[group.head] = what
        for name in inertials:
            if name in found:
                yield Detection(name, None, line_of(case, name, "inertia"), found[name])

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Merge each with the links rigidly connected to it; raise moments where that is not enough."""
        before, merged, raised, largest = case, 0, 0, 0.0
        for name in links_of(detections):
            group = rigid_groups(case)[name]
            own = case.inertials[name]
            if group.static and own is not None and own.mass == 0.0:
                # A link that has no mass and cannot move needs no tensor.
                case = with_inertials(case, {name: Inertial(0.0, own.origin)})
                raised += 1
                continue
            heavy = [each for each in group.links if case.model.inertial(each).mass > 0.0]
            into = group.head
            if name != into or (heavy and heavy != [into] and not group.static):
                links = (into, name) if group.static else tuple(dict.fromkeys((into, *heavy)))
                bodies = merged_inertials(case, group, links, into)
                case = with_inertials(case, bodies)
                merged += 1
            held = case.inertials[into]
            if held is None or not (
                _is_too_small(held, static=group.static) or (_is_point(held) and not group.static)
            ):
                continue
            central = CentralInertia.of(held)
            moments, axes = central.principal(held.origin.rpy)
            near = central.about(nearest_moments(moments), axes)
            if (
                moment_increase(near, ACCEPTED_MOMENT)
                > _MAX_ADDED_SHARE * _largest_inertia(before, in_parent=True)
                and not group.static
            ):
                continue
            largest = max(largest, moment_increase(near, ACCEPTED_MOMENT))
            raised_body = CentralInertia.of(with_raised_moments(near, ACCEPTED_MOMENT))
            case = with_inertials(case, {into: as_inertial(case, into, raised_body, held)})
            raised += 1
        if not (merged or raised):
            return None
        parts = [f"merged {merged} links with links rigidly connected to them"] if merged else []
        parts += [f"raised moments of {raised} links to {ACCEPTED_MOMENT:g} kg m^2"] if raised else []
        changes_physics = largest > ROUNDING * _largest_inertia(before)
        return Remedy(case, " and ".join(parts), changes_physics=changes_physics)


def _is_too_small(inertial: Inertial, *, static: bool) -> bool:
    """Check whether MuJoCo refuses the tensor by itself; DX108 is about moving links without mass."""
    if inertial.mass == 0.0 and not static:
        return False
    if not inertial.tensor.any() or fault_beyond_rounding(inertial) is not None:
        return False
    return bool(principal_moments(inertial)[0] < MIN_MOMENT)


def _is_point(inertial: Inertial) -> bool:
    return inertial.mass >= MIN_MASS and not inertial.tensor.any()


def _group_defect(group: RigidGroup, inertials: Mapping[str, Inertial | None]) -> str | None:
    """Explain why a moving group has no inertia about an axis, adding its links from the head on; or None."""
    total: CentralInertia | None = None
    for count, name in enumerate(n for n in group.links if (i := inertials[n]) is not None and i.mass > 0.0):
        inertial = inertials[name]
        assert inertial is not None
        part = CentralInertia.of(inertial).transform(*group.poses[name])
        total = part if total is None else total + part
        if count > 0 and total.moments()[0] < MIN_MOMENT and fault_beyond_rounding(inertial) is None:
            return "together with its rigid group the link is a row of points, without inertia about one axis"
    if total is not None and total.mass >= MIN_MASS and not total.tensor.any():
        return f"a joint carries a point mass of {float(total.mass):.6g} kg, without inertia"
    return None


def _largest_inertia(case: Case, *, in_parent: bool = False) -> float:
    """Return the largest moment of inertia of a link about its origin, or also about that of its parent."""
    arms = {joint.child: pose_arrays(joint.origin, longdouble) for joint in case.model.joints if in_parent}
    largest = 0.0
    for link in case.model.links:
        if link.inertial is not None:
            body = CentralInertia.of(link.inertial)
            frames = [body, body.transform(*arms[link.name])] if link.name in arms else [body]
            largest = max(largest, *(float(np.max(np.diagonal(each.about_origin()))) for each in frames))
    return largest
