"""Baselines: what is known is accepted, what is new is not, what is gone is said."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.doctor.formats import baseline_document, read_baseline
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
