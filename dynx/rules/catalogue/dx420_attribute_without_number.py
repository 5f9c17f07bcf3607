"""DX420 attribute-without-number: An attribute that should hold numbers is empty or holds other text.

An exporter writes ``<limit lower="" upper="" .../>`` for what the user did not fill in, ``nan`` for the
centre of a body without mass, or ``none``.

- Pinocchio 4.1 refuses the file where the attribute is in a ``<joint>``, fixed ones included. In an
  ``<inertial>`` it drops the tensor or the whole inertial with a line on stderr.
- Drake 1.51 refuses the file.
- PyBullet 3.2.7 reads 0 for any word, and ``nan`` and ``inf`` as they are: results are then NaN.
- MuJoCo 4.0 reads an empty attribute of a joint as missing, and ``nan`` in a joint as it is. It refuses
  words, and an empty mass or moment.

dynx refuses it with its line, except in elements that it does not read (limits of a fixed joint). An empty
``xyz`` or ``rpy`` is DX408, an infinite limit DX407. Expressions of xacro, ``${mass}``, are not corrected:
the file has to be expanded.

What to do: write the numbers. The file does not contain them, so ``dynx doctor --fix`` can only guess, and
the report says so: it writes 0 for a mass, an entry of a tensor and a word of a vector, and removes any other
attribute, so that its default holds.
"""

from dynx.model.xml.source import Edit
from dynx.rules import Case, measured_on
from dynx.rules.numbers_in_text import MisspelledNumberRule, Misspelling, NumericAttribute

_REQUIRED = ("mass", "inertia")


class AttributeWithoutNumber(MisspelledNumberRule):
    advice = "Write the numbers, or remove the attribute."
    engines = measured_on("pinocchio", "mujoco", "drake")
    changed = "removed attributes without a number, or wrote 0 for what is none"
    fault = "word"
    description = "which is no number that every engine reads"

    def matches(self, attribute: NumericAttribute, misspelling: Misspelling) -> bool:
        """Check for words, empty numbers, and infinite numbers other than limits."""
        if misspelling.fault == "infinite":
            return attribute.element.tag != "limit"
        return misspelling.fault == "word" or (misspelling.fault == "empty" and attribute.count == 1)

    def edit(self, case: Case, attribute: NumericAttribute, misspelling: Misspelling) -> Edit:
        """Return the edit that removes the attribute, or writes 0 where one is required."""
        element = attribute.element
        if element.tag in _REQUIRED:
            return case.source.attribute_edit(element, attribute.name, "0")
        if misspelling.fault == "word" and misspelling.meant:
            return case.source.attribute_edit(element, attribute.name, misspelling.meant)
        if element.tag == "axis":
            return case.source.removal(element)
        return case.source.attribute_removal(element, attribute.name)

    def decision(self, case: Case) -> str | None:
        """Return a sentence on the guess, which has no alternative."""
        return f"{self.id}: no number could be read in an attribute; 0 or its default was used"
