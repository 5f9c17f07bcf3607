"""DX429 expression-not-expanded: A number that dynx does not need is an expression of xacro.

``<origin rpy="${3.14159/2} 0 0"/>`` of a ``<collision>``, or ``<safety_controller k_velocity="${k}"/>``, is
left in a file that was written as URDF and never passed through ``xacro``, or that was expanded by hand.

- In a ``<collision>`` MuJoCo 4.0 refuses the file ("bad format in attribute 'rpy'").
- In ``<calibration>``, ``<safety_controller>``, the position limits of a continuous joint, and the
  ``<limit>``, ``<dynamics>`` and ``<mimic>`` of a fixed joint, Pinocchio 4.1 refuses the file; so does Drake
  1.51 in these limits and this ``<mimic>``.
- PyBullet 3.2.7 reads 0, without a warning: the shape is elsewhere, or has no size.

In a ``<visual>`` every engine loads the file. Elsewhere in a joint, and in an ``<inertial>``, dynx refuses
it, because the dynamics depends on the number.

What to do: write the number, or name the file ``.xacro`` and load it through ``xacro``. ``dynx doctor
--fix`` writes the value of mere arithmetic (numbers, ``pi``, ``+ - * /``). The file may not hold the value of
any other expression: the ``<collision>``, the element of the joint, or the position limit is removed.
"""

from collections.abc import Iterable, Iterator

from dynx.errors import shown
from dynx.model.xml.source import Edit, SourceElement
from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.numbers_in_text import (
    Misspelling,
    NumericAttribute,
    joint_attributes,
    misspelled_number,
    misspelled_vector,
    shape_attributes,
)

_NEVER_READ = ("calibration", "safety_controller")
_UNREAD_OF_FIXED = (*_NEVER_READ, "limit", "dynamics", "mimic")
_UNREAD_OF_CONTINUOUS = ("lower", "upper")

Expression = tuple[NumericAttribute, Misspelling]


class ExpressionNotExpanded(EditingRule):
    stage = "reading"
    advice = "Write the number, or expand the file with xacro."
    engines = measured_on("pinocchio", "mujoco", "drake")
    changed = "wrote the values of expressions of xacro, or removed what they belong to"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield one correction for each collision and each element of a joint with such numbers."""
        for link in case.source.root.all("link"):
            for collision in link.all("collision"):
                found = [*_expressions(case, shape_attributes(collision))]
                if found:
                    yield _correction(case, found, case.source.removal(collision))
        for joint in case.source.root.all("joint"):
            kind = joint.attributes.get("type")
            by_element: dict[SourceElement, list[Expression]] = {}
            for each in _expressions(case, joint_attributes(joint)):
                if _is_unread(each[0], kind):
                    by_element.setdefault(each[0].element, []).append(each)
            for element, found in by_element.items():
                if element.tag == "limit" and kind == "continuous":
                    removals = (case.source.attribute_removal(element, each.name) for each, _ in found)
                    yield _correction(case, found, *removals)
                else:
                    yield _correction(case, found, case.source.removal(element))


def _expressions(case: Case, attributes: Iterable[NumericAttribute]) -> Iterator[Expression]:
    for attribute in attributes:
        text = attribute.text_in(case.source)
        found = misspelled_number(text) if attribute.count == 1 else misspelled_vector(text)
        if found is not None and found.fault == "expression":
            yield attribute, found


def _is_unread(attribute: NumericAttribute, kind: str | None) -> bool:
    """Check whether dynx does not read an attribute of a joint of a type."""
    tag = attribute.element.tag
    if kind == "continuous" and tag == "limit":
        return attribute.name in _UNREAD_OF_CONTINUOUS
    return tag in (_UNREAD_OF_FIXED if kind == "fixed" else _NEVER_READ)


def _correction(case: Case, found: list[Expression], *removals: Edit) -> Correction:
    """Write the values where all are known, and remove what has the expressions otherwise."""
    first = found[0][0]
    text = shown(first.element.attributes[first.name])
    edits = [
        case.source.attribute_edit(each.element, each.name, misspelling.meant)
        for each, misspelling in found
        if misspelling.meant
    ]
    message = f"{first.name} of <{first.element.tag}> is {text}, which xacro did not expand"
    return correction(first.element, message, *(edits if len(edits) == len(found) else removals))
