"""Differences of two descriptions as JUnit XML: a case for each element that differs, and one for each rule
whose differences do not change the verdict, which passes with its text as output."""

from __future__ import annotations

from collections.abc import Iterator

from dynx.errors import escaped
from dynx.files.junit import KNOWN, Element, junit_result, junit_suite, junit_text
from dynx.same.formats.baseline import SameBaseline, place_of
from dynx.same.formats.findings import findings
from dynx.same.report import SameReport

MESSAGE_LENGTH = 1000
"""Largest number of characters of a message."""


def junit_xml(report: SameReport, baseline: SameBaseline | None = None) -> str:
    """Make the document."""
    title = f"{escaped(report.first)} and {escaped(report.second)}"
    return junit_text("dynx same", [junit_suite(title, report.seconds, _cases(report, baseline))])


def _cases(report: SameReport, baseline: SameBaseline | None) -> Iterator[tuple[str, Element | None]]:
    new = None if baseline is None else {each.place for each in baseline.compare(report).new}
    found = list(findings(report))
    differing = [each for each in found if each.level == "error"]
    if not differing:
        yield "the same robot", None
    for each in differing:
        known = new is not None and place_of(report, each, baseline.folder if baseline else "") not in new
        message = escaped(each.message, MESSAGE_LENGTH)
        name = f"{each.rule} of {escaped(each.theirs or each.ours or 'the robot')}"
        yield name, junit_result("skipped", KNOWN) if known else junit_result("failure", message, each.rule)
    apart: dict[str, list[str]] = {}
    for each in found:
        if each.level == "note":
            apart.setdefault(each.rule, []).append(escaped(each.message, MESSAGE_LENGTH))
    for rule, messages in apart.items():
        output = Element("system-out")
        output.text = "\n".join(messages)
        yield f"{rule}, which does not change the verdict", output
