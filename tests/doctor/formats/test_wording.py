"""Sizes and values in words: short, and never two different values alike."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.doctor.formats import html_page, junit_xml, sarif_document, wording
from dynx.doctor.formats.causes import ROUNDING, causes, severity
from dynx.doctor.report import Effect, EngineResult
from dynx.errors import shown
from tests.doctor.formats.reports import alike, differing, refused


@pytest.mark.parametrize(
    ("error", "said"),
    [
        *(
            (0.0, "0"),
            (3e-11, "3e-11"),
            (1.3e-2, "1.3 %"),
            (0.943, "94 %"),
            (0.999, "100 %"),
            (19.0, "1900 %"),
            (1e9, "1e+09"),
        ),
        *((math.inf, "no value"), (math.nan, "no value")),
    ],
)
def test_a_size_is_said_as_people_say_it(error: float, said: str) -> None:
    assert wording.size(error) == said


def test_an_effect_names_its_quantity() -> None:
    assert wording.effect(Effect("mass_matrix", 0.5)) == "mass matrix off by 50 %"
    assert wording.effect(Effect("forward dynamics", math.inf)) == "no valid forward dynamics"
    assert wording.effect(Effect("loading", math.inf)) == "the file is refused"
    assert wording.effect(Effect("result", math.inf)) == "no valid result"


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=2, max_size=5))
def test_different_numbers_look_different(numbers: list[float]) -> None:
    said = wording.values(numbers)
    # -0.0 and 0.0 are one value to a reader.
    assert len(set(said)) == len({number + 0.0 for number in numbers})


def test_paths_are_called_by_their_files_where_that_tells_them_apart() -> None:
    assert wording.titles(["a/arm.urdf", "a/arm.urdf", "ur5"]) == ["arm", "arm", "ur5"]
    assert wording.titles(["a/arm.urdf", "b/arm.urdf"]) == ["a/arm.urdf", "b/arm.urdf"]
    assert wording.titles(["", ".."]) == ["", ".."]


@given(st.lists(st.text()))
def test_different_robots_are_called_differently(robots: list[str]) -> None:
    found = dict(zip(wording.titles(robots), robots, strict=True))
    assert all(found[called] == robot for called, robot in zip(wording.titles(robots), robots, strict=True))


def test_rounding_is_less_alarming_than_a_wrong_robot() -> None:
    found = {cause.rule: cause.severity for cause in causes(differing())}
    assert found == {"DX901": "error", "DX902": "warning", "DX903": "note"}
    assert [cause.rule for cause in causes(differing())] == ["DX901", "DX902", "DX903"]
    assert [each.link for each in causes(differing())[0].findings] == ["tool", "base"]
    assert severity(differing().findings[2]) == "warning"
    effect = differing().findings[2].effect
    assert effect is not None
    assert effect.relative_error < ROUNDING


def test_the_status_of_a_report_in_one_word() -> None:
    assert [report.status for report in (alike(), differing(), refused())] == [
        "alike",
        "unexplained",
        "refused",
    ]


def test_every_format_gives_the_effect_at_a_place_by_engine() -> None:
    refused, off = Effect("loading", math.inf), Effect("mass_matrix", 0.042)
    report = differing()
    first = replace(
        report.findings[0],
        engines=("pybullet", "mujoco"),
        effect=refused,
        effects={"pybullet": off, "mujoco": refused},
    )
    report = replace(report, findings=(first,))
    said = "4.2 % in pybullet, refused by mujoco"
    assert wording.finding_effect(first) == said
    (result, *_) = sarif_document([report])["runs"][0]["results"]
    assert f"({said}, fixed base)." in result["message"]["text"]
    assert f"({said})" in html_page([report])
    assert f"({said})" in junit_xml([report])


def test_an_effect_that_engines_share_is_written_once() -> None:
    refused = Effect("loading", math.inf)
    shared = {"pybullet": refused, "mujoco": refused}
    first = replace(differing().findings[0], engines=tuple(shared), effect=refused, effects=shared)
    assert wording.finding_effect(first) == "the file is refused"
    (result, *_) = sarif_document([replace(differing(), findings=(first,))])["runs"][0]["results"]
    assert "(the file is refused, fixed base: pybullet, mujoco)." in result["message"]["text"]


@given(st.text(alphabet="abc", min_size=1, max_size=1200))
def test_why_an_engine_has_no_results_is_said_with_its_reason(reason: str) -> None:
    engine = EngineResult("pinocchio", "4.1.0", "pinocchio.buildModelFromUrdf(path)")
    told = wording.name(reason, 1000)
    for result, start in (
        (replace(engine, refused=reason), "refuses the file: "),
        (replace(engine, not_used=reason), "not used: "),
    ):
        assert wording.refusal(result) == start + told
    for result, start in (
        (replace(engine, refused_after=reason), "refuses the mended file too: "),
        (replace(engine, not_used_after=reason), "not used on the mended file either: "),
    ):
        assert wording.refusal(result, mended=True) == start + told


def test_names_in_messages_are_escaped_once_and_long_ones_are_cut() -> None:
    file = "meshes" + chr(92) + "base.stl"
    text = f'no file {shown(file)}; it says \x1b[2J and "it\'s"'
    assert wording.message(text) == f'no file {shown(file)}; it says {chr(92)}x1b[2J and "it\'s"'
    cut = wording.message("long " * 100, 60)
    assert len(cut) == 60
    assert cut.endswith("... (500 characters)")
