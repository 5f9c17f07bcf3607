"""DX211 floating-joint-at-root: A floating joint below an empty root specifies a floating base in the file.

Some files describe a floating robot in this way: a link ``world`` without inertia, a joint of type
``floating``, and the robot below it. The base is then specified twice, in the file and in the call that loads
it.

- PyBullet 3.2.7 makes the joint fixed, and prints one line on stdout. Then ``useFixedBase`` decides.
- Pinocchio 4.1 gives the joint seven coordinates; ``JointModelFreeFlyer`` as a root joint gives seven more.
  The other joints are right as long as the seven are held.
- MuJoCo 4.0 makes it a free joint whatever is below.
- Drake 1.51 does not know the type; it leaves the child free in the world and its quaternion at zero.

dynx reads the joint as fixed and leaves the decision to ``base=``.

What to do: specify the base in one place. ``dynx doctor --fix`` makes the joint fixed.
"""

from collections.abc import Iterable

from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.joints import joints_of_type, specifies_base


class FloatingJointAtRoot(EditingRule):
    # Before the rules about inertia, which may give the empty root a body.
    stage = "reading"
    advice = "Make the joint fixed, and specify in the loading call whether the base floats."
    engines = measured_on("mujoco", "drake")
    changed = "made the floating joint below the root fixed: the loading call says whether the base floats"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the joint, of which there is at most one."""
        for joint in joints_of_type(case, ("floating",)):
            if specifies_base(case, joint):
                edit = case.source.attribute_edit(joint, "type", "fixed")
                yield correction(joint, "the joint below the root is floating", edit)
