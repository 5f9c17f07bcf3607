"""DX107 massless-root: With a floating base PyBullet fixes a robot to the world if its root link has no mass.

Many robots begin with an empty link, such as ``base_link``, which carries the body by a fixed joint. With a
fixed base this is harmless. With a floating base, the root is the body that moves:

- PyBullet 3.2.7 reads mass 0 as "fixed to the world", also with ``useFixedBase=False``: the robot hangs in
  the air, and its base has no coordinates.
- MuJoCo 4.0.0 merges links rigidly connected to the root into it and is not affected; without such links it
  refuses the file ("mass and inertia of moving bodies must be larger than mjMINVAL").
- Pinocchio 4.1.0 and Drake 1.51.1 are not affected.

The effect: in PyBullet there is no floating robot at all.

What to do: give the root the mass of the body that it represents.

``dynx doctor --fix`` merges the heaviest link that is rigidly connected to the root (directly or by a chain
of fixed joints) into it; that link gets a zero inertial and keeps its name and its place. It is the same
rigid body. Where no link rigidly connected to the root has mass, the root gets 2e-15 kg and 1.5e-14 kg m^2,
which all engines accept and which is too little to show in any result; ``--choose DX107=keep`` leaves it. A
robot without any mass has no inertial data (DX118).
"""

from collections.abc import Iterable, Sequence

from dynx.rules import Case, Detection, Remedy, Rule, measured_on
from dynx.rules.inertia import (
    has_inertial_data,
    heaviest_in_root_group,
    merged_inertials,
    rigid_groups,
    with_inertials,
    with_least_inertia,
)


class MasslessRoot(Rule):
    engines = measured_on("pybullet")
    advice = "Give the root link the mass of the body that it represents."
    choices = {
        "lump": "merge the heaviest link rigidly connected to the root into it; else give it the least mass",
        "keep": "keep the file; PyBullet then fixes the robot to the world",
    }
    trap_base = "floating"

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the root, on the floating base, where the file says that its mass is zero."""
        model = case.model
        inertial = case.inertials[model.root]
        # Without an <inertial> PyBullet gives the root 1 kg (DX101), unless it is named world.
        weightless = model.root == "world" if inertial is None else inertial.mass == 0.0
        if case.base != "floating" or not weightless or not has_inertial_data(case):
            return []
        element = case.links[model.root]
        line = element.line if inertial is None else inertial.line
        body = heaviest_in_root_group(case)
        where = "nor has any link rigidly connected to it" if body is None else f"the body is the link {body}"
        return [Detection(model.root, None, line, f"the root has no mass; {where}")]

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Return the case with the heaviest link rigidly connected to the root merged into it."""
        root, body = case.model.root, heaviest_in_root_group(case)
        if self.chosen(case) == "keep":
            return None
        if body is None:
            return Remedy(*with_least_inertia(case, [root]), self.decision(case))
        bodies = merged_inertials(case, rigid_groups(case)[root], (root, body), root)
        return Remedy(with_inertials(case, bodies), f"merged the mass of {body} into the root {root}")
