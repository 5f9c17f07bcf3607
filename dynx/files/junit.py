"""JUnit XML, which CI services show as tests: suites of cases that pass, fail, or are skipped."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree

Element = ElementTree.Element

KNOWN = "known: in the baseline"
"""Message of a difference that a baseline accepts."""


def junit_text(name: str, suites: Iterable[Element]) -> str:
    """Make the document, in ASCII."""
    root = Element("testsuites", name=name)
    root.extend(suites)
    for key in ("tests", "failures", "errors", "skipped"):
        root.set(key, str(sum(int(suite.get(key, "0")) for suite in root)))
    ElementTree.indent(root)
    body = ElementTree.tostring(root, encoding="us-ascii", xml_declaration=False).decode("ascii")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{body}\n'


def junit_suite(title: str, seconds: float, cases: Iterable[tuple[str, Element | None]]) -> Element:
    """Make a suite of cases by name, each with its result; None for one that passes."""
    suite = Element("testsuite", name=title, time=f"{seconds:.3f}")
    for name, result in cases:
        # A dot would be read as the end of a package by some services.
        case = ElementTree.SubElement(suite, "testcase", classname=title.replace(".", "_"), name=name)
        if result is not None:
            case.append(result)
    outcomes = [child.tag for case in suite for child in case]
    suite.set("tests", str(len(suite)))
    for key, tag in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        suite.set(key, str(outcomes.count(tag)))
    return suite


def junit_result(tag: str, message: str, kind: str | None = None, text: str | None = None) -> Element:
    """Make the result of a case: ``failure``, ``error`` or ``skipped``."""
    element = Element(tag, message=message)
    if kind is not None:
        element.set("type", kind)
    element.text = text
    return element


def junit_failure(message: str, *, known: bool) -> Element:
    """Make the result of a case that fails, or that is skipped where the difference is `known`."""
    return junit_result("skipped" if known else "failure", message)
