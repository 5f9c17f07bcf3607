"""DX101 link-without-inertial: A link without <inertial> weighs 1 kg in PyBullet, its shapes' weight in
MuJoCo, else nothing.

A link that only marks a place, such as a tool flange or a camera frame, is often written without an
``<inertial>`` element. URDF does not say what such a link weighs.

- Pinocchio 4.1.0 and Drake 1.51.1: nothing, and dynx reads it so.
- PyBullet 3.2.7: 1 kg, with 1 kg m^2 about every axis, unless the link is named exactly ``world``. It
  prints "No inertial data for link, using mass=1" where few people look.
- MuJoCo 4.0.0: what the primitive collision shapes of the link weigh at 1000 kg/m^3; without such shapes
  nothing.

The effect is large: torques, mass matrices and accelerations are off by 10 % to many times their size
wherever such a link moves. With the base free, the root counts too; with the base fixed, the root and
what is welded to it stay where they are, and nothing follows from their mass.

What to do: write down what the link weighs. If it is a mere frame, say so with an explicit zero.

``dynx doctor --fix`` puts an ``<inertial>`` with mass 0 and moments 0 into each such link. All four
engines then take the link for what it is in Pinocchio: a frame. On the floating base a root without
``<inertial>`` gets that of the heaviest link welded to it instead, for PyBullet nails a root without
mass to the world (DX107); that changes no equation of motion.
"""

from collections.abc import Iterable, Sequence

from dynx.rules import Case, Detection, Remedy, Rule, measured_on
from dynx.rules.inertia.edits import with_inertials, zero_inertial
from dynx.rules.inertia.massless_links import heaviest_welded_to_root
from dynx.rules.inertia.merging import lumped_into
from dynx.rules.inertia.rigid_groups import rigid_groups, static_links

_UNTOUCHED = "world"
"""The one name for which PyBullet takes a mass of zero."""


class LinkWithoutInertial(Rule):
    engines = measured_on("pybullet", "mujoco")
    advice = "Write an <inertial>: the true one, or one of zero where the link is a mere frame."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Links that can move and have no ``<inertial>``."""
        static = static_links(case)
        message = "no <inertial>: 1 kg and 1 kg m^2 in PyBullet, nothing in Pinocchio and Drake"
        return [
            Detection(name, None, element.line, message)
            for name, element in case.links.items()
            if element.first("inertial") is None and name not in static and name != _UNTOUCHED
        ]

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy:
        """An explicit zero inertial in each; in a root that floats the heaviest body welded to it, since
        PyBullet nails a root without mass to the world (DX107)."""
        names = [detection.link for detection in detections if detection.link is not None]
        many = f"{len(names)} links" if len(names) > 1 else "the link"
        done = f"gave {many} without <inertial> one with mass 0 and moments 0"
        body = heaviest_welded_to_root(case) if case.base == "floating" and case.readable else None
        if body is not None and case.model.root in names:
            root = case.model.root
            lumped = lumped_into(case, rigid_groups(case)[root], (root, body), root)
            case = with_inertials(case, lumped)
            names.remove(root)
            done = f"gave the root {root} the <inertial> of {body}, which is welded to it"
            done += f", and {len(names)} other links without <inertial> one of zero" if names else ""
        source = case.source
        edits = [source.inserting(case.links[name], zero_inertial(), first=True) for name in names]
        return Remedy(case.with_source(source.edited(*edits)), done)
