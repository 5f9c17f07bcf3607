"""Rules about one way of writing numbers that engines do not share."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from typing import ClassVar

from dynx.errors import shown
from dynx.model.xml.source import Edit
from dynx.rules.case import Case
from dynx.rules.rule import Stage
from dynx.rules.text.editing import Correction, EditingRule, found_at
from dynx.rules.text.number_text import Fault, Misspelling, misspelled_number, misspelled_vector
from dynx.rules.text.numeric_attributes import NumericAttribute, numeric_attributes


class MisspelledNumberRule(EditingRule):
    """The rule about one fault of number texts, at every place where numbers stand."""

    stage: ClassVar[Stage] = "reading"
    fault: ClassVar[Fault]

    @abstractmethod
    def said(self, written: str, meant: str) -> str:
        """What is the matter with a text `written` (quoted), as the end of a sentence."""

    def applies(self, attribute: NumericAttribute) -> bool:
        """Whether the fault matters in this attribute."""
        return True

    def text_for(self, case: Case, misspelling: Misspelling) -> str:
        """The text to write instead."""
        return misspelling.meant

    def mended(self, case: Case, attribute: NumericAttribute, misspelling: Misspelling) -> Edit:
        """The edit that writes it."""
        return case.source.setting(attribute.element, attribute.name, self.text_for(case, misspelling))

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Every attribute with the fault."""
        for attribute in numeric_attributes(case.source):
            find = misspelled_number if attribute.count == 1 else misspelled_vector
            text = attribute.text_in(case.source)
            misspelling = find(text)
            if misspelling is None or misspelling.fault != self.fault or not self.applies(attribute):
                continue
            what = f"{attribute.name} of <{attribute.element.tag}> is {shown(text)}"
            end = self.said(text, self.text_for(case, misspelling))
            edit = self.mended(case, attribute, misspelling)
            yield Correction(found_at(attribute.element, f"{what}, {end}"), (edit,))
