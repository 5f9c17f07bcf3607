"""DX227 joint-of-drake: A <drake:joint> joins two links in one engine and is not there in the others.

Drake has joints that URDF lacks: ball, universal, planar, screw and curvilinear ones. A file states them in
elements of their own, ``<drake:joint name="..." type="ball">``, with the children of a ``<joint>``.

- Drake 1.51.1 adds the joint.
- Pinocchio 4.1, PyBullet 3.2.7 and MuJoCo 4.0 skip the element. So does dynx, with a note. The child is then
  the root of a tree of its own (DX223), unless another joint carries it; Drake refuses the file in that case
  ("form one or more loops").

What to do: write joints that URDF has, in a chain with small links between them (see DX210), or use the file
with Drake alone. No chain is a screw, so ``dynx doctor --fix`` removes the element, and DX223 then attaches
the child. ``--choose DX227=keep`` keeps it, and Drake loads another robot than the rest.
"""

from collections.abc import Iterable

from dynx.errors import shown
from dynx.rules import Case, Correction, EditingRule, correction, measured_on

_TAG = "drake:joint"


class JointOfDrake(EditingRule):
    stage = "reading"
    advice = "Write joints that URDF has, or use the file with Drake alone."
    engines = measured_on("drake")
    choices = {
        "remove": "remove joints that only Drake reads",
        "keep": "keep such joints; Drake then loads another robot",
    }
    changed = "removed joints that only Drake reads"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield every such element of the robot."""
        for joint in case.source.root.all(_TAG):
            kind, name = (shown(joint.attributes.get(key, "")) for key in ("type", "name"))
            edits = () if self.chosen(case) == "keep" else (case.source.removal(joint),)
            yield correction(joint, f"<{_TAG}> {name} of type {kind} is a joint in Drake alone", *edits)
