"""Annotations of GitHub Actions: one line a finding, whatever its text, and none for what is known."""

from __future__ import annotations

import re

from hypothesis import given
from hypothesis import strategies as st

from dynx.doctor import diagnose
from dynx.doctor.formats import baseline_document, github_annotations, read_baseline, sarif_document
from dynx.doctor.report import DoctorReport
from dynx.files.documents import json_text
from dynx.rules.registry import find_trap
from tests.doctor.formats.reports import alike, differing, hostile, refused

LINE = re.compile(r"::(error|warning|notice) file=([^,:]+),line=(\d+),title=([^,:]+)::(.+)")


def lines_of(*reports: DoctorReport) -> list[str]:
    return github_annotations(sarif_document(reports))


def test_each_result_is_a_line_and_errors_come_first() -> None:
    reports = (alike(), differing(), hostile(), refused())
    lines = lines_of(*reports)
    assert len(lines) == len(sarif_document(reports)["runs"][0]["results"]) > 2
    found = [LINE.fullmatch(line) for line in lines]
    assert all(found), lines
    kinds = [match.group(1) for match in found if match]
    order = ("error", "warning", "notice")
    assert kinds == sorted(kinds, key=order.index)
    trap = next(line for line in lines_of(diagnose(find_trap("DX101"), engines=["pinocchio", "pybullet"])))
    assert re.search(
        r"dx101_link_without_inertial\.urdf,line=\d+,title=DX101 link-without-inertial::no ", trap
    )


def test_known_findings_have_no_line() -> None:
    baseline = read_baseline(json_text(baseline_document([differing()], "")), "known.json")
    lines = github_annotations(sarif_document([differing()], baseline))
    assert lines
    assert not any(line.startswith(("::error", "::warning")) for line in lines)


@given(st.text(max_size=30))
def test_no_text_ends_the_line_or_a_property(text: str) -> None:
    document = sarif_document([differing()])
    for result in document["runs"][0]["results"]:
        result["message"]["text"] = f"m{text}"
        place = result["locations"][0]["physicalLocation"]["artifactLocation"]
        place["uri"] = f"u{text}"
    for line in github_annotations(document):
        assert LINE.fullmatch(line), line
