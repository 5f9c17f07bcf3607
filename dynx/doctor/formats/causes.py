"""Findings of a report grouped by rule, in the order of their severity."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from dynx.doctor.formats import wording
from dynx.doctor.report import DoctorReport, Effect, EngineResult, Finding
from dynx.rules.registry import all_rules
from dynx.rules.rule import Kind, Rule

Severity = Literal["error", "warning", "note"]
"""``error``: engines differ by more than rounding. ``warning``: by accumulated rounding.
``note``: nothing differs; bad practice, or a cause without effect on this base."""

ROUNDING = 1e-9
"""Relative error up to which a difference counts as accumulated rounding: PyBullet's diagonalisation of
inertias causes as much on files without a fault."""

_ORDER: tuple[Severity, ...] = ("error", "warning", "note")


@dataclass(frozen=True)
class RuleFindings:
    """One rule of the catalogue and all places where it was found."""

    rule: str
    name: str
    kind: Kind
    findings: tuple[Finding, ...]

    @property
    def entry(self) -> Rule | None:
        """The rule in the catalogue; None for one that this version of dynx does not have."""
        return catalogue_entry(self.rule)

    @property
    def title(self) -> str:
        """The cause in one sentence."""
        return self.entry.title if self.entry is not None else wording.message(self.findings[0].message)

    @property
    def advice(self) -> str:
        """Advice in one sentence; the remedy that was applied where the catalogue has none."""
        return next(filter(None, map(advice, self.findings)), "")

    @property
    def remedies(self) -> tuple[str, ...]:
        """Remedies that were applied, each sentence once."""
        applied = dict.fromkeys(each.remedy for each in self.findings if each.remedy)
        return tuple(wording.name(remedy, 1000).rstrip(".") for remedy in applied)

    @property
    def largest_effect(self) -> Effect | None:
        """Largest effect; None where the cause changes nothing."""
        effects = [each.effect for each in self.findings if each.effect is not None]
        return max(effects, key=lambda effect: effect.relative_error, default=None)

    @property
    def engines(self) -> tuple[str, ...]:
        """The engines in which any of the findings shows."""
        return tuple(dict.fromkeys(engine for each in self.findings for engine in each.engines))

    @property
    def proved(self) -> bool:
        """True if every finding that has an effect was proved."""
        return all(each.proved for each in self.findings if each.effect is not None)

    @property
    def severity(self) -> Severity:
        """Severity of the most severe finding."""
        return min((severity(each) for each in self.findings), key=_ORDER.index)


def causes(report: DoctorReport) -> list[RuleFindings]:
    """Group the findings by rule. Rules are ordered by severity, largest effect and number; the places of
    a rule by the magnitude of their effect, then as in the file."""
    groups: dict[str, list[Finding]] = {}
    for finding in report.findings:
        groups.setdefault(finding.rule, []).append(finding)
    found = [
        RuleFindings(
            rule, each[0].name, each[0].kind, tuple(sorted(each, key=lambda one: -_size(one.effect)))
        )
        for rule, each in groups.items()
    ]
    return sorted(
        found, key=lambda cause: (_ORDER.index(cause.severity), -_size(cause.largest_effect), cause.rule)
    )


def catalogue_entry(rule: str) -> Rule | None:
    """Find a rule by its id; None where this version of dynx has none."""
    return next((each for each in all_rules() if each.id == rule), None)


def advice(finding: Finding) -> str:
    """Return the advice of a finding's rule; the remedy that was applied where the catalogue has none."""
    entry = catalogue_entry(finding.rule)
    applied = "" if finding.remedy is None else wording.name(finding.remedy, 1000)
    return applied if entry is None or not entry.advice else entry.advice


def severity(finding: Finding) -> Severity:
    """Return the severity of a finding."""
    if finding.effect is None:
        return "note"
    # A NaN counts as a large error.
    return "warning" if finding.effect.relative_error <= ROUNDING else "error"


def _size(effect: Effect | None) -> float:
    return -1.0 if effect is None else effect.relative_error


@dataclass(frozen=True)
class Vote:
    """Groups of engines that load the file alike, the largest first.

    Two engines are alike where no quantity differs by more than the tolerance; such pairs connect a group.
    `right` are the engines without an error against the reference values, `refused` those without results:
    they refuse the file, or are not used on it.
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
