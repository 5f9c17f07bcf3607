"""Public files of one format for a survey: their list, their text, what a survey counts."""

from __future__ import annotations

import re
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.surveys import mjcf_files, sdf_files
from benchmarks.surveys.format_files import FormatFiles, Outcome, is_odd, run, summary
from tests.surveys.test_public_list import snapshot

BALL = '<sdf version="{}"><model name="{}"/></sdf>'
REPOSITORY = "/".join(("somebody", "balls"))


@pytest.mark.parametrize(("survey", "least"), [(sdf_files, 200), (mjcf_files, 60)])
def test_a_list_has_each_file_once_in_halves(survey: object, least: int) -> None:
    files: FormatFiles = survey.FILES  # type: ignore[attr-defined]
    found = files.read()
    assert len(found) >= least
    assert len({(each.repository, each.path) for each in found}) == len(found)
    assert {each.repository for each in found} == set(files.repositories)
    parts = [each.part for each in found]
    assert set(parts) == {"develop", "bar"}
    assert 0.4 < parts.count("bar") / len(parts) < 0.6


def files_of_balls(folder: Path) -> FormatFiles:
    return FormatFiles(
        folder / "list.tsv",
        (REPOSITORY,),
        (".sdf", ".world"),
        sdf_files.FILES.kept,
        (".sdf", ".world", ".obj"),
        lambda repository, path: path.startswith("b"),
        re.compile("tests/"),
    )


def write_list(files: FormatFiles, snapshots: Path, digest: str | None = None) -> None:
    rows = [replace(each, digest=digest or each.digest) for each in files.choose(snapshots)]
    text = "".join(
        "\t".join((each.part, each.repository, each.commit, each.path, each.digest)) + "\n" for each in rows
    )
    files.table.write_text(text)


def test_copies_other_versions_and_other_files_are_left_out(tmp_path: Path) -> None:
    texts = {
        "a.sdf": BALL.format("1.9", "a"),
        "copy.sdf": BALL.format("1.9", "a") + "\n",
        "b.world": BALL.format("1.4", "b"),
        "old.sdf": BALL.format("1.3", "c"),
        "none.sdf": "<sdf version='1.9'/>",
        "tests/d.sdf": BALL.format("1.9", "d"),
        "mesh.obj": "v 0 0 0",
        "ball.urdf": "<robot/>",
    }
    snapshot(tmp_path, REPOSITORY, texts)
    files = files_of_balls(tmp_path)
    assert [(each.path, each.part) for each in files.choose(tmp_path)] == [
        ("a.sdf", "bar"),
        ("b.world", "develop"),
    ]
    write_list(files, tmp_path)
    folder = tmp_path / "files"
    paths = list(files.extract(tmp_path, folder))
    assert [path.read_text() for path in paths] == [texts["a.sdf"], texts["b.world"]]
    assert (paths[0].parent / "mesh.obj").exists()
    assert not (paths[0].parent / "ball.urdf").exists()
    assert [path.name for path in files.extract(tmp_path, folder, "develop")] == ["b.world"]


def test_a_file_that_is_not_that_of_the_list_is_refused(tmp_path: Path) -> None:
    snapshot(tmp_path, REPOSITORY, {"a.sdf": BALL.format("1.9", "a")})
    files = files_of_balls(tmp_path)
    write_list(files, tmp_path, digest="0")
    with pytest.raises(ValueError, match=r"a\.sdf is not the file of the list"):
        list(files.extract(tmp_path, tmp_path / "files"))


def test_halves_by_digest() -> None:
    odd = [is_odd(str(k)) for k in range(200)]
    assert 60 < sum(odd) < 140


def test_the_summary_counts_what_is_to_be_read() -> None:
    outcomes = [
        Outcome("a", "alike"),
        Outcome("b", "read, not by Drake", "why"),
        Outcome("c", "refused", "why", joints=frozenset(("ball",))),
        Outcome("d", "refused", "why", joints=frozenset(("screw",))),
        Outcome("e", "refused, and no robot in Drake", "why"),
        Outcome("f", "different", "mass matrix", 0.5),
    ]
    lines = list(summary(outcomes, sdf_files.counts))
    assert lines[1] == "read: 3 of 4 (75.0 %)"
    assert "refused: c: why" in lines
    assert "different 0.5: f: mass matrix" in lines


def test_a_survey_needs_a_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        run(files_of_balls(tmp_path), sdf_files.examine, sdf_files.counts, "", ["run", str(tmp_path)])
    assert "run needs a folder" in capsys.readouterr().err


def test_a_folder_without_snapshots_says_so(tmp_path: Path) -> None:
    with pytest.raises(subprocess.CalledProcessError):
        list(files_of_balls(tmp_path).choose(tmp_path))
