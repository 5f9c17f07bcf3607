"""Which engines agree with each other, and which of them with what the file says."""

from __future__ import annotations

import math
from dataclasses import dataclass

from dynx.doctor.report import DoctorReport, EngineResult


@dataclass(frozen=True)
class Vote:
    """Engines that load the file alike, largest group first.

    Two are alike where no quantity differs by more than the tolerance; groups are what such pairs
    connect. `right` are those whose answers are the file's own.
    """

    groups: tuple[tuple[str, ...], ...]
    right: tuple[str, ...]
    refused: tuple[str, ...]

    @property
    def alone(self) -> tuple[str, ...]:
        """Engines that no other agrees with, though others were asked."""
        single = tuple(group[0] for group in self.groups if len(group) == 1)
        return single if len(self.groups) > 1 else ()


def vote(report: DoctorReport) -> Vote:
    """The vote over the file as it was loaded."""
    voters = [each.engine for each in report.engines if each.refused is None]
    differing = {
        frozenset(pair.engines) for pair in report.pairs if not pair.relative_error <= report.tolerance
    }
    compared = {frozenset(pair.engines) for pair in report.pairs}
    groups: list[list[str]] = []
    for engine in voters:
        friends = [
            group
            for group in groups
            if any(frozenset((engine, other)) in compared - differing for other in group)
        ]
        merged = [member for group in friends for member in group] + [engine]
        groups = [group for group in groups if group not in friends] + [merged]
    ordered = sorted(groups, key=lambda group: (-len(group), voters.index(group[0])))
    right = tuple(each.engine for each in report.engines if each.refused is None and is_right(each, report))
    refused = tuple(each.engine for each in report.engines if each.refused is not None)
    return Vote(tuple(map(tuple, ordered)), right, refused)


def is_right(engine: EngineResult, report: DoctorReport) -> bool:
    """Whether an engine's answers as loaded are those of the file."""
    return all(error <= report.tolerance for error in engine.before.values())


def largest_error(report: DoctorReport) -> float:
    """The largest error of any engine that loads the file as it is."""
    found = [worst(each) for each in report.engines]
    return max((error for _, error in filter(None, found)), default=0.0)


def worst(engine: EngineResult) -> tuple[str, float] | None:
    """The quantity in which an engine is farthest from the file, and by how much."""
    if not engine.before:
        return None
    return max(engine.before.items(), key=lambda item: math.inf if math.isnan(item[1]) else item[1])
