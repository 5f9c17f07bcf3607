"""Findings of a report grouped by rule, in the order of their severity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from dynx.doctor.formats import wording
from dynx.doctor.report import DoctorReport, Effect, Finding
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
        return self.entry.title if self.entry is not None else wording.name(self.findings[0].message, 1000)

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
