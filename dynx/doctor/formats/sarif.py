"""Findings as SARIF 2.1.0 (`dynx.files.sarif`).

Results are the findings; level ``error`` where engines differ, ``warning`` where they differ by rounding,
``note`` otherwise. A file that cannot be examined is a result at the line of its error. A finding on both
bases is one result.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from dynx.doctor.formats import wording
from dynx.doctor.formats.baseline import UNEXPLAINED, Baseline, accepted_by
from dynx.doctor.formats.causes import advice, catalogue_entry, causes, severity
from dynx.doctor.report import DoctorReport, Finding, Unexplained
from dynx.errors import located
from dynx.files.baseline import Place
from dynx.files.sarif import (
    IGNORED,
    KNOWN,
    MAX_DESCRIPTION,
    physical_location,
    sarif_result,
    sarif_rule,
    sarif_run,
    suppression,
)

REFUSED = "refused"
"""Rule of a file that cannot be examined."""

_OWN_RULES = {
    UNEXPLAINED: "Engines differ, and no rule of the catalogue accounts for it.",
    REFUSED: "The file cannot be examined: it is not a robot description that dynx can read.",
}


def sarif_document(
    reports: Iterable[DoctorReport],
    baseline: Baseline | None = None,
    not_done: Sequence[str] = (),
    left_out: Sequence[str] = (),
) -> dict[str, Any]:
    """Make the SARIF document. Differences in the baseline and findings of ignored rules are marked as
    suppressed. `not_done` names the robots that an interrupted run left out, `left_out` the xacro files below
    a directory, which are not examined.
    """
    reports = list(reports)
    notes = [f"{wording.name(robot)} was not examined: the run was interrupted" for robot in not_done]
    notes += [f"{wording.name(robot)} {wording.LEFT_OUT}" for robot in left_out]
    notes += filter(None, [wording.ignored(*reports)])
    return sarif_run(
        _rules(reports),
        (result for report in reports for result in _results(report, baseline)),
        notes,
        [_unread_meshes(report) for report in reports if report.unread_meshes],
        successful=not not_done and all(report.error is None for report in reports),
    )


def _results(report: DoctorReport, baseline: Baseline | None) -> Iterator[dict[str, Any]]:
    baseline = accepted_by(report, baseline)
    new = None if baseline is None else {_key(each.place) for each in baseline.compare(report).new}
    if report.error is not None:
        result = _refusal(report)
        yield result if new is None else {**result, "suppressions": []}
    entries: list[Finding | Unexplained] = [*report.findings, *report.unexplained]
    before: Counter[tuple[str | None, ...]] = Counter()
    for each in entries:
        repetition = before[_key(each)]
        before[_key(each)] += 1
        result = (
            _finding(report, each, repetition)
            if isinstance(each, Finding)
            else _unexplained(report, each, repetition)
        )
        if new is not None:
            # A baseline cannot hold bad practice, which makes no check fail.
            counts = isinstance(each, Unexplained) or each.effect is not None
            ignored = isinstance(each, Finding) and each.rule in report.ignored
            known = ignored or (counts and _key(each) not in new)
            result["suppressions"] = suppression(None if not known else IGNORED if ignored else KNOWN)
        yield result


def _refusal(report: DoctorReport) -> dict[str, Any]:
    assert report.error is not None
    # The place is in the result itself.
    where = located("", report.source, report.error_line).strip()
    message = wording.message(report.error.message.removeprefix(where).strip() or report.error.type, 2000)
    return _result(report, REFUSED, "error", message, report.error_line)


def _finding(report: DoctorReport, each: Finding, repetition: int) -> dict[str, Any]:
    # Effects that differ are written with their engines.
    names = () if wording.differs_by_engine(each) else each.engines
    engines = f": {', '.join(names)}" if names else ""
    effect = f"{wording.finding_effect(each)}, {report.base} base{engines}"
    message = f"{wording.message(each.message)} ({effect})."
    if each.effect is not None or each.kind == "practice":
        message += f" Remedy: {advice(each).rstrip('.')}." if advice(each) else ""
    if each.effect is not None and any(each.rule == left.rule for left in report.undone):
        message += f" Left undone at level {report.level}."
    rule = wording.name(each.rule)
    identity = (each.link, each.joint, str(repetition))
    result = _result(report, rule, severity(each), message, each.line, *identity)
    (location,) = result["locations"]
    parts = (("link", each.link), ("joint", each.joint))
    if any(text for _, text in parts):
        location["logicalLocations"] = [
            {"name": wording.name(text), "kind": kind} for kind, text in parts if text
        ]
    return result


def _unexplained(report: DoctorReport, each: Unexplained, repetition: int) -> dict[str, Any]:
    message = f"{wording.unexplained(each)} ({report.base} base), and no rule accounts for it."
    identity = (each.quantity, each.engine, str(repetition))
    return _result(report, UNEXPLAINED, "error", message, None, *identity)


def _result(
    report: DoctorReport, rule: str, level: str, message: str, line: int | None, *identity: str | None
) -> dict[str, Any]:
    return sarif_result(report.source or report.robot, rule, level, message, line, *identity)


def _unread_meshes(report: DoctorReport) -> dict[str, Any]:
    """Return the notification of meshes that were not read, at the first of them."""
    place = physical_location(report.source or report.robot, report.unread_meshes[0].line)
    message = {"text": f"{wording.unread_meshes(report)}."}
    return {"level": "note", "message": message, "locations": [{"physicalLocation": place}]}


def _key(each: Finding | Unexplained | Place) -> tuple[str | None, ...]:
    """Return the identity that a finding shares with its place in a baseline."""
    if isinstance(each, Unexplained):
        return (UNEXPLAINED, None, each.joint, each.quantity)
    return (each.rule, each.link, each.joint, each.quantity if isinstance(each, Place) else None)


def _rules(reports: list[DoctorReport]) -> list[dict[str, Any]]:
    """List the rules of all findings, with their pages as help."""
    met: dict[str, tuple[str, str]] = {}
    for report in reports:
        for cause in causes(report):
            met.setdefault(cause.rule, (cause.name, cause.findings[0].message))
    found = [_rule(identity, name, message) for identity, (name, message) in sorted(met.items())]
    own = {
        UNEXPLAINED: any(report.unexplained for report in reports),
        REFUSED: any(report.error is not None for report in reports),
    }
    return found + [sarif_rule(each, each, _OWN_RULES[each]) for each in own if own[each]]


def _rule(identity: str, name: str, message: str) -> dict[str, Any]:
    rule = catalogue_entry(identity)
    if rule is None:
        return sarif_rule(identity, name, wording.name(message, MAX_DESCRIPTION))
    page = rule.page() or rule.title
    return {
        **sarif_rule(identity, name, rule.title),
        "fullDescription": {"text": f"{rule.title} {rule.advice}".strip()[:MAX_DESCRIPTION]},
        "help": {"text": page, "markdown": page},
        "defaultConfiguration": {"level": "error" if rule.kind == "difference" else "note"},
        "properties": {"tags": ["urdf", rule.kind, *sorted(rule.engines)]},
    }
