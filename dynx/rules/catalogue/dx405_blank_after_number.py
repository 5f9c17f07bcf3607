"""DX405 blank-after-number: White space stands behind a number, or a no-break space in front of it.

It looks like the most harmless thing in a file. Pinocchio 4.1 (its reader is urdfdom) passes over white space
in front of a number and wants nothing behind it:

- in a ``<mass>`` it says on stderr that the mass "is not a float" and drops the whole inertial, so the link
  weighs nothing;
- in an ``<inertia>`` it drops the tensor alone, also with a line on stderr, so the link is a point mass;
- in a ``<limit>``, ``<dynamics>`` or ``<mimic>`` of a joint it refuses the file.

PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 read the number, and so does dynx. In front of a number all engines
read blanks, tabs and line breaks. A no-break space (U+00A0) is a blank to none of them: behind a number
MuJoCo refuses it too, and in front of one PyBullet reads 0, and MuJoCo and Drake refuse the file. Blanks
between and around the three numbers of a vector are fine everywhere (tabs are not, see DX406).

The effect is a link without mass, or without a moment of inertia: the mass matrix is off by as much as the
link matters, of order 0.01 to 1.

What to do: take the blank away. ``dynx doctor --fix`` does so and changes no digit.
"""

from dynx.rules import measured_on
from dynx.rules.text.misspelled_numbers import MisspelledNumberRule
from dynx.rules.text.numeric_attributes import NumericAttribute

_READ_ALL_THE_SAME = ("box", "sphere", "cylinder", "capsule", "mesh")


class BlankAfterNumber(MisspelledNumberRule):
    advice = "Take the white space away."
    engines = measured_on("pinocchio")
    changed = "took white space around numbers away"
    fault = "blank"
    description = "with white space that not every engine passes over"

    def applies(self, attribute: NumericAttribute) -> bool:
        """Not to the sizes of shapes, which all engines read so."""
        return attribute.element.tag not in _READ_ALL_THE_SAME
