"""DX304 mimic-as-constraint: A joint mimics another: a constraint to some engines, nothing to others.

``<mimic joint="a" multiplier="2" offset="0.1"/>`` means that the joint is always at 2 a + 0.1.

- Pinocchio 4.1 and PyBullet 3.2.7 load the joint as free and ignore the tag. Pinocchio has
  ``buildModelFromUrdf(..., mimic=True)``, with which the joint has no coordinate.
- MuJoCo 4.0 makes a soft equality constraint of it: the joint has a coordinate, and where the constraint is
  violated ``mj_inverse`` adds the restoring force, which can be a hundred times the torque.
- Drake 1.51 makes a constraint of it that discrete-time simulation keeps; its inverse dynamics ignores it,
  and continuous-time forward dynamics refuses to run.

None of these is wrong; they are different robots. dynx gives a mimic joint no coordinate, and its torque goes
to the joint it follows, in every backend.

What to do: know which interpretation you use. doctor compares all engines with every joint free, where the
dynamics of the bodies is the same, and prints the calls that switch the constraints off. The file is correct,
so ``dynx doctor --fix`` does not change it.
"""

from collections.abc import Iterable

from dynx.errors import shown
from dynx.rules import CallingRule, Case, Detection, found_at, measured_on


class MimicAsConstraint(CallingRule):
    advice = "Know whether mimic joints are free, constrained or dependent in your engine."
    engines = measured_on("mujoco", "drake")
    calls = ("mujoco.no_mimic", "drake.free_mimics")
    changed = "compared with mimic joints free"

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield joints that follow a moving joint."""
        for joint in case.model.joints:
            mimic = case.joints[joint.name].first("mimic")
            if joint.mimic is not None and mimic is not None:
                yield found_at(mimic, f"the joint mimics {shown(mimic.attributes['joint'])}")
