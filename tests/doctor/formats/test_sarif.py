"""SARIF 2.1.0: the constraints of the standard that code hosts check, and stable fingerprints."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.doctor.formats import Baseline, sarif_document
from dynx.doctor.formats.baseline import differences
from dynx.doctor.report import DoctorReport, Effect, Unexplained
from dynx.doctor.task import DoctorTask, examine
from dynx.rules.registry import all_rules
from tests.doctor.formats.reports import alike, differing, hostile, refused


def require_valid(document: dict[str, Any]) -> None:
    """The rules of SARIF 2.1.0 (OASIS, 27 March 2020) for what is used here; sections in comments."""
    json.dumps(document, allow_nan=False)
    assert document["version"] == "2.1.0"  # 3.13.2
    [run] = document["runs"]  # 3.13.4
    driver = run["tool"]["driver"]  # 3.18.2
    assert driver["name"]  # 3.19.8
    assert re.fullmatch(r"\d+\.\d+\.\d+[-+.\w]*", driver["semanticVersion"])  # 3.19.12
    assert run["columnKind"] in ("utf16CodeUnits", "unicodeCodePoints")  # 3.14.17
    rules = driver["rules"]
    assert len({rule["id"] for rule in rules}) == len(rules)  # 3.19.23
    for rule in rules:
        assert set(rule) <= {
            "id", "name", "shortDescription", "fullDescription", "help", "defaultConfiguration", "properties",
        }  # fmt: skip
        for key in ("shortDescription", "fullDescription", "help"):
            assert rule[key]["text"]  # 3.12.3; GitHub requires each of the three
        for key in ("shortDescription", "fullDescription"):
            assert len(rule[key]["text"]) <= 1024  # GitHub
        assert len(rule["name"]) <= 255  # GitHub
        assert len(rule.get("properties", {}).get("tags", [])) <= 10  # GitHub shows no more
    root = run["originalUriBaseIds"]["%SRCROOT%"]["uri"]  # 3.14.14
    assert root.startswith("file:///")
    assert root.endswith("/")
    assert len(run["results"]) <= 25_000  # GitHub
    for invocation in run["invocations"]:
        assert isinstance(invocation["executionSuccessful"], bool)  # 3.20.14
    for result in run["results"]:
        assert rules[result["ruleIndex"]]["id"] == result["ruleId"]  # 3.27.6
        assert result["level"] in ("none", "note", "warning", "error")  # 3.27.10
        assert result["message"]["text"]  # 3.27.11
        assert all(isinstance(value, str) for value in result["partialFingerprints"].values())  # 3.27.17
        assert len(result["locations"]) == 1  # 3.27.12; GitHub requires one
        for place in result["locations"]:
            location = place["physicalLocation"]["artifactLocation"]
            uri = location["uri"]  # 3.4.3: a URI reference, RFC 3986
            # A path is relative to the root, as GitHub requires, and names a scheme otherwise.
            assert location.get("uriBaseId") == (None if uri.startswith("file:///") else "%SRCROOT%")
            assert not uri.startswith(("/", "../"))
            assert re.fullmatch(r"[A-Za-z0-9\-._~:/?#\[\]@!$&'()*+,;=%]+", uri)
            urlsplit(uri)
            assert place["physicalLocation"]["region"]["startLine"] >= 1  # 3.30.5; GitHub requires it
            for logical in place.get("logicalLocations", ()):
                assert logical["name"]  # 3.33.4


def results(*reports: DoctorReport, baseline: Baseline | None = None) -> list[dict[str, Any]]:
    """Return the results of the one run."""
    document = sarif_document(reports, baseline)
    require_valid(document)
    found: list[dict[str, Any]] = document["runs"][0]["results"]
    return found


def prints(found: list[dict[str, Any]]) -> list[str]:
    """Return the fingerprints of results."""
    return [value for result in found for value in result["partialFingerprints"].values()]


def test_levels_say_how_alarming_a_finding_is() -> None:
    found = {(each["ruleId"], each["level"]) for each in results(differing(), alike(), refused())}
    assert found == {
        ("DX901", "error"),
        ("DX902", "warning"),
        ("DX903", "note"),
        ("unexplained", "error"),
        ("refused", "error"),
    }


def test_fingerprints_are_distinct_and_hold_no_line() -> None:
    before, after = results(differing()), results(differing(line_shift=7))
    assert len(set(prints(before))) == len(before) == 5
    assert prints(before) == prints(after)
    lines = [each["locations"][0]["physicalLocation"].get("region") for each in before]
    moved = [each["locations"][0]["physicalLocation"].get("region") for each in after]
    assert lines != moved


def test_both_bases_are_one_result() -> None:
    assert len(results(differing(), differing(base="floating"))) == len(results(differing()))


def test_of_two_bases_the_more_alarming_is_told() -> None:
    worse = differing()
    milder = replace(worse, base="floating", findings=tuple(replace(f, effect=None) for f in worse.findings))
    for reports in ((worse, milder), (milder, worse)):
        levels = {each["ruleId"]: each["level"] for each in results(*reports)}
        assert levels["DX901"] == "error"
        assert levels["DX902"] == "warning"


def test_a_file_below_the_working_directory_is_relative(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a b").mkdir()
    (tmp_path / "a b" / "arm.urdf").write_text("<robot/>")
    monkeypatch.chdir(tmp_path)
    found = results(differing(str(tmp_path / "a b" / "arm")))
    assert {each["locations"][0]["physicalLocation"]["artifactLocation"]["uri"] for each in found} == {
        "a%20b/arm.urdf"
    }
    monkeypatch.chdir(tmp_path / "a b")
    (tmp_path / "other.urdf").write_text("<robot/>")
    [one, *_] = results(differing(str(tmp_path / "other")))
    uri = one["locations"][0]["physicalLocation"]["artifactLocation"]["uri"]
    assert uri == (tmp_path / "other.urdf").as_uri()


def test_a_file_in_a_repository_is_relative_to_its_root(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "robots"
    folder.mkdir()
    (tmp_path / ".git").mkdir()
    (folder / "arm.urdf").write_text("<robot/>")
    monkeypatch.chdir(folder)
    [one, *_] = results(differing("arm"))
    assert one["locations"][0]["physicalLocation"]["artifactLocation"]["uri"] == "robots/arm.urdf"


@pytest.mark.parametrize(
    ("text", "line"), [("<robot>\n<link></robot>", 2), ("", 1), ('<robot name="r"/>', 1), ("\n\n<a/>", 3)]
)
def test_a_refused_file_is_a_result_at_its_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, line: int
) -> None:
    (tmp_path / "broken.urdf").write_text(text)
    monkeypatch.chdir(tmp_path)
    report = examine(DoctorTask("broken.urdf", "fixed"))
    assert report.error is not None
    document = sarif_document([report])
    require_valid(document)
    [run] = document["runs"]
    [result] = run["results"]
    assert (result["ruleId"], result["level"]) == ("refused", "error")
    place = result["locations"][0]["physicalLocation"]
    assert place["artifactLocation"]["uri"] == "broken.urdf"
    assert place["region"]["startLine"] == line
    assert "broken.urdf" not in result["message"]["text"]
    assert run["invocations"][0]["executionSuccessful"] is False


def test_a_run_that_was_interrupted_was_not_successful() -> None:
    document = sarif_document([alike()], not_done=["later"])
    require_valid(document)
    [invocation] = document["runs"][0]["invocations"]
    assert invocation["executionSuccessful"] is False
    assert "later" in invocation["toolExecutionNotifications"][0]["message"]["text"]
    [before] = sarif_document([alike()])["runs"][0]["invocations"]
    assert before["executionSuccessful"] is True


def test_two_findings_at_one_place_are_two_results() -> None:
    report = differing()
    twice = replace(report, findings=(*report.findings, replace(report.findings[-1], line=16)))
    assert len(results(twice)) == len(results(report)) + 1


def test_the_severe_results_remain_where_there_are_too_many(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dynx.files.sarif.MAX_RESULTS", 3)
    document = sarif_document([differing()])
    assert [each["level"] for each in document["runs"][0]["results"]] == ["error"] * 3
    [note] = document["runs"][0]["invocations"][0]["toolExecutionNotifications"]
    assert note["message"]["text"] == "2 of 5 results were left out"


def test_an_engine_that_refuses_the_file_without_a_cause_is_named() -> None:
    missing = Unexplained("mujoco", "mass_matrix", math.inf)
    report = replace(differing(), unexplained=(Unexplained("mujoco", "loading", math.inf), missing))
    texts = [each["message"]["text"] for each in results(report) if each["ruleId"] == "unexplained"]
    assert texts[0].startswith("mujoco refuses the file")
    assert texts[1].startswith("mujoco returns no valid mass matrix")


def test_a_rule_of_the_catalogue_brings_its_page() -> None:
    rule = all_rules()[0]
    report = differing()
    finding = report.findings[0]
    known = DoctorReport(
        "arm", findings=(type(finding)(**{**vars(finding), "rule": rule.id, "name": rule.name}),)
    )
    document = sarif_document([known])
    require_valid(document)
    [described] = document["runs"][0]["tool"]["driver"]["rules"]
    assert described["help"]["text"] == rule.page()
    assert described["shortDescription"]["text"] == rule.title


@pytest.mark.parametrize("remedy", [None, "gave each link another inertia"])
def test_the_remedy_is_the_advice_that_terminals_print(remedy: str | None) -> None:
    """It tells the reader what to do, also where no remedy was applied: not what a mended file changes."""
    for rule in all_rules():
        effect = None if rule.kind == "practice" else Effect("mass_matrix", 1.0)
        finding = replace(differing().findings[0], rule=rule.id, kind=rule.kind, effect=effect, remedy=remedy)
        [result] = results(replace(alike(), findings=(finding,)))
        assert result["message"]["text"].endswith(f" Remedy: {rule.advice}")
        absent = replace(finding, kind="difference", effect=None)
        [result] = results(replace(alike(), findings=(absent,)))
        assert "Remedy" not in result["message"]["text"]


def test_what_is_in_the_baseline_is_suppressed() -> None:
    baseline = Baseline("", tuple(e for e in differences(differing(), "") if e.place.rule != "DX902"))
    for result in results(differing(), baseline=baseline):
        assert bool(result["suppressions"]) == (result["ruleId"] in ("DX901", "unexplained"))
    # A file that cannot be read is always new; without a baseline nothing is suppressed or not.
    [result] = results(refused(), baseline=baseline)
    assert result["suppressions"] == []
    for report in (refused(), differing()):
        assert not any("suppressions" in each for each in results(report))


@given(st.text())
def test_any_name_gives_a_valid_document(text: str) -> None:
    results(differing(text, link=text, joint=text, message=text or "x"), hostile())
