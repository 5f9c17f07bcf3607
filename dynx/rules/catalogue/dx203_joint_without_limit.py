"""DX203 joint-without-limit: A revolute or prismatic joint has no limit.

URDF requires a ``<limit>``; the type of a joint that can rotate without limit is ``continuous``.

- Pinocchio 4.1 and PyBullet 3.2.7 refuse the file.
- MuJoCo 4.0 and Drake 1.51 read a joint without limits.

A tag spelled wrongly, such as ``<Limit>``, has the same effect: readers do not know it.

What to do: write the limits of the joint. A misspelled tag contains them, and ``dynx doctor --fix`` corrects
it. Otherwise the file does not contain them, so ``dynx doctor --fix`` leaves the
joint unlimited: a revolute joint becomes ``continuous``, a prismatic one gets the largest double for its
limits. ``--choose DX203=zero`` writes ``lower="0" upper="0"`` instead, the numbers that URDF has for a
``<limit>`` in which they are not given; the joint then must not move in simulations that keep to limits.
"""

from collections.abc import Iterable

from dynx.errors import escaped
from dynx.model.xml.quoting import quoteattr
from dynx.model.xml.source import Edit, SourceElement
from dynx.rules import Case, Correction, EditingRule, correction, found_at, measured_on
from dynx.rules.attributes import meant_name
from dynx.rules.joints import UNLIMITED, joints_of_type
from dynx.rules.numbers_in_text import LARGEST

_ZERO = f'<limit lower="0" upper="0" effort="{LARGEST}" velocity="{LARGEST}"/>'


class JointWithoutLimit(EditingRule):
    stage = "reading"
    advice = 'Write the <limit> of the joint, or type="continuous".'
    engines = measured_on("pinocchio", "pybullet")
    choices = {
        "unlimited": "leave joints without limit unlimited: revolute ones become continuous",
        "zero": "give joints without limit lower and upper limits of 0",
    }
    changed = "made joints without limit continuous, or gave them one"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield such joints."""
        for joint in joints_of_type(case, ("revolute", "prismatic")):
            if joint.first("limit") is None:
                message = f"the joint is {joint.attributes['type']} and has no <limit>"
                written = [each for each in joint.children if meant_name(each.tag, ("limit",), ())]
                if len(written) == 1:
                    place = found_at(joint, f"{message}; its limits are in <{escaped(written[0].tag)}>")
                    yield Correction(place, (_renamed(case, written[0]),), ("<limit>",), whole=True)
                else:
                    yield correction(joint, message, self._correction_edit(case, joint))

    def _correction_edit(self, case: Case, joint: SourceElement) -> Edit:
        if self.chosen(case) == "zero":
            return case.source.insertion(joint, _ZERO)
        if joint.attributes["type"] == "revolute":
            return case.source.attribute_edit(joint, "type", "continuous")
        return case.source.insertion(joint, UNLIMITED)


def _renamed(case: Case, element: SourceElement) -> Edit:
    """Return the edit that makes an element a limit with the same attributes."""
    attributes = (f"{name}={quoteattr(text)}" for name, text in element.attributes.items())
    return case.source.replacement(element, f"<{' '.join(('limit', *attributes))}/>")
