"""DX304 mimic-as-constraint: A joint mimics another: a constraint to some engines, nothing to others.

``<mimic joint="a" multiplier="2" offset="0.1"/>`` says that a joint is always at 2 a + 0.1.

- Pinocchio 4.1 and PyBullet 3.2.7 load the joint as free and do not look at the tag. Pinocchio has
  ``buildModelFromUrdf(..., mimic=True)``, with which the joint has no coordinate.
- MuJoCo 4.0 makes an equality constraint of it, a spring as it were: the joint has a coordinate, and where
  it is away from the constraint ``mj_inverse`` adds the force that pulls it back, which can be a hundred
  times the torque.
- Drake 1.51 makes a constraint of it that discrete-time simulation keeps; its inverse dynamics does not
  know of it, and continuous-time forward dynamics refuses to run.

Neither is wrong; they are different robots. dynx gives a mimic joint no coordinate, and its torque goes to
the joint it follows, in every backend.

What to do: know which one you compare. doctor compares all engines with every joint free, in which
the dynamics of the bodies is the same, and prints the calls that switch the constraints off. The file is
right, so ``dynx doctor --fix`` does not change it.
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
        """Joints that follow one that moves."""
        for joint in case.model.joints:
            mimic = case.joints[joint.name].first("mimic")
            if joint.mimic is not None and mimic is not None:
                yield found_at(mimic, f"the joint mimics {shown(mimic.attributes['joint'])}")
