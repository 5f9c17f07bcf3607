"""DX218 axis-attribute-misspelled: The direction of an axis stands in an attribute that is not ``xyz``.

``<axis xzy="0 0 1"/>``, ``<axis XYZ="0 0 1"/>`` or ``<axis rpy="0 0 1"/>``: the numbers are there, and no
engine looks for them under that name.

- Pinocchio 4.1 loads it with a zero axis. The joint has a coordinate that moves nothing: its row and column
  of the mass matrix are zero.
- PyBullet 3.2.7 loads it, and the axis is whatever its memory held: zero at first, another at each load of a
  longer program. dynx does not use such results and reports the file as refused.
- MuJoCo 4.0 refuses the file ("required attribute missing: 'xyz'"), also where the joint is fixed.
- Drake 1.51 reads (1, 0, 0), URDF's default for a joint without ``<axis>``.

The other engines ignore the axis of a fixed joint. dynx refuses the axis of a joint that moves, and names the
attribute.

What to do: correct the name. ``dynx doctor --fix`` does so where the attribute holds three numbers that are
not all zero. An axis without any numbers is DX202, or DX219 on a fixed joint.
"""

from collections.abc import Iterable

from dynx.errors import escaped
from dynx.rules import EVERY_ENGINE, Case, Correction, EditingRule, correction
from dynx.rules.joints import misspelled_axes


class AxisAttributeMisspelled(EditingRule):
    stage = "reading"
    advice = "Write the direction as xyz."
    engines = EVERY_ENGINE
    changed = "named the attribute of axes xyz"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield axes of joints of every type."""
        for _, axis, written in misspelled_axes(case):
            text = axis.attributes[written]
            edits = (
                case.source.attribute_removal(axis, written),
                case.source.attribute_edit(axis, "xyz", text),
            )
            message = f"<axis> has its direction {text} in {escaped(written)} instead of xyz"
            yield correction(axis, message, *edits)
