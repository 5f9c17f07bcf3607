"""DX209 mimic-of-fixed-joint: A mimic joint follows a joint that cannot move.

The joint it follows was made fixed (a gripper that is not used, say) and the followers were forgotten. By the
definition of ``<mimic>`` they cannot move either: their value is the offset.

- Drake 1.51 refuses the file: a joint with one coordinate cannot mimic a joint without coordinates.
- MuJoCo 4.0 warns and lets the joint move freely.
- Pinocchio 4.1 and PyBullet 3.2.7 let every mimic joint move freely by default, and Pinocchio with
  ``mimic=True`` refuses the file.

dynx reads the joint as fixed at its offset. The effect in the other engines is one coordinate more in every
vector and matrix.

What to do: make the joint fixed. ``dynx doctor --fix`` does so, and moves its origin by the offset. If it was
meant to move by itself, ``--choose DX209=free`` removes ``<mimic>`` instead.
"""

from collections.abc import Iterable

from dynx.errors import shown
from dynx.model.elements import Joint
from dynx.model.xml.source import Edit, SourceElement
from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.attributes import orientation_edits
from dynx.rules.joints import SINGLE, elements_in_joints
from dynx.rules.numbers_in_text import decimal


class MimicOfFixedJoint(EditingRule):
    advice = "Make the follower fixed too."
    engines = measured_on("drake")
    choices = {
        "fixed": "make a joint that mimics a fixed one fixed at its offset",
        "free": "let a joint that mimics a fixed one move freely",
    }
    changed = "made joints that mimic a fixed one fixed or free"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield joints whose type is one that moves and whose ``<mimic>`` lets dynx read them as fixed."""
        known = {joint.name: joint for joint in case.model.joints}
        for element, mimic in elements_in_joints(case, "mimic", SINGLE):
            joint = known[element.attributes["name"]]
            if not joint.moves:
                message = f"the joint mimics {shown(mimic.attributes['joint'])}, which cannot move"
                yield correction(mimic, message, *self._edits(case, element, joint))

    def _edits(self, case: Case, element: SourceElement, joint: Joint) -> Iterable[Edit]:
        source = case.source
        for mimic in element.all("mimic"):
            yield source.removal(mimic)
        if self.chosen(case) == "free":
            return
        yield source.attribute_edit(element, "type", "fixed")
        if not joint.locked_at:
            return
        texts = {name: " ".join(map(decimal, getattr(joint.origin, name))) for name in ("xyz", "rpy")}
        origin = element.first("origin")
        if origin is None:
            words = " ".join(f'{name}="{text}"' for name, text in texts.items())
            yield source.insertion(element, f"<origin {words}/>", first=True)
        else:
            yield source.attribute_edit(origin, "xyz", texts["xyz"])
            yield from orientation_edits(source, origin, joint.origin.rpy)
