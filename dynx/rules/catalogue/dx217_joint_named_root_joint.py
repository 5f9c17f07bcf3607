"""DX217 joint-named-root-joint: A joint that moves is named root_joint, which is Pinocchio's name for the
joint of a free base.

``pinocchio.buildModelFromUrdf(path, pinocchio.JointModelFreeFlyer())`` is how a robot is made to float. The
free joint is called ``root_joint``, and its frame stands first in the list.

- Pinocchio 4.1 looks the frame of a joint that moves up by its name when it attaches the link behind it. For
  a joint named ``root_joint`` it finds the frame of the free base: the link is welded to the base, and the
  joint moves nothing. The file loads without a word. The mass matrix of an arm was off by 50 to 90 %. On the
  fixed base, and for a fixed joint or a link of that name, nothing happens.
- PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 read the file as it is meant.

What to do: give the joint another name. ``dynx doctor --fix`` calls it ``root_joint_1``, in mimic joints,
transmissions and Gazebo references too; programs that look the joint up by its name must be changed
with it. Where the name has to stay, every program can give the free joint another one itself, as the third
argument: ``buildModelFromUrdf(path, JointModelFreeFlyer(), "free_flyer")``. The file is mended all the same,
because those who load it in the usual way are not warned.
"""

from collections.abc import Iterable

from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.joints.renaming import fresh_name, renaming_joint

_RESERVED = "root_joint"


class JointNamedRootJoint(EditingRule):
    advice = "Give the joint another name."
    engines = measured_on("pinocchio")
    trap_base = "floating"
    changed = "gave the joint named root_joint another name"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """The joint of that name, where the base floats."""
        joint = case.joints.get(_RESERVED)
        if case.base != "floating" or joint is None or joint.attributes.get("type") == "fixed":
            return
        new = fresh_name(f"{_RESERVED}_1", case.joints)
        edits = tuple(renaming_joint(case.source, _RESERVED, new))
        yield correction(joint, "the joint has the name of Pinocchio's joint of a free base", *edits)
