"""SARIF of two descriptions: valid, with the lines of both, and marks of what is known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from dynx.files.annotations import github_annotations
from dynx.files.documents import json_text
from dynx.same import SameReport, same_robot
from dynx.same.formats import SameBaseline, baseline_document, sarif_document
from dynx.same.formats.findings import RULES, findings
from tests.doctor.formats.test_sarif import require_valid
from tests.same.formats.reports import FIRST, SECOND, alike, differing, hostile, shorter


@pytest.mark.parametrize("make", [alike, differing, shorter, hostile])
def test_documents_are_valid(make: object) -> None:
    report = make()  # type: ignore[operator]
    document = sarif_document(report)
    require_valid(document)
    (run,) = document["runs"]
    assert len(run["results"]) == len(list(findings(report)))
    assert (
        {rule["id"] for rule in run["tool"]["driver"]["rules"]}
        == {each.rule for each in findings(report)}
        <= RULES.keys()
    )
    assert all(line.isprintable() for line in github_annotations(document))


def test_a_result_is_at_the_lines_of_both_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.urdf").write_text(f"\n\n{FIRST}", encoding="utf-8")
    Path("b.urdf").write_text(SECOND, encoding="utf-8")
    report = same_robot("a.urdf", "b.urdf")
    assert {each.part for each in report.differences} == {"origin", "inertial"}
    (run,) = sarif_document(report)["runs"]
    for result, each in zip(run["results"], report.differences, strict=False):
        (place,) = (one["physicalLocation"] for one in result["locations"])
        (related,) = (one["physicalLocation"] for one in result["relatedLocations"])
        assert result["level"] == "error"
        assert place["artifactLocation"]["uri"] == "b.urdf"
        assert related["artifactLocation"]["uri"] == "a.urdf"
        assert place["region"]["startLine"] == each.second_line
        assert related["region"]["startLine"] == each.first_line == (each.second_line or 0) + 2
    assert {each["level"] for each in run["results"][len(report.differences) :]} == {"note"}


def known(report: SameReport) -> SameBaseline:
    """Return the baseline that accepts a report."""
    return SameBaseline.read(json_text(baseline_document(report, "")), "known.json")


def test_what_is_known_is_suppressed_and_not_annotated() -> None:
    document = sarif_document(differing(), known(differing()))
    require_valid(document)
    assert not any(line.startswith("::error") for line in github_annotations(document))
    fewer = replace(differing(), differences=differing().differences[1:])
    lines = github_annotations(sarif_document(differing(), known(fewer)))
    assert sum(line.startswith("::error") for line in lines) == 1


def test_fingerprints_keep_when_lines_are_inserted() -> None:
    def prints(report: SameReport) -> list[object]:
        return [each["partialFingerprints"] for each in sarif_document(report)["runs"][0]["results"]]

    moved = same_robot(FIRST, f"\n\n{SECOND}")
    assert prints(differing()) == prints(moved)
    assert len({str(each) for each in prints(moved)}) == len(prints(moved))
