"""DX101 link-without-inertial: A link has no <inertial>: some engines give it a mass, others none.

A link that only marks a place, such as a tool flange or a camera frame, is often written without an
``<inertial>`` element. URDF does not define the mass of such a link.

- Pinocchio 4.1.0 and Drake 1.51.1: no mass, as in dynx.
- PyBullet 3.2.7: 1 kg, with 1 kg m^2 about every axis, unless the link is named exactly ``world``. It prints
  "No inertial data for link, using mass=1" among other output.
- MuJoCo 4.0.0: the mass of the primitive collision shapes of the link at 1000 kg/m^3; without such shapes no
  mass.

The effect is large: torques, mass matrices and accelerations are off by 10 % to many times their size
wherever such a link moves. With a floating base, the root counts too; with a fixed base, the root and the
links rigidly connected to it cannot move, so their mass has no effect.

What to do: write the mass and the inertia of the link. If it is only a frame, write zeros explicitly.

``dynx doctor --fix`` puts an ``<inertial>`` with mass 0 and moments 0 into each such link. All four engines
then read the link as a frame, as Pinocchio does. On the floating base a root without ``<inertial>`` gets that
of the heaviest link rigidly connected to it instead, because PyBullet fixes a root without mass to the world
(DX107). This changes no equation of motion.
"""

from collections.abc import Iterable, Sequence

from dynx.rules import Case, Detection, Remedy, Rule, links_of, measured_on
from dynx.rules.inertia import (
    has_inertial_data,
    heaviest_in_root_group,
    merged_inertials,
    rigid_groups,
    static_links,
    with_inertials,
    zero_inertial,
)

_WORLD = "world"
"""Name of a link without ``<inertial>`` that PyBullet gives no mass."""


_READINGS = (
    ("pinocchio", "no mass in Pinocchio"),
    ("pybullet", "1 kg and 1 kg m^2 in PyBullet"),
    ("mujoco", "the weight of its shapes in MuJoCo"),
    ("drake", "no mass in Drake"),
)


class LinkWithoutInertial(Rule):
    engines = measured_on("pybullet", "mujoco")
    advice = "Write an <inertial>: the true one, or one of zero where the link is a mere frame."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links that can move and have no ``<inertial>``."""
        if not has_inertial_data(case):
            return  # DX118
        static = static_links(case)
        for name, element in case.links.items():
            if element.first("inertial") is None and name not in static and name != _WORLD:
                yield Detection(name, None, element.line, "no <inertial>", _READINGS)

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy:
        """Write an inertial of zero into each link.

        A floating root gets that of the heaviest link rigidly connected to it instead, since PyBullet fixes a
        root without mass to the world (DX107).
        """
        names = links_of(detections)
        many = f"{len(names)} links" if len(names) > 1 else "the link"
        done = f"gave {many} without <inertial> one with mass 0 and moments 0"
        body = heaviest_in_root_group(case) if case.base == "floating" and case.readable else None
        if body is not None and case.model.root in names:
            root = case.model.root
            merged = merged_inertials(case, rigid_groups(case)[root], (root, body), root)
            case = with_inertials(case, merged)
            names.remove(root)
            done = f"gave the root {root} the <inertial> of {body}, which is rigidly connected to it"
            done += f", and {len(names)} other links without <inertial> one of zero" if names else ""
        source = case.source
        edits = [source.insertion(case.links[name], zero_inertial(), first=True) for name in names]
        return Remedy(case.with_source(source.apply(*edits)), done)
