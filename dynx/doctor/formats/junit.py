"""JUnit XML, which CI services show as tests: a suite for each robot and base.

Two kinds of test case: a quantity (``mass matrix as loaded``) fails where some engine's answer is not the
file's; a rule (``DX101 link-without-inertial``) fails where the cause changes an answer. Bad practice
passes, with its text as output. With a baseline, what is known is skipped, and says so.
"""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree

from dynx.doctor.formats import wording
from dynx.doctor.formats.baseline import Baseline
from dynx.doctor.formats.causes import causes
from dynx.doctor.report import DoctorReport, Finding

Element = ElementTree.Element

_PLACES = 50
"""Places of one rule that are listed; SARIF and JSON have all."""


def junit_xml(reports: Iterable[DoctorReport], baseline: Baseline | None = None) -> str:
    """The document, in ASCII."""
    root = Element("testsuites", name="dynx doctor")
    for report in reports:
        root.append(_suite(report, baseline))
    for key in ("tests", "failures", "errors", "skipped"):
        root.set(key, str(sum(int(suite.get(key, "0")) for suite in root)))
    ElementTree.indent(root)
    body = ElementTree.tostring(root, encoding="us-ascii", xml_declaration=False).decode("ascii")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{body}\n'


def _suite(report: DoctorReport, baseline: Baseline | None) -> Element:
    title = f"{wording.name(report.robot)}, {report.base} base"
    suite = Element("testsuite", name=title, time=f"{report.seconds:.3f}")
    if report.error is not None:
        case = _case(suite, title, "the file can be examined")
        case.append(_outcome("error", wording.name(report.error.message, 2000), report.error.type))
    else:
        _add_cases(suite, title, report, baseline)
    outcomes = [child.tag for case in suite for child in case]
    suite.set("tests", str(len(suite)))
    for key, tag in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        suite.set(key, str(outcomes.count(tag)))
    return suite


def _add_cases(suite: Element, title: str, report: DoctorReport, baseline: Baseline | None) -> None:
    new = None if baseline is None else baseline.compare(report).new
    _add_quantities(suite, title, report, accepted=new is not None and not new)
    for cause in causes(report):
        case = _case(suite, title, f"{wording.name(cause.rule)} {wording.name(cause.name)}")
        lines = [_place(each, report) for each in cause.findings[:_PLACES]]
        if len(cause.findings) > _PLACES:
            lines.append(f"and {len(cause.findings) - _PLACES} more")
        text = "\n".join([cause.title, *lines, *([f"what to do: {cause.advice}"] if cause.advice else [])])
        known = new is not None and all(each.place.rule != cause.rule for each in new)
        if cause.largest_effect is None:
            ElementTree.SubElement(case, "system-out").text = text
        elif known:
            case.append(_outcome("skipped", "known: in the baseline"))
        else:
            case.append(
                _outcome(
                    "failure", f"{wording.effect(cause.largest_effect)}: {cause.title}", cause.name, text
                )
            )
    for each in report.unexplained:
        case = _case(suite, title, f"unexplained: {wording.quantity(each.quantity)} of {each.engine}")
        where = "" if each.joint is None else f", worst at joint {wording.name(each.joint)}"
        message = (
            f"relative error {wording.relative(each.relative_error)}{where}, and no rule accounts for it"
        )
        known = new is not None and all(each.quantity != other.place.quantity for other in new)
        outcome = ("skipped", "known: in the baseline") if known else ("failure", message)
        case.append(_outcome(*outcome))


def _add_quantities(suite: Element, title: str, report: DoctorReport, *, accepted: bool) -> None:
    for each in report.engines:
        if each.refused is not None:
            message = f"{each.engine} refuses the file: {wording.name(each.refused, 2000)}"
            case = _case(suite, title, f"{each.engine} loads the file")
            case.append(_outcome(*(("skipped", f"known: {message}") if accepted else ("failure", message))))
    for key in dict.fromkeys(key for each in report.engines for key in each.before):
        errors = {each.engine: each.before[key] for each in report.engines if key in each.before}
        far = [
            f"{engine} {wording.relative(error)}"
            for engine, error in errors.items()
            if not error <= report.tolerance
        ]
        case = _case(suite, title, f"{wording.quantity(key)} as loaded")
        if far:
            message = f"relative error: {', '.join(far)}; tolerance {report.tolerance:g}"
            case.append(_outcome(*(("skipped", f"known: {message}") if accepted else ("failure", message))))


def _case(suite: Element, title: str, what: str) -> Element:
    # A dot would be read as the end of a package by some services.
    return ElementTree.SubElement(suite, "testcase", classname=title.replace(".", "_"), name=what)


def _outcome(tag: str, message: str, kind: str | None = None, text: str | None = None) -> Element:
    element = Element(tag, message=message)
    if kind is not None:
        element.set("type", wording.name(kind))
    element.text = text
    return element


def _place(finding: Finding, report: DoctorReport) -> str:
    where = wording.name(report.source or report.robot, 300)
    line = "" if finding.line is None else f":{finding.line}"
    message = wording.name(finding.message, 1000)
    return f"{where}{line}: {wording.part(finding)}: {message} ({wording.effect(finding.effect)})"
