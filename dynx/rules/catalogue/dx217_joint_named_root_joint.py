"""DX217 joint-named-root-joint: A joint that moves is named root_joint, which is Pinocchio's name for the
joint of a floating base.

``pinocchio.buildModelFromUrdf(path, pinocchio.JointModelFreeFlyer())`` makes a robot float. The free joint is
called ``root_joint``, and its frame is the first in the list.

- Pinocchio 4.1 looks the frame of a moving joint up by its name when it attaches the child link. For a joint
  named ``root_joint`` it finds the frame of the floating base: the link is fixed to the base, and the joint
  moves nothing. The file loads without a warning. The mass matrix of an arm was off by 50 to 90 %. On the
  fixed base, and for a fixed joint or a link of that name, nothing happens.
- PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 read the file as intended.

What to do: give the joint another name. ``dynx doctor --fix`` calls it ``root_joint_1``, in mimic joints,
transmissions and Gazebo references too; programs that look the joint up by its name must be changed with it.
Where the name must be kept, programs can give the free joint another name by the third argument:
``buildModelFromUrdf(path, JointModelFreeFlyer(), "free_flyer")``. The file is corrected all the same, because
users who load it in the usual way get no warning.
"""

from collections.abc import Iterable

from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.joints import fresh_name, joint_rename

_RESERVED = "root_joint"


class JointNamedRootJoint(EditingRule):
    advice = "Give the joint another name."
    engines = measured_on("pinocchio")
    trap_base = "floating"
    changed = "gave the joint named root_joint another name"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the joint of that name, where the base floats."""
        joint = case.joints.get(_RESERVED)
        if case.base != "floating" or joint is None or joint.attributes.get("type") == "fixed":
            return
        new = fresh_name(f"{_RESERVED}_1", case.joints)
        edits = tuple(joint_rename(case.source, _RESERVED, new))
        yield correction(joint, "the joint has the name of Pinocchio's joint of a floating base", *edits)
