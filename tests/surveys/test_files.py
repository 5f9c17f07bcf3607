"""The survey of files: what it reports on files that are mended, refused and examined before."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.surveys.files import Loading, examine, listed, load_alone, make_tasks, summary, survey
from benchmarks.surveys.raw_agreement import ENGINES, check_entries
from dynx.agreement.tolerances import BAR
from dynx.loaded import installed_engines
from dynx.rules.registry import find_trap

TRAPS = ("DX105", "DX201", "DX301", "DX304")


def test_raw_engines_load_the_mended_traps_alike(tmp_path: Path) -> None:
    missing = set(ENGINES) - set(installed_engines())
    if missing:
        pytest.skip(f"needs {', '.join(sorted(missing))}")
    paths = [str(find_trap(rule)) for rule in TRAPS]
    tasks = make_tasks(paths, ["fixed", "floating"], ",".join(ENGINES), str(tmp_path / "mended"))
    found = check_entries([examine(task) for task in tasks], tmp_path)
    gaps = {(task.path, task.base): each for task, each in zip(tasks, found, strict=True)}
    assert all(gap <= BAR for each in found for gap, _ in each.values()), gaps


def test_a_refused_file_is_listed_with_the_engines_that_load_it(tmp_path: Path) -> None:
    broken = tmp_path / "a" / "broken.urdf"
    broken.parent.mkdir()
    broken.write_text('<robot name="r"><link name="a"/><joint name="j" type="fixed"/></robot>', "utf-8")
    sound = tmp_path / "b" / "sound.urdf"
    sound.parent.mkdir()
    sound.write_text('<robot name="r"><link name="a"/></robot>', "utf-8")
    assert listed(tmp_path) == [str(broken), str(sound)]
    tasks = make_tasks(listed(tmp_path), ["fixed"], "pinocchio", None)
    refused, loaded = survey(tasks, 1, results=tmp_path / "results.jsonl")
    assert refused["error"]
    assert refused["loads"]["pinocchio"] is not None
    assert loaded["error"] is None
    text = "\n".join(summary([refused, loaded], tmp_path))
    assert "2 files: 1 refused, 0 differ" in text
    assert "loaded by 0 engines: 1" in text
    assert "a/broken.urdf: refused: a/broken.urdf:1: " in text


def test_an_interrupted_survey_goes_on(tmp_path: Path) -> None:
    results = tmp_path / "results.jsonl"
    task = make_tasks([str(find_trap("DX105"))], ["fixed"], "pinocchio", None)
    earlier = {"path": task[0].path, "base": "fixed", "seconds": -1.0}
    results.write_text(json.dumps(earlier) + "\n" + json.dumps(earlier)[:20], "utf-8")
    assert survey(task, 1, results=results) == [earlier]


def test_an_engine_that_loads_a_file_has_no_message() -> None:
    assert load_alone(Loading(str(find_trap("DX105")), "pinocchio")) is None
