"""JUnit XML, which CI services show as tests: a suite for each robot and base.

There are two kinds of test case. A quantity (``mass matrix as loaded``) fails where some engine differs
from the reference values; a rule (``DX101 link-without-inertial``) fails where its cause has an effect. Bad
practice passes, with its text as output. A difference in the baseline or of an ignored rule is skipped.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from xml.etree import ElementTree

from dynx.doctor.formats import wording
from dynx.doctor.formats.baseline import Baseline, accepted_by
from dynx.doctor.formats.causes import RuleFindings, causes
from dynx.doctor.report import DoctorReport, Finding
from dynx.errors import located
from dynx.files.baseline import PlacedDifference
from dynx.files.junit import KNOWN, Element, junit_failure, junit_result, junit_suite, junit_text

_SHOWN_PLACES = 50
"""Largest number of places of one rule that are listed; SARIF and JSON have all."""

IGNORED = "ignored: no finding of this rule fails"

_CAN_BE_EXAMINED = "the file can be examined"


def junit_xml(
    reports: Iterable[DoctorReport], baseline: Baseline | None = None, left_out: Sequence[str] = ()
) -> str:
    """Make the JUnit XML document, in ASCII. The robots `left_out`, files in xacro below a directory, are
    skipped tests."""
    suites = [_suite(report, baseline) for report in reports]
    for robot in left_out:
        skipped: list[tuple[str, Element | None]] = [
            (_CAN_BE_EXAMINED, junit_result("skipped", wording.LEFT_OUT))
        ]
        suites.append(junit_suite(wording.name(robot), 0.0, skipped))
    return junit_text("dynx doctor", suites)


def _suite(report: DoctorReport, baseline: Baseline | None) -> Element:
    baseline = accepted_by(report, baseline)
    new = None if baseline is None else baseline.compare(report).new
    title = f"{wording.name(report.robot)}, {report.base} base"
    suite = junit_suite(title, report.seconds, _cases(report, new))
    if report.unread_meshes:
        ElementTree.SubElement(suite, "system-out").text = f"not examined: {wording.unread_meshes(report)}"
    return suite


def _cases(
    report: DoctorReport, new: Collection[PlacedDifference] | None
) -> Iterator[tuple[str, Element | None]]:
    """Yield the name of each test case with its result; None for one that passes."""
    if report.error is not None:
        message = wording.message(report.error.message, 2000)
        yield _CAN_BE_EXAMINED, junit_result("error", message, wording.name(report.error.type))
        return
    yield from _quantities(report, accepted=new is not None and not new)
    for cause in causes(report):
        known = new is not None and all(each.place.rule != cause.rule for each in new)
        yield f"{wording.name(cause.rule)} {wording.name(cause.name)}", _cause(cause, report, known=known)
    for unexplained in report.unexplained:
        quantity = wording.quantity(unexplained.quantity)
        known = new is not None and all(each.place.quantity != unexplained.quantity for each in new)
        message = KNOWN if known else f"{wording.unexplained(unexplained)}, and no rule accounts for it"
        title = f"unexplained: {quantity} of {wording.name(unexplained.engine)}"
        yield title, junit_failure(message, known=known)


def _quantities(report: DoctorReport, *, accepted: bool) -> Iterator[tuple[str, Element | None]]:
    prefix = "known: " if accepted else ""
    if report.refusal is not None:
        message = f"{prefix}dynx refuses the file: {wording.name(report.refusal.message, 1000)}"
        yield "dynx loads the file", junit_failure(message, known=accepted)
    for each in report.engines:
        if each.no_results is not None:
            message = f"{prefix}{each.engine}, {wording.refusal(each)}"
            yield f"{each.engine} loads the file", junit_failure(message, known=accepted)
    for key in dict.fromkeys(key for each in report.engines for key in each.before):
        errors = {each.engine: each.before[key] for each in report.engines if key in each.before}
        far = [f"{engine} {wording.relative(e)}" for engine, e in errors.items() if not e <= report.tolerance]
        message = f"{prefix}relative error: {', '.join(far)}; tolerance {report.tolerance:g}"
        yield f"{wording.quantity(key)} as loaded", junit_failure(message, known=accepted) if far else None


def _cause(cause: RuleFindings, report: DoctorReport, *, known: bool) -> Element:
    lines = [cause.title, *(_place(each, report) for each in cause.findings[:_SHOWN_PLACES])]
    if len(cause.findings) > _SHOWN_PLACES:
        lines.append(f"and {len(cause.findings) - _SHOWN_PLACES} more")
    if cause.advice:
        lines.append(f"what to do: {cause.advice}")
    text = "\n".join(lines)
    if cause.largest_effect is None:
        output = Element("system-out")
        output.text = text
        return output
    if known:
        return junit_failure(IGNORED if cause.rule in report.ignored else KNOWN, known=True)
    return junit_result(
        "failure", f"{wording.effect(cause.largest_effect)}: {cause.title}", wording.name(cause.name), text
    )


def _place(finding: Finding, report: DoctorReport) -> str:
    where = wording.name(report.source or report.robot, 300)
    message = wording.message(finding.message)
    text = f"{wording.part(finding)}: {message} ({wording.finding_effect(finding)})"
    return located(text, where, finding.line)
