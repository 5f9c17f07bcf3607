"""DX208 mimic-of-nothing: A mimic joint has nothing to follow.

It names no joint, a missing joint or its own joint; or it belongs to a fixed joint.

- Drake 1.51 refuses the file in all these cases, with the line.
- Pinocchio 4.1 refuses a ``<mimic>`` without the attribute ``joint``, MuJoCo 4.0 that and a joint that mimics
  itself.
- Otherwise MuJoCo warns and lets the joint move freely, as Pinocchio and PyBullet 3.2.7 do with every mimic
  joint by default.

dynx reads a joint that follows a missing joint as moving freely, and refuses a joint that follows itself.

What to do: name the joint to follow, or remove the tag. ``dynx doctor --fix`` corrects a misspelled name of
the attribute, ``<mimic jiont="finger"/>``. Otherwise it removes the tag, so that the joint moves freely, as
in the engines that load the file.
"""

from collections.abc import Iterable

from dynx.errors import escaped, shown
from dynx.model.xml.source import SourceElement
from dynx.rules import Case, Correction, EditingRule, correction, found_at, measured_on
from dynx.rules.attributes import meant_name, renaming
from dynx.rules.joints import SINGLE, elements_in_joints


class MimicOfNothing(EditingRule):
    stage = "reading"
    advice = "Name the joint to follow, or remove <mimic>."
    engines = measured_on("pinocchio", "mujoco", "drake")
    changed = "removed <mimic> from joints that had nothing to follow"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the first ``<mimic>`` of every joint."""
        for joint, mimic in elements_in_joints(case, "mimic"):
            message = _why_nothing(case, joint, mimic)
            meant = _misspelled(case, joint, mimic)
            if meant is not None:
                text = f"{message}; its joint is {shown(mimic.attributes[meant])} in {escaped(meant)}"
                edits = renaming(case, mimic, meant, "joint")
                yield Correction(found_at(mimic, text), edits, ("joint",), whole=True)
            elif message is not None:
                edits = tuple(case.source.removal(each) for each in joint.all("mimic"))
                yield correction(mimic, message, *edits)


def _misspelled(case: Case, joint: SourceElement, mimic: SourceElement) -> str | None:
    """Return the attribute of a ``<mimic>`` without ``joint`` that names a joint which follows none."""
    if "joint" in mimic.attributes or joint.attributes.get("type") not in SINGLE:
        return None
    others = {name for name, other in case.joints.items() if other.first("mimic") is None}
    names = (name for name, text in mimic.attributes.items() if text in others)
    return next((name for name in names if meant_name(name, ("joint",), ())), None)


def _why_nothing(case: Case, joint: SourceElement, mimic: SourceElement) -> str | None:
    followed = mimic.attributes.get("joint")
    if not followed:
        return "<mimic> names no joint"
    if followed == joint.attributes.get("name"):
        return "the joint mimics itself"
    if followed not in case.joints:
        return f"the joint mimics {shown(followed)}, which does not exist"
    if joint.attributes.get("type") not in SINGLE:
        return f"the joint mimics {shown(followed)} and is {joint.attributes.get('type', 'of no type')}"
    return None
