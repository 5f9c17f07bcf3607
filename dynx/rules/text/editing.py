"""Rules that come down to corrections: places in the text, each with the edits that mend it."""

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
    """One place where a rule applies, and what to do there; without edits nothing mends it."""

    detection: Detection
    edits: tuple[Edit, ...] = ()


def found_at(element: SourceElement, message: str) -> Detection:
    """The detection in `element`: its line, and the link or joint of the robot that it belongs to."""
    part = element
    while part.parent is not None and part.parent.parent is not None:
        part = part.parent
    name = part.attributes.get("name")
    link = name if part.tag == "link" else None
    joint = name if part.tag == "joint" else None
    return Detection(link, joint, element.line, message)


class EditingRule(Rule):
    """A rule that says its corrections once, for finding their places and for mending them."""

    changed: ClassVar[str]
    """What the remedy did, said once for all places; see `Remedy.changed`."""

    changes_physics: ClassVar[bool] = False

    @abstractmethod
    def corrections(self, case: Case) -> Iterable[Correction]:
        """One for every place where the rule applies, in document order."""

    def detect(self, case: Case) -> Sequence[Detection]:
        """The places of the corrections."""
        return [each.detection for each in self.corrections(case)]

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """The edits of these places."""
        wanted = set(detections)
        edits = [edit for each in self.corrections(case) if each.detection in wanted for edit in each.edits]
        if not edits:
            return None
        mended = case.with_source(case.source.edited(*edits))
        return Remedy(mended, self.changed, self.decision(case), self.changes_physics)


class OptionalEditingRule(EditingRule):
    """An editing rule about practice: the text stays as it is unless the user chose a way to mend it."""

    kind: ClassVar[Kind] = "practice"
    KEEP: ClassVar[str] = "keep"
    """The first of `choices`, which leaves the text."""

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """The edits of these places, if they were chosen."""
        return None if self.chosen(case) == self.KEEP else super().remedy(case, detections)


class CallingRule(Rule):
    """A rule about what engines add at run time: no text mends it, calls do."""

    calls: ClassVar[tuple[str, ...]]
    """Ids of `LoadedRobot.CALLS`."""

    changed: ClassVar[str]

    @abstractmethod
    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Every place that makes engines add something, in document order, whatever was called."""

    def detect(self, case: Case) -> Sequence[Detection]:
        """The occurrences; none once the calls are made."""
        return [] if case.calls.issuperset(self.calls) else list(self.occurrences(case))

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """The calls, which act on the whole robot."""
        return Remedy(case.with_calls(*self.calls), self.changed)
