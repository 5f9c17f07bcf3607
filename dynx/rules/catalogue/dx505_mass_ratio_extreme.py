"""DX505 mass-ratio-extreme: Two bodies that a joint connects differ in mass by a factor of a million or more.

Links that fixed joints hold together count as one body; a body without mass is not reported here. A sum in
double precision carries 16 digits; where a joint connects bodies a million apart, six of them are lost to the
difference of scale. The worst case is a light body that carries a heavy one.

Affected are simulators that solve joints as constraints between free bodies (ODE in Gazebo, contacts in
Bullet and MuJoCo), which converge slowly or not at all while joints drift apart and oscillate. Forward
dynamics loses digits with every engine, since the condition number of the mass matrix is of the order of the
ratio. Inverse dynamics is not affected, and engines agree on it.

Usual causes: a mass in grams or tonnes beside others in kilograms, or ``mass value="1e-06"`` for a sensor
frame because an importer refused links without mass. Only the author of the file knows which, so no edit
removes the cause.
"""

from collections.abc import Iterable

from dynx.rules import Case, Detection, Rule
from dynx.rules.inertia import rigid_groups

_RATIO = 1e6


class MassRatioExtreme(Rule):
    kind = "practice"
    advice = "Attach frames without a body by fixed joints, and give every mass in kilograms."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield moving joints between such bodies, with the head of the lighter rigid group."""
        heads = {name: group.head for name, group in rigid_groups(case).items()}
        mass = dict.fromkeys(heads.values(), 0.0)
        for link in case.model.links:
            mass[heads[link.name]] += 0.0 if link.inertial is None else link.inertial.mass
        for joint in case.model.joints:
            light, heavy = sorted((heads[joint.parent], heads[joint.child]), key=mass.__getitem__)
            if mass[light] > 0.0 and mass[heavy] >= _RATIO * mass[light]:
                message = (
                    f"body {light} has {mass[light]:.3g} kg and its neighbour {heavy} {mass[heavy]:.3g} kg, "
                    f"{mass[heavy] / mass[light]:.1g} times as much"
                )
                yield Detection(light, joint.name, case.model.link(light).line, message)
