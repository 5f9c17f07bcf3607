"""Groups of engines that agree with each other, and those that agree with the file."""

from __future__ import annotations

import math
from dataclasses import dataclass

from dynx.doctor.report import DoctorReport, EngineResult


@dataclass(frozen=True)
class Vote:
    """Groups of engines that load the file alike, the largest first.

    Two engines are alike where no quantity differs by more than the tolerance; such pairs connect a group.
    `right` are the engines without an error against the reference values.
    """

    groups: tuple[tuple[str, ...], ...]
    right: tuple[str, ...]
    refused: tuple[str, ...]

    @property
    def alone(self) -> tuple[str, ...]:
        """Engines that agree with no other engine, if there are others."""
        single = tuple(group[0] for group in self.groups if len(group) == 1)
        return single if len(self.groups) > 1 else ()


def vote(report: DoctorReport) -> Vote:
    """Group the engines by how they loaded the file."""
    voters = [each.engine for each in report.engines if each.no_results is None]
    differing = {
        frozenset(pair.engines) for pair in report.pairs if not pair.relative_error <= report.tolerance
    }
    compared = {frozenset(pair.engines) for pair in report.pairs}
    groups: list[list[str]] = []
    for engine in voters:
        alike = [
            group
            for group in groups
            if any(frozenset((engine, other)) in compared - differing for other in group)
        ]
        merged = [member for group in alike for member in group] + [engine]
        groups = [group for group in groups if group not in alike] + [merged]
    ordered = sorted(groups, key=lambda group: (-len(group), voters.index(group[0])))
    right = tuple(
        each.engine for each in report.engines if each.no_results is None and is_right(each, report)
    )
    refused = tuple(each.engine for each in report.engines if each.no_results is not None)
    return Vote(tuple(map(tuple, ordered)), right, refused)


def is_right(engine: EngineResult, report: DoctorReport) -> bool:
    """Check that an engine has no error above the tolerance on the file as loaded."""
    return all(error <= report.tolerance for error in engine.before.values())


def largest_error(report: DoctorReport) -> float:
    """Return the largest error of any engine that loads the file as it is."""
    found = [largest_quantity_error(each) for each in report.engines]
    return max((error for _, error in filter(None, found)), default=0.0)


def largest_quantity_error(engine: EngineResult) -> tuple[str, float] | None:
    """Return the quantity with the largest error of an engine, and that error."""
    if not engine.before:
        return None
    return max(engine.before.items(), key=lambda item: math.inf if math.isnan(item[1]) else item[1])
