"""Baselines: what is known is accepted, what is new is not, what is gone is said."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.doctor.formats import (
    baseline_document,
    github_annotations,
    html_page,
    junit_xml,
    read_baseline,
    sarif_document,
    wording,
)
from dynx.doctor.formats.baseline import Baseline, differences
from dynx.doctor.report import DoctorReport, EngineResult
from dynx.errors import ArgumentError
from dynx.files.documents import json_text
from tests.doctor.formats.reports import HOSTILE, alike, differing, refused


def written(*reports: DoctorReport, path: str = "known.json") -> Baseline:
    """Return the baseline of reports, through its text."""
    return read_baseline(json_text(baseline_document(reports, str(Path(path).parent))), path)


@given(st.text(max_size=30), st.text(max_size=30), st.integers(0, 100))
def test_everything_is_known_to_its_own_baseline_whatever_its_line(robot: str, link: str, shift: int) -> None:
    report = differing(robot, link=link)
    found = written(report).compare(differing(robot, line_shift=shift, link=link))
    assert (found.new, found.vanished) == ((), ())
    assert len(found.known) == len(differences(report, "."))


def test_a_hostile_name_survives_the_file() -> None:
    report = differing(HOSTILE, link=HOSTILE, joint=HOSTILE)
    assert written(report).compare(report).new == ()


def test_another_link_is_new_and_the_old_one_gone() -> None:
    found = written(differing(link="a")).compare(differing(link="b"))
    assert [each.place.link for each in found.new] == ["b"]
    assert [each.place.link for each in found.vanished] == ["a"]


def ignoring(*rules: str) -> DoctorReport:
    """Return the report of a robot that differs, with these rules ignored."""
    counts = Counter(each.rule for each in differing().findings)
    return replace(differing(), ignored={rule: counts[rule] for rule in rules})


@given(st.sets(st.sampled_from(["DX901", "DX902", "DX903"])), st.booleans())
def test_differences_of_ignored_rules_are_neither_new_nor_known(rules: set[str], known: bool) -> None:
    report = ignoring(*sorted(rules))
    found = (written(differing()) if known else Baseline()).compare(report)
    every = {each.place.rule for each in differences(report, "")}
    assert {each.place.rule for each in found.ignored} == every & rules
    assert {each.place.rule for each in (found.known if known else found.new)} == every - rules
    assert (found.new if known else found.known, found.vanished) == ((), ())
    assert {each.place.rule for each in written(report).known} == every - rules


def test_every_format_counts_the_findings_of_ignored_rules() -> None:
    report = ignoring("DX901", "DX903")
    line = "3 findings ignored: DX901 planted-cause (2), DX903 planted-practice (1)"
    assert wording.ignored(report) == line
    assert wording.ignored(differing()) == ""
    assert line in html_page([report])
    assert report.to_dict()["ignored"] == {"DX901": 2, "DX903": 1}
    assert len(report.to_dict()["findings"]) == len(report.findings)
    document = sarif_document([report])
    (run,) = document["runs"]
    notes = run["invocations"][0]["toolExecutionNotifications"]
    assert [each["message"]["text"] for each in notes] == [line]
    suppressed = {each["ruleId"] for each in run["results"] if each["suppressions"]}
    assert suppressed == {"DX901", "DX903"}
    annotations = github_annotations(document)
    assert annotations.pop() == (
        "::notice title=3 findings ignored::DX901 planted-cause (2), DX903 planted-practice (1)"
    )
    assert len(annotations) == len(run["results"]) - 3
    cases = {each.get("name"): each for each in ElementTree.fromstring(junit_xml([report])).iter("testcase")}
    assert cases["DX901 planted-cause"].find("skipped") is not None
    assert cases["DX902 planted-rounding"].find("failure") is not None


def test_bad_practice_is_no_difference() -> None:
    assert {each.place.rule for each in differences(differing(), "")} == {"DX901", "DX902", "unexplained"}


def test_one_more_engine_is_new_and_one_less_is_not() -> None:
    report = differing()
    fewer = replace(
        report,
        findings=tuple(
            replace(each, engines=tuple(e for e in each.engines if e != "mujoco")) for each in report.findings
        ),
        engines=report.engines[:2],
    )
    assert written(report).compare(fewer).new == ()
    [new] = written(fewer).compare(report).new
    assert new.place.link == "tool"
    assert new.engines == {"pybullet", "mujoco"}


def test_what_an_absent_engine_did_is_not_gone() -> None:
    report = differing()
    nothing = replace(alike(), engines=report.engines[:1], robot=report.robot)
    assert written(report).compare(nothing).vanished == ()
    assert len(written(report).compare(replace(nothing, engines=report.engines)).vanished) > 0


def test_another_base_and_a_refused_robot_have_nothing_gone() -> None:
    baseline = written(differing())
    assert baseline.compare(replace(alike(), base="floating")).vanished == ()
    assert baseline.compare(refused("arm")).vanished == ()


def test_nothing_that_differs_is_without_an_entry() -> None:
    results = (
        EngineResult("drake", "1", "load", None, None, {"jacobian": 1.0}),
        EngineResult("x", "1", "", "no"),
    )
    report = DoctorReport("arm", base="fixed", engines=results, tolerance=1e-12)
    assert not report.alike
    found = {each.place.quantity: set(each.engines) for each in differences(report, "")}
    assert found == {"jacobian": {"drake"}, "loading": {"x"}}


def test_paths_are_relative_to_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "ci").mkdir()
    (tmp_path / "robots").mkdir()
    path = str(tmp_path / "ci" / "known.json")
    baseline = written(differing(str(tmp_path / "robots" / "arm.urdf")), path=path)
    assert {each.place.robot for each in baseline.known} == {"../robots/arm.urdf"}
    monkeypatch.chdir(tmp_path)
    assert baseline.compare(differing("robots/arm.urdf")).new == ()


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        '{"known": []}',
        '{"schema": 2, "known": []}',
        '{"schema": 1, "known": [3]}',
        '{"schema": 1, "known": [{"robot": "a"}]}',
        '{"schema": 1, "known": [{"robot": 1, "base": "fixed", "rule": "x", "engines": []}]}',
        "[" * 100_000,
    ],
)
def test_what_is_no_baseline_is_refused_by_name(text: str) -> None:
    with pytest.raises(ArgumentError, match=r"known\.json"):
        read_baseline(text, "known.json")


def test_the_document_is_sorted_and_has_no_infinity() -> None:
    document = baseline_document([differing("b"), differing("a")], "")
    assert document == baseline_document([differing("a"), differing("b")], "")
    json.dumps(document, allow_nan=False)
