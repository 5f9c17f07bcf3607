"""Verdicts of reports: alike, explained, or neither."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest

from dynx.doctor import diagnose
from dynx.doctor.report import Change, DoctorReport, EngineResult, results_document
from dynx.rules.registry import find_trap
from tests.doctor.formats.reports import alike, differing, refused

EXPLAINED = replace(differing(), unexplained=(), residual=1e-13)


@pytest.mark.parametrize(
    ("report", "is_alike", "explained"),
    [
        (alike(), True, True),
        (refused(), False, False),
        (differing(), False, False),
        (EXPLAINED, False, True),
        (replace(EXPLAINED, residual=2e-12), False, False),
        (replace(EXPLAINED, residual=math.inf), False, False),
        (replace(differing(), residual=0.0), False, False),
    ],
)
def test_alike_and_explained(report: DoctorReport, is_alike: bool, explained: bool) -> None:
    assert (report.alike, report.explained, bool(report)) == (is_alike, explained, is_alike)


@pytest.mark.parametrize(
    "spoiled",
    [
        EngineResult("drake", "1", "load", "no such thing"),
        EngineResult("drake", "1", "load", before={"mass_matrix": 1e-16, "inverse_dynamics": 2e-12}),
        EngineResult("drake", "1", "load", before={"mass_matrix": math.inf}),
    ],
    ids=["refused", "differs", "no number"],
)
def test_one_engine_that_differs_is_enough(spoiled: EngineResult) -> None:
    report = replace(alike(), engines=(*alike().engines, spoiled))
    assert not report.alike
    assert report.verdict != alike().verdict


def test_the_verdict_counts_what_is_proved() -> None:
    assert EXPLAINED.verdict == "engines differ, for 2 causes, all proved"
    first, *others = EXPLAINED.findings
    half = replace(EXPLAINED, findings=(replace(first, proved=False), *others))
    # One rule is proved where it is at each of its places.
    assert half.verdict == "engines differ, for 2 causes, 1 of them proved"
    assert differing().verdict == "1 difference without an explanation"


def test_the_summary_counts_each_robot_once() -> None:
    document = results_document([alike(), EXPLAINED, differing(), refused()], not_done=["one", "other"])
    assert document["summary"] == {
        "robots": 4,
        "alike": 1,
        "explained": 1,
        "massless": 0,
        "unexplained": 1,
        "refused": 1,
        "not_done": 2,
    }
    infinite = replace(EXPLAINED, residual=math.inf, referee=math.nan)
    json.dumps(results_document([infinite, differing()]), allow_nan=False)


def test_a_file_that_was_not_examined_has_no_errors() -> None:
    entry = diagnose("<robot name='r'><link/></robot>", engines=["pinocchio"]).to_dict()
    assert entry["status"] == "refused"
    assert (entry["residual"], entry["remaining"], entry["referee"]) == (None, None, None)
    assert entry["tolerance"] == 1e-12


@pytest.mark.parametrize(
    ("rule", "skipped"),
    [("DX531", "xacro elements that were not expanded"), ("DX515", "misspelled words")],
)
def test_the_verdict_names_what_every_engine_skips(rule: str, skipped: str) -> None:
    """Engines that load a file alike may not load what its author wrote."""
    report = diagnose(find_trap(rule), engines=["pinocchio"], samples=1)
    assert report.alike
    assert report.verdict == f"all engines load it alike; every engine skips {skipped}"
    assert not diagnose(find_trap("DX516"), engines=["pinocchio"], samples=1).skipped


def test_the_verdict_at_a_lower_level_names_the_engines_without_a_result() -> None:
    """Whether such an engine refuses the file or is not used on it is in the list of engines."""
    left = Change("DX901", "physics", "gave the link a mass", made=False)
    engines = tuple(replace(each, refused_after=each.refused) for each in EXPLAINED.engines)
    report = replace(EXPLAINED, level="safe", changes=(left,), engines=engines)
    assert report.verdict.endswith("; no result from mujoco when mended at level safe")
