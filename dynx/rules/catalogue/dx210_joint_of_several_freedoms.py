"""DX210 joint-of-several-freedoms: A joint is spherical, planar or floating.

URDF knows ``planar`` and ``floating``; ``spherical`` and ``ball`` are extensions. No other feature is read in
so many different ways:

- ``spherical``: Pinocchio 4.1 and Drake 1.51 refuse the file. PyBullet 3.2.7 reads it; mass matrix and
  inverse dynamics then have other coordinates than the joint states or fail. MuJoCo 4.0 reads it with
  quaternions, and refuses the usual limits on it. No engine reads ``ball``.
- ``planar``: Pinocchio has (x, y, cos, sin), MuJoCo and Drake three joints or coordinates; PyBullet moves it
  but cannot do dynamics.
- ``floating`` in the middle of a tree: Pinocchio has a quaternion; PyBullet makes the joint FIXED and prints
  one line on stdout; MuJoCo and Drake refuse it or leave the link free in the world.

dynx has no such joint and refuses the file.

What to do: write joints of one degree of freedom each, with massless links between them. ``dynx doctor
--fix`` does so: three rotations for a spherical joint, two translations and a rotation for a planar one,
three of each for a floating one. The chain has the same motion; its coordinates are angles, singular where
the middle angle is 90 degrees, and limits of the joint are dropped. MuJoCo refuses massless links that move
(DX110), so the links in between weigh 2e-15 kg. ``--choose DX210=fixed`` makes the joint fixed instead.
"""

from collections.abc import Iterable

from dynx.model.xml.source import Edit
from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.joints import TYPES, joint_split, joints_of_type, specifies_base


class JointOfSeveralFreedoms(EditingRule):
    stage = "reading"
    advice = "Write joints of one degree of freedom each, with massless links between them."
    engines = measured_on("pinocchio", "pybullet", "drake")
    choices = {
        "split": "split a joint of several degrees of freedom into joints of one, without its limits",
        "fixed": "make a joint of several degrees of freedom fixed",
    }
    changed = "replaced joints of several degrees of freedom"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield such joints, except a floating one below an empty root (DX211)."""
        for joint in joints_of_type(case, TYPES):
            kind = joint.attributes["type"]
            if not joint.attributes.get("name") or (kind == "floating" and specifies_base(case, joint)):
                continue
            if self.chosen(case) == "fixed":
                edits: tuple[Edit, ...] = (case.source.attribute_edit(joint, "type", "fixed"),)
            else:
                edits = tuple(joint_split(case.source, joint))
            yield correction(joint, f"the joint is {kind}", *edits)
