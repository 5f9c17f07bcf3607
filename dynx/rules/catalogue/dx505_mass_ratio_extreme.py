"""DX505 mass-ratio-extreme: neighbouring bodies differ in mass by a factor of a million

Links that fixed joints hold together count as one body; a body without any mass is another matter and not
reported here. A sum in double precision carries 16 digits; where a joint connects bodies a million apart,
six of them go to the difference of scale. The worst case is a light body that carries a heavy one.

What suffers: simulators that solve joints as constraints between free bodies (ODE in Gazebo, contacts in
Bullet and MuJoCo) converge slowly or not at all, joints drift apart and shake; forward dynamics loses
digits with every engine, since the condition number of the mass matrix is of the order of the ratio.
Inverse dynamics does not suffer, and engines agree on it.

The usual reasons: a mass in grams or tonnes beside others in kilograms, or ``mass value="1e-06"`` for a
sensor frame because an importer refused links without mass. Only the first can be told from the
second by who made the file, so there is no remedy by edit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from dynx.rules.case import Case
from dynx.rules.inertia.rigid_groups import rigid_groups
from dynx.rules.rule import Detection, Kind, Rule

_RATIO = 1e6


class MassRatioExtreme(Rule):
    """DX505."""

    id = "DX505"
    name = "mass-ratio-extreme"
    title = "Two bodies that a joint connects differ in mass by a factor of a million or more."
    kind: ClassVar[Kind] = "practice"
    advice = "Weld a frame that has no body of its own by a fixed joint, and give every mass in kilograms."

    def detect(self, case: Case) -> Sequence[Detection]:
        """Moving joints between such bodies; the link named heads the lighter one."""
        heads = {name: group.head for name, group in rigid_groups(case).items()}
        mass = dict.fromkeys(heads.values(), 0.0)
        for link in case.model.links:
            mass[heads[link.name]] += 0.0 if link.inertial is None else link.inertial.mass
        found = []
        for joint in case.model.joints:
            light, heavy = sorted((heads[joint.parent], heads[joint.child]), key=mass.__getitem__)
            if mass[light] > 0.0 and mass[heavy] >= _RATIO * mass[light]:
                message = (
                    f"body {light} has {mass[light]:.3g} kg and its neighbour {heavy} {mass[heavy]:.3g} kg, "
                    f"{mass[heavy] / mass[light]:.1g} times as much"
                )
                found.append(Detection(light, joint.name, case.model.link(light).line, message))
        return found
