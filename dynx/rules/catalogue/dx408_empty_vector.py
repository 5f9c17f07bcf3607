"""DX408 empty-vector: An origin has a position or angles without numbers.

The variable of a template was empty, or an exporter had no value. URDF's default for a missing attribute is
zero, and a person would read an empty vector so.

- Pinocchio 4.1 refuses the file where the origin is that of a ``<joint>``; in an ``<inertial>`` it drops the
  whole inertial with a line on stderr, so the link weighs nothing.
- Drake 1.51 refuses the file.
- PyBullet 3.2.7 prints a warning and uses zeros; MuJoCo 4.0 uses zeros. So does dynx.

The effect is a file that does not load, or a link without mass: of order 0.01 to 1 in the mass matrix.

What to do: remove the attribute, or write ``0 0 0``. ``dynx doctor --fix`` removes it.
"""

from dynx.model.xml.source import Edit
from dynx.rules import Case, measured_on
from dynx.rules.numbers_in_text import MisspelledNumberRule, Misspelling, NumericAttribute


class EmptyVector(MisspelledNumberRule):
    advice = "Remove the empty attribute."
    engines = measured_on("pinocchio", "drake")
    changed = "removed empty vectors of origins"
    fault = "empty"
    description = "without any number"
    elements = ("origin",)

    def edit(self, case: Case, attribute: NumericAttribute, misspelling: Misspelling) -> Edit:
        """Return the edit that removes the attribute."""
        return case.source.attribute_removal(attribute.element, attribute.name)
