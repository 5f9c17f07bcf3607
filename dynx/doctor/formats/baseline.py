"""Accepted differences between engines: those of the rules that the user ignores, and those in baselines."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from dynx.doctor.report import DoctorReport
from dynx.files.baseline import (
    BaselineComparison,
    KnownDifferences,
    Place,
    PlacedDifference,
    document_of_differences,
    relative_key,
)
from dynx.model.loading import split_arguments

UNEXPLAINED = "unexplained"
"""Name in place of a rule for a difference that no rule explains."""


class Baseline(KnownDifferences):
    """The known differences between engines. Paths of robots are relative to `folder`, the folder of the
    baseline file, so that a checkout elsewhere has the same baseline."""

    def compare(self, report: DoctorReport) -> BaselineComparison:
        """Compare a report. The difference of an engine that did not take part does not count as vanished."""
        subject = (robot_key(report, self.folder), report.base or "", None)
        engines = {"dynx", *(each.engine for each in report.engines)}
        found = differences(report, self.folder)
        return self.compare_differences(found, subject, engines, report.ignored)


def accepted_by(report: DoctorReport, baseline: Baseline | None) -> Baseline | None:
    """Return the baseline, or an empty one where only rules are ignored; None where nothing is accepted."""
    return Baseline() if baseline is None and report.ignored else baseline


def differences(report: DoctorReport, folder: str) -> tuple[PlacedDifference, ...]:
    """Collect the differences of a report: each cause with an effect, and each unexplained difference."""
    robot, base = robot_key(report, folder), report.base or ""
    merged: dict[Place, PlacedDifference] = {}

    def add(place: Place, engines: Iterable[str], error: float) -> None:
        old = merged.get(place, PlacedDifference(place, frozenset()))
        merged[place] = PlacedDifference(place, old.engines | set(engines), max(old.relative_error, error))

    def add_unexplained(engine: str, quantity: str, error: float, joint: str | None = None) -> None:
        add(Place(robot, base, UNEXPLAINED, None, joint, quantity), (engine,), error)

    for finding in report.differences:
        assert finding.effect is not None
        place = Place(robot, base, finding.rule, finding.link, finding.joint)
        add(place, finding.engines, finding.effect.relative_error)
    for each in report.unexplained:
        add_unexplained(each.engine, each.quantity, each.relative_error, each.joint)
    named = {engine for each in merged.values() for engine in each.engines}
    # Every engine that makes the report differ must have an entry.
    for engine in report.engines:
        if engine.engine in named:
            continue
        if engine.no_results is not None:
            add_unexplained(engine.engine, "result" if engine.refused is None else "loading", math.inf)
        for quantity, error in engine.before.items():
            if engine.no_results is None and not error <= report.tolerance:
                add_unexplained(engine.engine, quantity, error)
    if report.refusal is not None and not merged:
        add_unexplained("dynx", "loading", math.inf)
    return tuple(merged.values())


def robot_key(report: DoctorReport, folder: str) -> str:
    """Return the robot's name, or its path from the folder of the baseline, with forward slashes."""
    return relative_key(report.robot, split_arguments(report.robot)[0], folder)


def baseline_document(reports: Iterable[DoctorReport], folder: str) -> dict[str, Any]:
    """Make the document that accepts all differences of these reports, except those of ignored rules."""
    return document_of_differences(
        each
        for report in reports
        for each in differences(report, folder)
        if each.place.rule not in report.ignored
    )


def read_baseline(text: str, path: str) -> Baseline:
    """Read a baseline from the text of a file. Raises ArgumentError, which names `path`, for any other
    text."""
    return Baseline.read(text, path)
