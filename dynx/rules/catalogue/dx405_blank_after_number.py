"""DX405 blank-after-number: White space follows a number, or a no-break space precedes it.

Pinocchio 4.1 (its reader is urdfdom) skips white space in front of a number and accepts none behind it:

- in a ``<mass>`` it prints on stderr that the mass "is not a float" and drops the whole inertial, so the link
  weighs nothing;
- in an ``<inertia>`` it drops the tensor alone, also with a line on stderr, so the link is a point mass;
- in a ``<limit>``, ``<dynamics>`` or ``<mimic>`` of a joint it refuses the file.

PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 read the number, and so does dynx. In front of a number all engines
read blanks, tabs and line breaks. No engine treats a no-break space (U+00A0) as a blank: MuJoCo refuses it
behind a number; in front of one PyBullet reads 0, and MuJoCo and Drake refuse the file. Blanks between and
around the three numbers of a vector are accepted everywhere (tabs are not, see DX406).

The effect is a link without mass, or without a moment of inertia: the mass matrix is off by as much as the
link matters, of order 0.01 to 1.

What to do: remove the blank. ``dynx doctor --fix`` does so and changes no digit.
"""

from dynx.rules import measured_on
from dynx.rules.numbers_in_text import MisspelledNumberRule, NumericAttribute

_READ_ALIKE = ("box", "sphere", "cylinder", "capsule", "mesh")


class BlankAfterNumber(MisspelledNumberRule):
    advice = "Remove the white space."
    engines = measured_on("pinocchio")
    changed = "removed white space around numbers"
    fault = "blank"
    description = "with white space that not every engine skips"

    def applies(self, attribute: NumericAttribute) -> bool:
        """Check whether the attribute is no size of a shape, which all engines read alike."""
        return attribute.element.tag not in _READ_ALIKE
