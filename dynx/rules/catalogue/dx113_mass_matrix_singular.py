"""DX113 mass-matrix-singular: Nothing beyond a joint has mass, so the mass matrix is singular.

At the end of some chains there are links whose inertia was never entered: fingers, wheels, rotating sensors.
They move without any torque, so their acceleration is undefined: the mass matrix is singular, and forward
dynamics has no solution.

- Pinocchio 4.1.0 gives NaN for all joints.
- PyBullet 3.2.7 gives that joint an acceleration of zero, and the others the right one.
- Drake 1.51.1 raises an error ("mass matrix ... is not positive-definite").
- MuJoCo 4.0.0 refuses the file ("mass and inertia of moving bodies must be larger than mjMINVAL").
- Kinematics, mass matrix and inverse dynamics are right in the first three.

The effect: no forward dynamics, which each engine reports in a different way. 24 joints of romeo are like
this.

What to do: enter the inertia. If the joint does not matter, make it fixed.

``dynx doctor --fix`` gives such links 2e-15 kg and 1.5e-14 kg m^2 about every axis, the least that all
engines accept; then all give the same accelerations, to rounding. The report says that the physics changed:
the inertia is invented, and the smallest torque accelerates it strongly. ``--choose DX113=keep`` keeps the
file.
"""

from collections.abc import Iterable, Sequence

from dynx.rules import Case, Detection, Remedy, Rule, links_of, measured_on
from dynx.rules.inertia import massless_links, with_least_inertia


class MassMatrixSingular(Rule):
    # The others show it in forward dynamics, which has no right value to compare with.
    engines = measured_on("mujoco")
    advice = "Enter the inertia of the link, or make the joint fixed if it does not matter."
    choices = {
        "least": "give the links the least mass and moments that engines accept; this changes the physics",
        "keep": "keep the file; forward dynamics has no solution",
    }

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the moving links where neither they nor any link beyond them has mass or a tensor."""
        message = "neither the link nor anything beyond its joint has mass: the mass matrix is singular"
        for name, bare in massless_links(case).items():
            if bare:
                yield Detection(name, None, case.links[name].line, message)

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Give the links the least inertia that all engines accept, unless the user keeps the file."""
        if self.chosen(case) == "keep":
            return None
        return Remedy(
            *with_least_inertia(case, links_of(detections)), self.decision(case), changes_physics=True
        )
