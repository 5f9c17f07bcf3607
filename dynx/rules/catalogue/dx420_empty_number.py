"""DX420 empty-number: An attribute that should hold a number is empty.

An exporter writes ``<limit lower="" upper="" .../>`` or ``<dynamics damping="" friction=""/>`` for what the
user did not fill in. A person reads an empty attribute as one that is not there.

- Pinocchio 4.1 refuses the file where the attribute is in a ``<joint>``, fixed ones included. With an empty
  mass it drops the whole inertial with a line on stderr, with an empty moment of inertia the tensor.
- Drake 1.51 refuses the file.
- PyBullet 3.2.7 reads 0. MuJoCo 4.0 reads an empty attribute of a joint as missing, and refuses an empty mass
  or moment.

dynx refuses it with its line, except in elements that it does not read (limits of a fixed joint).

What to do: write the number, or remove the attribute. ``dynx doctor --fix`` removes it in a joint, so that
its default holds, and writes 0 for a mass or an entry of a tensor.
"""

from dynx.model.xml.source import Edit
from dynx.rules import Case, measured_on
from dynx.rules.text.misspelled_numbers import MisspelledNumberRule
from dynx.rules.text.number_text import Misspelling
from dynx.rules.text.numeric_attributes import NumericAttribute

_REQUIRED = ("mass", "inertia")


class EmptyNumber(MisspelledNumberRule):
    advice = "Write the number, or remove the attribute."
    engines = measured_on("pinocchio", "drake")
    changed = "removed empty attributes of joints, or wrote 0 for those of inertials"
    fault = "empty"
    description = "without any number"
    elements = (*_REQUIRED, "limit", "dynamics", "mimic", "calibration", "safety_controller")

    def edit(self, case: Case, attribute: NumericAttribute, misspelling: Misspelling) -> Edit:
        """Remove the attribute, or write 0 where one is required."""
        if attribute.element.tag in _REQUIRED:
            return case.source.attribute_edit(attribute.element, attribute.name, "0")
        return case.source.attribute_removal(attribute.element, attribute.name)
