"""Baselines of pairs: what is known, new and gone, whatever the lines, the sizes and the folder."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from dynx.doctor.formats import Baseline
from dynx.files.documents import json_text
from dynx.same import SameReport, same_robot
from dynx.same.formats import SameBaseline, baseline_document
from tests.same.formats.reports import FIRST, SECOND, alike, arm, differing, hostile, shorter


def written(report: SameReport, folder: str = "") -> SameBaseline:
    """Return the baseline of a report, after writing and reading."""
    return SameBaseline.read(json_text(baseline_document(report, folder)), f"{folder}/known.json")


@pytest.mark.parametrize("make", [alike, differing, shorter, hostile])
def test_everything_of_a_report_is_known_to_its_baseline(make: object) -> None:
    report = make()  # type: ignore[operator]
    found = written(report).compare(report)
    assert (found.new, found.vanished) == ((), ())
    assert len(found.known) == len(report.differences) + len(report.unmatched)


def test_new_and_gone() -> None:
    report = differing()
    fewer = replace(report, differences=report.differences[1:])
    assert len(written(fewer).compare(report).new) == 1
    assert len(written(report).compare(fewer).vanished) == 1
    assert len(SameBaseline().compare(report).new) == len(report.differences)


def test_sizes_and_lines_do_not_count() -> None:
    other = same_robot(FIRST, f"\n{arm(x=0.33).replace('1.5', '1.9')}")
    assert written(differing()).compare(other).new == ()


def test_another_pair_is_new() -> None:
    report = replace(differing(), first="another")
    found = written(differing()).compare(report)
    assert len(found.new) == len(report.differences)
    assert found.vanished == ()


def test_files_are_relative_to_the_baseline(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("one", "two"):
        folder = tmp_path / name / "robots"
        folder.mkdir(parents=True)
        (folder / "a.urdf").write_text(FIRST, encoding="utf-8")
        (folder / "b.urdf").write_text(SECOND, encoding="utf-8")
    monkeypatch.chdir(tmp_path / "one")
    report = same_robot("robots/a.urdf", "robots/b.urdf")
    text = json_text(baseline_document(report, "robots"))
    monkeypatch.chdir(tmp_path / "two" / "robots")
    found = SameBaseline.read(text, "known.json").compare(same_robot("a.urdf", "b.urdf"))
    assert (found.new, found.vanished) == ((), ())
    assert len(found.known) == len(report.differences)


def test_the_doctor_reads_the_same_files() -> None:
    text = json_text(baseline_document(differing(), ""))
    assert len(Baseline.read(text, "known.json").known) == len(differing().differences)
