"""DX220 loop-joint: A ``<loop_joint>`` closes a kinematic loop, which URDF cannot express.

``<loop_joint>`` is an extension of a few programs, such as Isaac Sim and the predecessor of Drake's
``MultibodyPlant``: it names two links (``<link1>``, ``<link2>``) that are held together although a robot in
URDF is a tree.

- Drake 1.51 refuses the file: "loop joints are not supported in MultibodyPlant".
- Pinocchio 4.1, PyBullet 3.2.7 and MuJoCo 4.0 ignore it without a warning and load the open tree. So does
  dynx, with a note.

What to do: close the loop in the program, by the constraint that your engine has (``createConstraint`` in
PyBullet, ``<equality>`` in MJCF, a ball or weld constraint in Drake and Pinocchio). ``dynx doctor --fix``
removes the element, which leaves the tree that three engines load. ``--choose DX220=keep`` keeps it for the
programs that read it, and Drake refuses the file.
"""

from collections.abc import Iterable

from dynx.errors import shown
from dynx.rules import Case, Correction, EditingRule, correction, measured_on


class LoopJoint(EditingRule):
    stage = "reading"
    advice = "Remove the <loop_joint> and close the loop in the program."
    engines = measured_on("drake")
    choices = {
        "remove": "remove loop joints, which leaves the tree",
        "keep": "keep loop joints; Drake then refuses the file",
    }
    changed = "removed loop joints"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield every such element of the robot."""
        for loop in case.source.root.all("loop_joint"):
            name = shown(loop.attributes.get("name", ""))
            edits = () if self.chosen(case) == "keep" else (case.source.removal(loop),)
            yield correction(loop, f"<loop_joint> {name} closes a loop, which no engine reads", *edits)
