"""DX533 name-with-blanks: A name is blank, or begins or ends with a blank.

``<link name=" "/>`` or ``<joint name="elbow ">``: nobody sees the blank, and it is part of the name. A
program that looks up ``elbow`` does not find the joint, and a joint whose parent is ``base`` does not find
the link ``base `` (every engine refuses that file, and so does dynx, which names the similar link).

Pinocchio 4.1, PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 load such a file and keep the blanks, and so does
dynx.

What to do: write the name without them. ``dynx doctor --fix`` does so with ``--choose DX533=trim``, wherever
the document names the link or joint; a name of blanks alone becomes ``link`` or ``joint``, with a number
where that is taken. By default it leaves the names, which programs may use.
"""

from collections.abc import Iterable

from dynx.errors import shown
from dynx.model.xml.source import Edit, SourceElement
from dynx.rules import Case, Correction, OptionalEditingRule, correction
from dynx.rules.joints import fresh_name, joint_rename, link_rename


class NameWithBlanks(OptionalEditingRule):
    stage = "reading"
    advice = "Write the name without blanks around it."
    choices = {
        "keep": "leave blanks around names as they are",
        "trim": "remove blanks around names, wherever the document mentions them",
    }
    changed = "removed blanks around names"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the robot, its links and its joints with such a name."""
        root = case.source.root
        taken = {"link": set(case.links), "joint": set(case.joints), "robot": set[str]()}
        for element in [root, *root.all("link"), *root.all("joint")]:
            name = element.attributes.get("name", "")
            if element.tag in taken and name != name.strip():
                new = fresh_name(name.strip() or element.tag, taken[element.tag])
                taken[element.tag].add(new)
                what = "is blank" if not name.strip() else "begins or ends with a blank"
                message = f"the name of the <{element.tag}>, {shown(name)}, {what}"
                yield correction(element, message, *_edits(case, element, name, new))


def _edits(case: Case, element: SourceElement, old: str, new: str) -> Iterable[Edit]:
    if element.tag == "link":
        return link_rename(case.source, old, new)
    if element.tag == "joint":
        return joint_rename(case.source, old, new)
    return [case.source.attribute_edit(element, "name", new)]
