"""Base of the rules about numbers written in a form that engines read differently."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from functools import lru_cache
from typing import ClassVar

from dynx.errors import shown
from dynx.model.xml.source import Edit, XmlSource
from dynx.rules.case import Case
from dynx.rules.editing import Correction, EditingRule, correction
from dynx.rules.rule import Stage
from dynx.rules.text.number_text import Fault, Misspelling, misspelled_number, misspelled_vector
from dynx.rules.text.numeric_attributes import NumericAttribute, numeric_attributes


class MisspelledNumberRule(EditingRule):
    """A rule about one fault in the text of a number, in every numeric attribute."""

    stage: ClassVar[Stage] = "reading"
    fault: ClassVar[Fault]

    description: ClassVar[str]
    """The fault as the end of a sentence, in which ``{meant}`` stands for the corrected text and
    ``{count}`` for the number of words in it."""

    elements: ClassVar[Collection[str] | None] = None
    """Tags of the elements in whose attributes the fault matters; None for all."""

    def applies(self, attribute: NumericAttribute) -> bool:
        """Check whether the fault matters in this attribute."""
        return self.elements is None or attribute.element.tag in self.elements

    def matches(self, attribute: NumericAttribute, misspelling: Misspelling) -> bool:
        """Check whether the attribute has the fault of this rule where it matters."""
        return misspelling.fault == self.fault and self.applies(attribute)

    def text_for(self, case: Case, misspelling: Misspelling) -> str:
        """Return the corrected text."""
        return misspelling.meant

    def edit(self, case: Case, attribute: NumericAttribute, misspelling: Misspelling) -> Edit:
        """Return the edit that corrects the attribute."""
        return case.source.attribute_edit(attribute.element, attribute.name, self.text_for(case, misspelling))

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield every attribute with the fault."""
        for attribute, text, misspelling in _misspelled(case.source):
            if not self.matches(attribute, misspelling):
                continue
            end = self.description.format(meant=self.text_for(case, misspelling), count=len(text.split()))
            message = f"{attribute.name} of <{attribute.element.tag}> is {shown(text)}, {end}"
            yield correction(attribute.element, message, self.edit(case, attribute, misspelling))


# Each of the rules examines the same document before the first remedy makes another.
@lru_cache(maxsize=4)
def _misspelled(source: XmlSource) -> Sequence[tuple[NumericAttribute, str, Misspelling]]:
    """Find the attributes with a fault, each with its text, in document order."""
    found = []
    for attribute in numeric_attributes(source):
        text = attribute.text_in(source)
        misspelling = misspelled_number(text) if attribute.count == 1 else misspelled_vector(text)
        if misspelling is not None:
            found.append((attribute, text, misspelling))
    return found
