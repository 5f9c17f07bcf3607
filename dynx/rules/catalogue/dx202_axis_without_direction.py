"""DX202 axis-without-direction: The axis of a joint that moves is zero or empty.

``<axis xyz="0 0 0"/>`` and ``<axis/>`` define no direction of motion. Exporters write the first for fixed
joints, where it is ignored; once the type is changed to ``revolute`` it matters. A joint without any
``<axis>`` is fine: URDF's default (1, 0, 0) is used by all engines alike. A direction in an attribute that is
not ``xyz`` is DX218.

- Pinocchio 4.1 loads it. The joint has a coordinate that moves nothing: its row and column of the mass matrix
  are zero, and forward dynamics gives NaN.
- PyBullet 3.2.7 loads it. With the zero axis, positions behind the joint are NaN, inverse dynamics and mass
  matrix fail. For ``<axis/>`` the axis is whatever its memory held, another at each load: the result is
  undefined. Reports say "not used" there, not "refused".
- MuJoCo 4.0 refuses the file.
- Drake 1.51 refuses the zero axis, and reads ``<axis/>`` as (1, 0, 0).

What to do: write the direction. ``<axis x="0" y="0" z="1"/>`` contains it, and ``dynx doctor --fix`` writes
``xyz="0 0 1"``. Otherwise the file does not contain it, so ``dynx doctor --fix`` writes URDF's default,
(1, 0, 0). If the joint should not move, ``--choose DX202=fixed`` makes it a fixed joint.
"""

from collections.abc import Iterable

from dynx.model.xml.source import SourceElement
from dynx.rules import EVERY_ENGINE, Case, Correction, EditingRule, correction, found_at
from dynx.rules.joints import SINGLE, elements_in_joints, misspelled_direction
from dynx.rules.numbers_in_text import is_number

_PARTS = frozenset("xyz")


class AxisWithoutDirection(EditingRule):
    stage = "reading"
    advice = "Write the direction of the axis, or make the joint fixed."
    engines = EVERY_ENGINE
    choices = {
        "x": "make an axis without direction (1, 0, 0), URDF's default",
        "fixed": "make a joint whose axis has no direction fixed",
    }
    changed = "gave joints without a direction to move in one, or fixed them"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield axes of revolute, continuous and prismatic joints."""
        for joint, axis in elements_in_joints(case, "axis", SINGLE):
            if misspelled_direction(axis) is not None:
                continue
            words = axis.attributes.get("xyz", "").split()
            if any(not is_number(word) or float(word) != 0.0 for word in words):
                continue
            what = "is zero" if words else "has no numbers"
            message = f"the axis of a {joint.attributes['type']} joint {what}"
            written = _in_parts(axis)
            if written is not None:
                removals = (
                    case.source.attribute_removal(axis, name) for name in _PARTS & axis.attributes.keys()
                )
                edits = (*removals, case.source.attribute_edit(axis, "xyz", written))
                place = found_at(axis, f"{message}; xyz is {written} in attributes of their own")
                yield Correction(place, edits, ("xyz",), whole=True)
                continue
            if self.chosen(case) == "fixed":
                edit = case.source.attribute_edit(joint, "type", "fixed")
            else:
                edit = case.source.attribute_edit(axis, "xyz", "1 0 0")
            yield correction(axis, message, edit)


def _in_parts(axis: SourceElement) -> str | None:
    """Return the direction of an axis without ``xyz`` whose x, y and z are attributes of their own."""
    words = [axis.attributes.get(name, "0").strip() for name in sorted(_PARTS)]
    if "xyz" in axis.attributes or not all(map(is_number, words)) or not any(map(float, words)):
        return None
    return " ".join(words)
