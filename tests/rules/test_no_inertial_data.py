"""DX118: a file without inertial data has one finding, no invented masses, and no verdict on dynamics."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from dynx.doctor import DoctorReport, diagnose
from dynx.doctor.report import results_document
from dynx.loaded import installed_engines
from dynx.model.tree import Base
from tests.rules.documents import case_of, joint, link

DYNAMICS = {"mass_matrix", "inverse_dynamics", "forward_dynamics"}
ZERO = {"mass": 0.0, "moments": (0.0, 0.0, 0.0)}


def report_on(*links: str, base: Base = "fixed", **options: object) -> DoctorReport:
    """Diagnose a robot of three links in a row."""
    parts = *links, joint("elbow", "a", "b"), joint("wrist", "b", "c")
    return diagnose(case_of(*parts).source.text, base=base, **options)  # type: ignore[arg-type]


def bare(*names: str) -> list[str]:
    """Write links without inertial."""
    return [f'<link name="{name}"/>' for name in names]


@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize(
    "links",
    [
        bare("a", "b", "c"),
        [link(name, mass=0.0, moments=(0.0, 0.0, 0.0)) for name in "abc"],
        [*bare("a", "b"), link("c", mass=0.0, moments=(0.0, 0.0, 0.0))],
    ],
)
def test_one_finding_and_no_invented_mass(links: Sequence[str], base: Base) -> None:
    report = report_on(*links, base=base)
    assert [each.rule for each in report.differences] == ["DX118"]
    assert report.kinematics_only
    assert report.explained
    assert not report.alike
    assert report.mended is None
    assert report.total_mass == 0.0
    assert report.verdict == "no inertial data: the dynamics cannot be compared"
    assert report.status == "massless"
    assert not report.variants_off
    for engine in report.engines:
        assert not DYNAMICS.intersection(engine.before)
        absent = engine.refused is not None or engine.not_used is not None
        assert absent or engine.before.keys() == {"forward_kinematics", "jacobian"}


def test_mass_that_cannot_move_is_none() -> None:
    assert report_on(link("a", mass=4.0), *bare("b", "c")).kinematics_only
    floating = report_on(link("a", mass=4.0), *bare("b", "c"), base="floating")
    assert not floating.kinematics_only
    assert "DX118" not in {each.rule for each in floating.findings}


@pytest.mark.parametrize("engines", [[each] for each in installed_engines()])
def test_no_engine_alone_makes_the_file_alike(engines: list[str]) -> None:
    report = report_on(*bare("a", "b", "c"), engines=engines)
    assert [each.rule for each in report.differences] == ["DX118"]
    assert report.explained
    assert not report.alike


def test_a_robot_that_cannot_move_needs_no_mass() -> None:
    parts = *bare("a", "b"), joint("glue", "a", "b", type="fixed")
    report = diagnose(case_of(*parts).source.text)
    assert not report.kinematics_only
    assert "DX118" not in {each.rule for each in report.findings}


def test_other_causes_are_still_found_and_mended() -> None:
    links = [each.replace("/>", ">" + SHAPE + "</link>") for each in bare("a")] + bare("b", "c")
    tabbed = joint("elbow", "a", "b", '<origin xyz="0.1 0.2,0.3"/>')
    report = diagnose(case_of(*links, tabbed, joint("wrist", "b", "c")).source.text)
    assert {"DX118", "DX402"} <= {each.rule for each in report.differences}
    assert report.mended is not None
    assert report.explained
    assert "further cause" in report.verdict
    after = diagnose(report.mended)
    assert [each.rule for each in after.differences] == ["DX118"]


SHAPE = '<collision><geometry><mesh filename="a.stl"/></geometry></collision>'


def test_the_least_inertia_is_a_choice_that_changes_the_physics() -> None:
    report = report_on(*bare("a", "b", "c"), choose={"DX118": "least"})
    assert not report.alike
    assert report.explained
    if "mujoco" in installed_engines():
        assert report.mended is not None
        assert any("DX118 changed the physics" in each for each in report.choices)
        assert all(each.refused_after is None for each in report.engines)


def test_the_summary_counts_such_robots_by_themselves() -> None:
    reports = [report_on(*bare("a", "b", "c")), report_on(*(link(name) for name in "abc"))]
    summary = results_document(reports)["summary"]
    assert summary["massless"] == 1
    assert summary["explained"] == sum(each.status == "explained" for each in reports)
    assert summary["robots"] == 2


@pytest.mark.parametrize("links_with_shape", [1, 2])
def test_a_cause_of_a_refusal_has_that_effect_without_masses_too(links_with_shape: int) -> None:
    if "mujoco" not in installed_engines():
        pytest.skip("needs mujoco")
    shape = '<collision><geometry><box size="0 0 0"/></geometry></collision>'
    flat = [f'<link name="{name}">{shape}</link>' for name in "abc"[3 - links_with_shape :]]
    report = report_on(*bare(*"abc"[: 3 - links_with_shape]), *flat, engines=("pinocchio", "mujoco"))
    refusals = [each for each in report.findings if each.rule == "DX425"]
    assert len(refusals) == links_with_shape
    for each in refusals:
        assert each.effect is not None
        assert (each.effect.quantity, each.engines, each.proved) == ("loading", ("mujoco",), True)
    assert report.mended is not None
    assert "collision" not in report.mended
    assert report.kinematics_only
