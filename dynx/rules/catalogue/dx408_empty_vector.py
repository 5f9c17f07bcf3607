"""DX408 empty-vector: An origin has a position or angles without numbers.

A template whose variable was empty, or an exporter that had nothing to say. URDF's default for what is not
given is zero, and a reader of the file takes an empty vector for that.

- Pinocchio 4.1 refuses the file where the origin is that of a ``<joint>``; in an ``<inertial>`` it drops
  the whole inertial with a line on stderr, so the link weighs nothing.
- Drake 1.51 refuses the file.
- PyBullet 3.2.7 prints a warning and uses zeros; MuJoCo 4.0 uses zeros. So does dynx.

The effect is a file that does not load, or a link without mass: of order 0.01 to 1 in the mass matrix.

What to do: take the attribute away, or write ``0 0 0``. ``dynx doctor --fix`` takes it away.
"""

from dynx.model.xml.source import Edit
from dynx.rules import Case, measured_on
from dynx.rules.text.misspelled_numbers import MisspelledNumberRule
from dynx.rules.text.number_text import Misspelling
from dynx.rules.text.numeric_attributes import NumericAttribute


class EmptyVector(MisspelledNumberRule):
    advice = "Take the empty attribute away."
    engines = measured_on("pinocchio", "drake")
    changed = "took empty vectors of origins away"
    fault = "empty"
    description = "without any number"
    elements = ("origin",)

    def edit(self, case: Case, attribute: NumericAttribute, misspelling: Misspelling) -> Edit:
        """Without the attribute."""
        return case.source.removing_attribute(attribute.element, attribute.name)
