"""DX108 massless-link-with-inertia: A link of mass zero has moments of inertia, which no body has.

A body with moments of inertia has mass. A file can contradict this: the mass of a foot or a sensor was set to
zero and its tensor was kept.

- Drake 1.51.1 makes the link weigh 1 kg, with a warning ("condition 'mass > 0' failed").
- MuJoCo 4.0.0 drops the tensor where the link is rigidly connected to another (its default ``fusestatic``),
  and refuses the file where a joint carries the link. Where the link cannot move, such as the root of a fixed
  robot, it refuses a tensor that no body can have ("inertia must satisfy A + B >= C").
- Pinocchio 4.1.0 and PyBullet 3.2.7 use the numbers unchanged, as dynx does.

The effect: in Drake torques up to 23 times too large (bolt, whose feet these are), in MuJoCo as much as the
tensor contributes (1e-4 on bolt).

What to do: give the link its mass.

``dynx doctor --fix`` adds the tensor to that of a link with mass that is rigidly connected to it, its parent
first; the massless link gets a zero tensor. That is the same rigid body. Where there is no such link, the
link gets a mass of 2e-15 kg, which every engine accepts as mass and which is too little to show in any
result. The tensor of a link that cannot move becomes zero.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from dynx.model.elements import Inertial
from dynx.rules import Case, Detection, Remedy, Rule, links_of, measured_on
from dynx.rules.inertia import (
    MIN_MASS,
    inertials_in_groups,
    merged_inertials,
    rigid_groups,
    tensor_fault,
    with_inertials,
)

_READINGS = (("mujoco", "dropped or refused by MuJoCo"), ("drake", "1 kg in Drake"))


class MasslessLinkWithInertia(Rule):
    engines = measured_on("drake", "mujoco")
    advice = "Give the link its mass, or move the tensor into the link that it is rigidly connected to."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links of mass zero with a tensor that is not zero; of those that cannot move, the links
        whose tensor no body can have."""
        for name, inertial, group in inertials_in_groups(case):
            largest = float(np.max(np.abs(inertial.tensor)))
            if inertial.mass != 0.0 or largest == 0.0:
                continue
            message = f"the mass is zero, and the largest entry of the tensor {largest:.6g}"
            if not group.static:
                yield Detection(name, None, inertial.line, message, _READINGS)
            elif tensor_fault(inertial) == "triangle":
                message += ", in a tensor that no body can have, held still by the world"
                yield Detection(name, None, inertial.line, message, (("mujoco", "refused by MuJoCo"),))

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy:
        """Return the case with each tensor moved to a link with mass, or with the least mass added."""
        for name in links_of(detections):
            inertial, group = case.model.inertial(name), rigid_groups(case)[name]
            if group.static:
                case = with_inertials(case, {name: Inertial(0.0, inertial.origin)})
                continue
            parent = group.parents.get(name)
            near = [*([parent] if parent else []), *group.children(name), *group.links]
            heavy = [each for each in near if (body := case.inertials[each]) is not None and body.mass > 0.0]
            if heavy:
                case = with_inertials(case, merged_inertials(case, group, (heavy[0], name), heavy[0]))
            else:
                case = with_inertials(case, {name: replace(inertial, mass=2.0 * MIN_MASS)})
        return Remedy(
            case, "added tensors of links without mass to links with mass rigidly connected to them"
        )
