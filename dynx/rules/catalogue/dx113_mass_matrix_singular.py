"""DX113 mass-matrix-singular: Nothing beyond a joint has mass, so the mass matrix is singular.

At the end of some chains there are links whose inertia nobody entered: fingers, wheels, sensors that turn.
No torque is needed to move them, so none can tell how they move: the mass matrix is singular, and forward
dynamics has no answer.

- Pinocchio 4.1.0 gives NaN for all joints.
- PyBullet 3.2.7 gives that joint an acceleration of zero, and the others the right one.
- Drake 1.51.1 raises an error ("mass matrix ... is not positive-definite").
- MuJoCo 4.0.0 refuses the file ("mass and inertia of moving bodies must be larger than mjMINVAL").
- Kinematics, mass matrix and inverse dynamics are right in the first three.

The effect: no forward dynamics, and no two engines say so in the same way. 24 joints of romeo are like this.

What to do: enter the inertia. If the joint does not matter, make it fixed.

``dynx doctor --fix`` gives such links 2e-15 kg and 1.5e-14 kg m^2 about every axis, the least that all
engines take; then all give the same accelerations, to rounding. The report says that the physics changed: it
is an invented inertia, and the slightest torque spins it up. ``--choose DX113=keep`` leaves the file as it
is.
"""

from collections.abc import Iterable, Sequence

from dynx.rules import Case, Detection, Remedy, Rule, measured_on
from dynx.rules.inertia.massless_links import massless_links, with_least_inertia


class MassMatrixSingular(Rule):
    # The others show it in forward dynamics, which has no right answer to be compared with.
    engines = measured_on("mujoco")
    advice = "Enter the inertia of the link, or make the joint fixed if it does not matter."
    choices = {
        "least": "give the links the least mass and moments that all engines take, which changes the physics",
        "keep": "leave the file as it is; forward dynamics has no answer",
    }

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Links that a joint moves where neither they nor anything beyond them has mass or a tensor."""
        message = "neither the link nor anything beyond its joint has mass: the mass matrix is singular"
        return [
            Detection(name, None, case.links[name].line, message)
            for name, bare in massless_links(case).items()
            if bare
        ]

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """The least that all engines take, unless the user wants the file kept."""
        if self.chosen(case) == "keep":
            return None
        names = [detection.link for detection in detections if detection.link is not None]
        return Remedy(*with_least_inertia(case, names), self.decision(case), changes_physics=True)
