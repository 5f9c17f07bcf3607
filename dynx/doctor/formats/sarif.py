"""SARIF 2.1.0 (OASIS standard), which code hosts show as marks at the lines of a file.

Results are the findings; level ``error`` where answers differ, ``warning`` where they differ by rounding,
``note`` for the rest. A finding on both bases is one result. Fingerprints hold no line, so that a finding
stays the same when text is put in above it.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
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
    """The document. With a baseline, what is known there is marked as suppressed."""
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


def _results(report: DoctorReport, baseline: Baseline | None) -> list[dict[str, Any]]:
    new = None if baseline is None else {_key(each.place) for each in baseline.compare(report).new}
    found = []
    for finding in report.findings:
        message = f"{wording.name(finding.message, 1000)} ({wording.effect(finding.effect)}"
        message += f", {report.base} base" + (
            "" if not finding.engines else f": {', '.join(finding.engines)}"
        )
        advice = "" if finding.remedy is None else f" Remedy: {wording.name(finding.remedy, 1000)}"
        found.append(
            _result(report, wording.name(finding.rule), severity(finding), f"{message}).{advice}", finding)
        )
    for open_one in report.unexplained:
        where = "" if open_one.joint is None else f", worst at joint {wording.name(open_one.joint)}"
        message = (
            f"{wording.quantity(open_one.quantity)} of {open_one.engine} is off by "
            f"{wording.relative(open_one.relative_error)}{where} ({report.base} base), "
            "and no rule accounts for it."
        )
        found.append(_result(report, UNEXPLAINED, "error", message, open_one))
    if new is not None:
        about: list[Finding | Unexplained] = [*report.findings, *report.unexplained]
        for result, each in zip(found, about, strict=True):
            known = _counts(each) and _key(each) not in new
            result["suppressions"] = (
                [{"kind": "external", "justification": "in the baseline"}] if known else []
            )
    return found


def _counts(each: Finding | Unexplained) -> bool:
    """Whether a baseline can know it: bad practice alone makes nothing fail."""
    return isinstance(each, Unexplained) or each.effect is not None


def _key(each: Finding | Unexplained | Place) -> tuple[str | None, ...]:
    """What a finding and its place in a baseline have in common."""
    if isinstance(each, Unexplained):
        return (UNEXPLAINED, None, each.joint, each.quantity)
    return (each.rule, each.link, each.joint, each.quantity if isinstance(each, Place) else None)


def _result(
    report: DoctorReport, rule: str, level: str, message: str, about: Finding | Unexplained
) -> dict[str, Any]:
    physical: dict[str, Any] = {"artifactLocation": {"uri": artifact_uri(report)}}
    logical: list[dict[str, str]] = []
    if isinstance(about, Finding):
        key = [rule, about.link, about.joint]
        if about.line is not None:
            physical["region"] = {"startLine": max(about.line, 1)}
        for kind, text in (("link", about.link), ("joint", about.joint)):
            if text:
                logical.append({"name": wording.name(text), "kind": kind})
    else:
        key = [rule, about.quantity, about.engine]
    location: dict[str, Any] = {"physicalLocation": physical}
    if logical:
        location["logicalLocations"] = logical
    return {
        "ruleId": rule,
        "level": level,
        "message": {"text": message},
        "locations": [location],
        "partialFingerprints": {_FINGERPRINT: _digest([artifact_uri(report), *key])},
    }


def artifact_uri(report: DoctorReport) -> str:
    """The file as a URI: relative where it lies below the working directory, as code hosts want it."""
    path = report.source or report.robot
    if not os.path.exists(path):
        return quote(wording.name(path))
    absolute = os.path.abspath(path)
    try:
        relative = PurePath(os.path.relpath(absolute)).as_posix()
    except ValueError:  # another drive
        return Path(absolute).as_uri()
    return Path(absolute).as_uri() if relative.startswith("../") else quote(relative)


def _digest(parts: list[str | None]) -> str:
    joined = "\0".join("" if part is None else f"={part}" for part in parts)
    return hashlib.sha256(joined.encode("utf-8", "backslashreplace")).hexdigest()[:32]


def _rules(reports: list[DoctorReport]) -> list[dict[str, Any]]:
    """The rules that are met, with their pages as help."""
    met: dict[str, tuple[str, str]] = {}
    for report in reports:
        for cause in causes(report):
            met.setdefault(cause.rule, (cause.name, cause.findings[0].message))
    found = [_rule(identity, name, message) for identity, (name, message) in sorted(met.items())]
    if any(report.unexplained for report in reports):
        said = "Engines differ, and no rule of the catalogue accounts for it."
        found.append({"id": UNEXPLAINED, "shortDescription": {"text": said}})
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
