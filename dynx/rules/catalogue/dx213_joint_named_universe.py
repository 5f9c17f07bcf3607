"""DX213 joint-named-universe: A fixed joint is named universe, which is Pinocchio's name for the world.

Pinocchio 4.1 keeps a list of frames that begins with an entry ``universe``, which is the world. A fixed joint
becomes a frame of its name, and is looked up by that name when its child link is attached, which finds the
world. The file loads without a warning, and the robot lacks the mass beyond the joint. The mass matrix was
off by 40 % for a tool at the end of an arm.

A moving joint of that name does not change the model, but ``model.getJointId("universe")`` is the world and
not that joint.

PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 read the file as intended. A link named ``universe`` is harmless in
all four.

What to do: give the joint another name. ``dynx doctor --fix`` calls it ``universe_joint``, in mimic joints,
transmissions and Gazebo references too; programs that look the joint up by its name must be changed with it.
"""

from collections.abc import Iterable

from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.joints import fresh_name, joint_rename

_RESERVED = "universe"


class JointNamedUniverse(EditingRule):
    advice = "Give the joint another name."
    engines = measured_on("pinocchio")
    changed = "gave the joint named universe another name"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the fixed joint of that name."""
        joint = case.joints.get(_RESERVED)
        if joint is None or joint.attributes.get("type") != "fixed":
            return
        new = fresh_name(f"{_RESERVED}_joint", case.joints)
        edits = tuple(joint_rename(case.source, _RESERVED, new))
        yield correction(joint, "the joint has the name of Pinocchio's world", *edits)
