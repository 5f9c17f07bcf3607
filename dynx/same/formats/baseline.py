"""Accepted differences of two descriptions, in the files of `dynx.files.baseline`."""

from __future__ import annotations

from typing import Any

from dynx.files.baseline import (
    BaselineComparison,
    KnownDifferences,
    Place,
    PlacedDifference,
    document_of_differences,
    relative_key,
)
from dynx.model.loading import split_arguments
from dynx.same.formats.findings import SameFinding, base_of, findings
from dynx.same.report import SameReport


class SameBaseline(KnownDifferences):
    """The known differences of pairs. Paths of files are relative to `folder`, the folder of the baseline
    file."""

    def compare(self, report: SameReport) -> BaselineComparison:
        """Compare a report; differences that do not change the verdict do not count."""
        keys = [robot_key(name, self.folder) for name in (report.second, report.first)]
        found = differences(report, self.folder)
        return self.compare_differences(found, (keys[0], base_of(report), keys[1]))


def place_of(report: SameReport, each: SameFinding, folder: str) -> Place:
    """Return the identity of a finding."""
    second, first = (robot_key(name, folder) for name in (report.second, report.first))
    return Place(second, base_of(report), each.rule, each.link, each.joint, other=first)


def differences(report: SameReport, folder: str) -> list[PlacedDifference]:
    """List the differences of the verdict."""
    return [
        PlacedDifference(place_of(report, each, folder), relative_error=each.size)
        for each in findings(report)
        if each.level == "error"
    ]


def robot_key(name: str, folder: str) -> str:
    """Return the name of a description, or its path from the folder of the baseline."""
    return relative_key(name, split_arguments(name)[0], folder)


def baseline_document(report: SameReport, folder: str) -> dict[str, Any]:
    """Make the document that accepts all differences of a report."""
    return document_of_differences(differences(report, folder))
