"""DX107 massless-root: With a free base PyBullet nails a robot to the world if its root link has no mass.

Many robots begin with a link that is only a name, ``base_link`` say, and carry their body on it by a fixed
joint. With the base fixed this is harmless. With the base free, the root is the body that moves:

- PyBullet 3.2.7 takes mass 0 for "nailed to the world", also with ``useFixedBase=False``: the robot hangs in
  the air, and its base has no coordinates.
- MuJoCo 4.0.0 lumps what is welded to the root into it and has no trouble; where nothing is, it refuses the
  file ("mass and inertia of moving bodies must be larger than mjMINVAL").
- Pinocchio 4.1.0 and Drake 1.51.1 have no trouble.

The effect: in PyBullet there is no floating robot at all.

What to do: give the root the mass of the body it stands for.

``dynx doctor --fix`` lumps the heaviest link that is welded to the root (directly or by a chain of fixed
joints) into it; that link gets a zero inertial and keeps its name and its place. It is the same rigid body.
Where nothing welded to the root has mass, the root gets 2e-15 kg and 1.5e-14 kg m^2, which all engines take
and no result shows; ``--choose DX107=keep`` leaves it. In a robot without any mass that counts
as a change of the physics.
"""

from collections.abc import Iterable, Sequence

from dynx.rules import Case, Detection, Remedy, Rule, measured_on
from dynx.rules.inertia.edits import with_inertials
from dynx.rules.inertia.massless_links import heaviest_welded_to_root, with_least_inertia
from dynx.rules.inertia.merging import lumped_into
from dynx.rules.inertia.rigid_groups import rigid_groups


class MasslessRoot(Rule):
    engines = measured_on("pybullet")
    advice = "Give the root link the mass of the body it stands for."
    choices = {
        "lump": "lump the heaviest link welded to the root into it; without one, give it the least mass",
        "keep": "leave the file as it is; PyBullet then nails the robot to the world",
    }
    trap_base = "floating"

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """The root, on the floating base, where the file says that its mass is zero."""
        model = case.model
        inertial = case.inertials[model.root]
        # Without an <inertial> PyBullet takes 1 kg (DX101), but for a link named world.
        weightless = model.root == "world" if inertial is None else inertial.mass == 0.0
        if case.base != "floating" or not weightless:
            return []
        element = case.links[model.root]
        line = element.line if inertial is None else inertial.line
        body = heaviest_welded_to_root(case)
        where = "nor has anything welded to it" if body is None else f"the body is the link {body}"
        return [Detection(model.root, None, line, f"the root has no mass; {where}")]

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """The heaviest link that is welded to the root, lumped into it."""
        root, body = case.model.root, heaviest_welded_to_root(case)
        if self.chosen(case) == "keep":
            return None
        if body is None:
            weightless = not any(link.inertial and link.inertial.mass > 0.0 for link in case.model.links)
            least = with_least_inertia(case, [root])
            return Remedy(*least, self.decision(case), changes_physics=weightless)
        bodies = lumped_into(case, rigid_groups(case)[root], (root, body), root)
        return Remedy(with_inertials(case, bodies), f"lumped the mass of {body} into the root {root}")
