"""SARIF 2.1.0 (OASIS standard), which code hosts show as annotations of the lines of a file.

Results are the findings; level ``error`` where engines differ, ``warning`` where they differ by rounding,
``note`` otherwise. A finding on both bases is one result. Fingerprints do not contain the line, so that a
finding stays the same when text is inserted above it.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator
from pathlib import Path, PurePath
from typing import Any
from urllib.parse import quote

from dynx._version import __version__
from dynx.doctor.formats import wording
from dynx.doctor.formats.baseline import UNEXPLAINED, Baseline, Place
from dynx.doctor.formats.causes import catalogue_entry, causes, severity
from dynx.doctor.report import DoctorReport, Finding, Unexplained

SCHEMA_URI = "https://json.schemastore.org/sarif-2.1.0.json"

_LEVELS = ("note", "warning", "error")

_FINGERPRINT = "dynxFinding/v1"


def sarif_document(reports: Iterable[DoctorReport], baseline: Baseline | None = None) -> dict[str, Any]:
    """Make the document. Differences in the baseline are marked as suppressed."""
    reports = list(reports)
    merged: dict[str, dict[str, Any]] = {}
    for report in reports:
        for result in _results(report, baseline):
            key = result["partialFingerprints"][_FINGERPRINT]
            old = merged.get(key)
            if old is None or _LEVELS.index(result["level"]) > _LEVELS.index(old["level"]):
                merged[key] = result
    rules = _rules(reports)
    numbers = {rule["id"]: number for number, rule in enumerate(rules)}
    results = [{**result, "ruleIndex": numbers[result["ruleId"]]} for result in merged.values()]
    notifications = [_notification(report) for report in reports if report.error is not None]
    return {
        "$schema": SCHEMA_URI,
        "version": "2.1.0",
        "runs": [
            {
                "tool": {"driver": {"name": "dynx", "semanticVersion": __version__, "rules": rules}},
                "columnKind": "unicodeCodePoints",
                "invocations": [{"executionSuccessful": True, "toolExecutionNotifications": notifications}],
                "results": results,
            }
        ],
    }


def _results(report: DoctorReport, baseline: Baseline | None) -> Iterator[dict[str, Any]]:
    new = None if baseline is None else {_key(each.place) for each in baseline.compare(report).new}
    entries: list[Finding | Unexplained] = [*report.findings, *report.unexplained]
    for each in entries:
        result = _finding(report, each) if isinstance(each, Finding) else _unexplained(report, each)
        if new is not None:
            # A baseline cannot hold bad practice, which makes no check fail.
            counts = isinstance(each, Unexplained) or each.effect is not None
            known = counts and _key(each) not in new
            justification = {"kind": "external", "justification": "in the baseline"}
            result["suppressions"] = [justification] if known else []
        yield result


def _finding(report: DoctorReport, each: Finding) -> dict[str, Any]:
    engines = f": {', '.join(each.engines)}" if each.engines else ""
    message = (
        f"{wording.name(each.message, 1000)} ({wording.effect(each.effect)}, {report.base} base{engines})."
    )
    if each.remedy is not None:
        message += f" Remedy: {wording.name(each.remedy, 1000)}"
    rule = wording.name(each.rule)
    result = _result(report, rule, severity(each), message, each.link, each.joint)
    (location,) = result["locations"]
    if each.line is not None:
        location["physicalLocation"]["region"] = {"startLine": max(each.line, 1)}
    parts = (("link", each.link), ("joint", each.joint))
    if any(text for _, text in parts):
        location["logicalLocations"] = [
            {"name": wording.name(text), "kind": kind} for kind, text in parts if text
        ]
    return result


def _unexplained(report: DoctorReport, each: Unexplained) -> dict[str, Any]:
    where = "" if each.joint is None else f", worst at joint {wording.name(each.joint)}"
    message = (
        f"{wording.quantity(each.quantity)} of {each.engine} is off by "
        f"{wording.relative(each.relative_error)}{where} ({report.base} base), and no rule accounts for it."
    )
    return _result(report, UNEXPLAINED, "error", message, each.quantity, each.engine)


def _result(
    report: DoctorReport, rule: str, level: str, message: str, *identity: str | None
) -> dict[str, Any]:
    uri = artifact_uri(report)
    parts = ["" if part is None else f"={part}" for part in (uri, rule, *identity)]
    digest = hashlib.sha256("\0".join(parts).encode("utf-8", "backslashreplace")).hexdigest()[:32]
    return {
        "ruleId": rule,
        "level": level,
        "message": {"text": message},
        "locations": [{"physicalLocation": {"artifactLocation": {"uri": uri}}}],
        "partialFingerprints": {_FINGERPRINT: digest},
    }


def _key(each: Finding | Unexplained | Place) -> tuple[str | None, ...]:
    """Return the identity that a finding shares with its place in a baseline."""
    if isinstance(each, Unexplained):
        return (UNEXPLAINED, None, each.joint, each.quantity)
    return (each.rule, each.link, each.joint, each.quantity if isinstance(each, Place) else None)


def artifact_uri(report: DoctorReport) -> str:
    """Return the URI of the file: relative where it is below the working directory, as code hosts require."""
    path = report.source or report.robot
    if not os.path.exists(path):
        return quote(wording.name(path))
    absolute = os.path.abspath(path)
    try:
        relative = PurePath(os.path.relpath(absolute)).as_posix()
    except ValueError:  # another drive
        return Path(absolute).as_uri()
    return Path(absolute).as_uri() if relative.startswith("../") else quote(relative)


def _rules(reports: list[DoctorReport]) -> list[dict[str, Any]]:
    """List the rules of all findings, with their pages as help."""
    met: dict[str, tuple[str, str]] = {}
    for report in reports:
        for cause in causes(report):
            met.setdefault(cause.rule, (cause.name, cause.findings[0].message))
    found = [_rule(identity, name, message) for identity, (name, message) in sorted(met.items())]
    if any(report.unexplained for report in reports):
        text = "Engines differ, and no rule of the catalogue accounts for it."
        found.append({"id": UNEXPLAINED, "shortDescription": {"text": text}})
    return found


def _rule(identity: str, name: str, message: str) -> dict[str, Any]:
    described = {"id": wording.name(identity), "name": wording.name(name)}
    rule = catalogue_entry(identity)
    if rule is None:
        return {**described, "shortDescription": {"text": wording.name(message, 1000)}}
    page = rule.page() or rule.title
    return {
        **described,
        "shortDescription": {"text": rule.title},
        "fullDescription": {"text": f"{rule.title} {rule.advice}".strip()},
        "help": {"text": page, "markdown": page},
        "defaultConfiguration": {"level": "error" if rule.kind == "difference" else "note"},
        "properties": {"tags": ["urdf", rule.kind, *sorted(rule.engines)]},
    }


def _notification(report: DoctorReport) -> dict[str, Any]:
    assert report.error is not None
    text = f"{wording.name(report.robot)}: {wording.name(report.error.message, 2000)}"
    return {"level": "error", "message": {"text": text}}
