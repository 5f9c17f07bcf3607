"""Rules that correct the text: for each place where the rule applies they give the edits that correct it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import ClassVar

from dynx.model.xml.source import Edit, SourceElement
from dynx.rules.case import Case
from dynx.rules.rule import Detection, Kind, Remedy, Rule


@dataclass(frozen=True)
class Correction:
    """One place where a rule applies, and the edits that correct it; no edits where none does.

    `renamed` lists the attributes whose number stood under a misspelled name. Engines then read another
    number, so that this changes the physics. With `whole` the edits do nothing else.
    """

    detection: Detection
    edits: tuple[Edit, ...] = ()
    renamed: tuple[str, ...] = ()
    whole: bool = False


def found_at(element: SourceElement, message: str) -> Detection:
    """Return the detection in `element`: its line, and the link or joint of the robot that it belongs to."""
    part = element
    while part.parent is not None and part.parent.parent is not None:
        part = part.parent
    name = part.attributes.get("name")
    link = name if part.tag == "link" else None
    joint = name if part.tag == "joint" else None
    return Detection(link, joint, element.line, message)


def correction(element: SourceElement, message: str, *edits: Edit) -> Correction:
    """Return the correction of `element` by these edits."""
    return Correction(found_at(element, message), edits)


class EditingRule(Rule):
    """A rule whose corrections both find the places and correct them."""

    changed: ClassVar[str]
    """Description of the change, stated once for all places; see `Remedy.changed`."""

    changes_physics: ClassVar[bool] = False

    @abstractmethod
    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield a correction for every place where the rule applies, in document order."""

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the places of the corrections."""
        return (each.detection for each in self.corrections(case))

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Return the edits of these places."""
        wanted = set(detections)
        made = [each for each in self.corrections(case) if each.detection in wanted and each.edits]
        if not made:
            return None
        mended = case.with_source(case.source.apply(*(edit for each in made for edit in each.edits)))
        renamed = dict.fromkeys(name for each in made for name in each.renamed)
        parts = [] if all(each.whole for each in made) else [self.changed]
        parts += [f"corrected the misspelled name of {' and of '.join(renamed)}"] if renamed else []
        physics = self.changes_physics or bool(renamed)
        return Remedy(mended, " and ".join(parts), self.decision(case), physics)


class OptionalEditingRule(EditingRule):
    """An editing rule about practice: the text stays as it is unless the user chose another
    of `choices` than the first, ``keep``."""

    kind: ClassVar[Kind] = "practice"

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Return the edits of these places, if they were chosen."""
        return None if self.chosen(case) == "keep" else super().remedy(case, detections)
