"""JUnit XML of two descriptions: a case that fails for each element, none for what is known."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

from dynx.files.documents import json_text
from dynx.same.formats import SameBaseline, baseline_document, junit_xml
from tests.same.formats.reports import alike, differing, hostile, shorter


@pytest.mark.parametrize("make", [alike, differing, shorter, hostile])
def test_counts(make: object) -> None:
    report = make()  # type: ignore[operator]
    (suite,) = ElementTree.fromstring(junit_xml(report))
    assert int(suite.get("failures", "")) == len(suite.findall("testcase/failure"))
    assert int(suite.get("failures", "")) == len(report.differences) + len(report.unmatched)
    text = json_text(baseline_document(report, ""))
    (suite,) = ElementTree.fromstring(junit_xml(report, SameBaseline.read(text, "known.json")))
    assert suite.get("failures") == "0"
    assert int(suite.get("skipped", "")) == len(report.differences) + len(report.unmatched)


def test_the_same_robot_passes() -> None:
    (suite,) = ElementTree.fromstring(junit_xml(alike()))
    assert [case.get("name") for case in suite] == ["the same robot"]


def test_what_is_apart_from_the_verdict_passes_with_its_text() -> None:
    (suite,) = ElementTree.fromstring(junit_xml(differing()))
    (case,) = (case for case in suite if (case.get("name") or "").startswith("damping"))
    assert "2 in" in (case.findtext("system-out") or "")
    assert case.find("failure") is None
