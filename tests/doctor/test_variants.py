"""Loading variants beside their engines: PyBullet's plain call, measured, proved and not counted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynx.agreement.tolerances import BAR
from dynx.doctor import DoctorReport, compare_as_loaded, diagnose
from dynx.doctor.diagnosis import open_case
from dynx.doctor.examination import TORQUE, Examiner
from dynx.doctor.formats.baseline import differences
from dynx.loaded import engine_of, installed_engines
from dynx.rules import Case
from dynx.rules.registry import find_trap, trap_case
from dynx.testing.strategies import models

PLAIN = "pybullet:plain"
FLAG = "pybullet.use_file_inertia"

pytestmark = pytest.mark.skipif("pybullet" not in installed_engines(), reason="needs PyBullet")


def plain_of(report: DoctorReport) -> tuple[str, ...]:
    """List the rules that are proved for the plain call, which must be off."""
    (variant,) = report.variants_off
    assert variant.engine == PLAIN
    assert all(finding.proved for finding in variant.findings)
    assert max(variant.after.values()) <= BAR < variant.largest_error
    return tuple(finding.rule for finding in variant.findings)


def test_the_plain_call_is_shown_and_proved_and_counts_for_nothing() -> None:
    report = diagnose(find_trap("DX115"))
    assert plain_of(report) == ("DX115",)
    assert report.alike
    assert report.explained
    assert not report.differences
    assert not report.calls
    assert report.mended is None
    assert report.residual <= BAR
    assert differences(report, "") == ()
    assert report.verdict.startswith(
        "all engines load it alike; only another call, pybullet:plain, is off by "
    )
    (entry,) = report.to_dict()["variants"]
    assert entry["call"] == "robot = p.loadURDF(path, useFixedBase=True)"
    assert "URDF_USE_INERTIA_FROM_FILE" in entry["findings"][0]["remedy"]


def test_the_plain_call_counts_where_it_is_named() -> None:
    report = diagnose(find_trap("DX115"), engines=[PLAIN])
    assert not report.alike
    assert report.variants == ()
    assert [(each.rule, each.engines, each.proved) for each in report.differences] == [
        ("DX115", (PLAIN,), True)
    ]
    assert "URDF_USE_INERTIA_FROM_FILE" in report.calls[0].code


@pytest.mark.parametrize("rule", ["DX101", "DX103", "DX105", "DX203", "DX401"])
def test_what_an_engine_has_its_variant_has_too(rule: str) -> None:
    """A cause that makes PyBullet refuse or misread the file hides neither itself nor the call."""
    case = trap_case(rule)
    report = diagnose(find_trap(rule), engines=[PLAIN], base=case.base, counterexamples=False)
    assert {each.rule for each in report.differences} >= {rule}
    assert report.explained, report.unexplained
    beside = diagnose(find_trap(rule), base=case.base, counterexamples=False)
    assert all(each.proved for variant in beside.variants_off for each in variant.findings)
    assert all(PLAIN not in each.engines for each in beside.findings)


BOX = '<collision><geometry><box size="0.3 0.2 0.1"/></geometry></collision>'


@pytest.mark.parametrize("variant", [PLAIN, "pybullet:merge"])
@pytest.mark.parametrize("rule", ["DX101", "DX102", "DX103", "DX104", "DX105", "DX119"])
def test_a_cause_behind_the_call_of_a_variant_is_measured_with_that_call_mended(
    rule: str, variant: str
) -> None:
    """The plain call uses no tensor, but the inertial frame, which the remedy of DX105 turns."""
    case = trap_case(rule)
    boxes = [case.source.insertion(link, BOX) for link in case.source.root.all("link")]
    text = case.source.apply(*boxes).text
    engine, own = (
        diagnose(text, engines=[name], counterexamples=False).differences for name in ("pybullet", variant)
    )
    shared = [each for each in own if each.rule not in ("DX115", "DX116")]
    assert [(each.rule, each.link, each.proved) for each in shared] == [
        (each.rule, each.link, each.proved) for each in engine
    ]
    assert {rule} <= {each.rule for each in shared}
    call = next((each.rule for each in own if each not in shared), None)
    for one, other in zip(shared, engine, strict=True):
        assert one.effect is not None
        assert other.effect is not None
        assert one.effect.quantity == other.effect.quantity
        assert one.effect.relative_error == pytest.approx(other.effect.relative_error, rel=1e-3)
        told = f"; measured in {variant} with the remedy of {call}"
        assert one.message == other.message + (told if call else "")


def test_the_plain_call_is_measured_without_a_search_for_causes() -> None:
    (variant,) = compare_as_loaded(find_trap("DX115")).variants
    (full,) = diagnose(find_trap("DX115")).variants
    assert variant.before == variant.after == full.before
    assert variant.findings == ()


@pytest.mark.skipif("mujoco" not in installed_engines(), reason="needs MuJoCo")
def test_balanced_inertias_load_in_mujoco_as_another_robot() -> None:
    trap = find_trap("DX103")
    report = diagnose(trap, engines=["mujoco", "mujoco:balanceinertia"], counterexamples=False)
    refusing, balanced = report.engines
    assert refusing.refused is not None
    assert balanced.refused is None
    assert balanced.before["mass_matrix"] > 1e-3 > BAR >= balanced.after["mass_matrix"]
    (finding,) = report.differences
    assert (finding.rule, finding.proved) == ("DX103", True)
    assert finding.engines == ("mujoco", "mujoco:balanceinertia")


def test_a_variant_that_is_like_its_engine_is_not_shown() -> None:
    """PyBullet fixes a robot without mass to the world, by either call."""
    massless = diagnose(find_trap("DX118"), base="floating", counterexamples=False)
    (variant,) = massless.variants
    assert variant.no_results is not None
    assert massless.variants_off == ()


def test_engines_that_are_named_have_no_variant_beside_them() -> None:
    assert diagnose(find_trap("DX115"), engines=["pinocchio", "pybullet"]).variants == ()
    assert engine_of(PLAIN) == "pybullet"


def test_on_ur5_the_plain_call_is_off_by_more_than_a_newton_metre() -> None:
    case = open_case("ur5", "fixed", {})
    examination = Examiner([PLAIN], 50, 0).examine(case)
    gap = examination.outputs[PLAIN].deviation[TORQUE][""]
    assert 1.0 < np.max(np.abs(gap)) < 10.0
    assert plain_of(diagnose("ur5")) == ("DX115",)


SHAPES = ('<box size="{} {} {}"/>', '<sphere radius="{}"/>', '<cylinder radius="{}" length="{}"/>')


@settings(max_examples=20)
@given(st.data())
def test_with_the_flag_the_plain_call_is_the_other(data: st.DataObject) -> None:
    # Added frames would be links with shapes, which is refused.
    model = replace(data.draw(models(max_links=4)), extra_frames=())
    case = _with_shapes(open_case(model, model.base, {}), data)
    found = Examiner(["pybullet", PLAIN], 2, 0).examine(case.with_calls(FLAG))
    assert found.outputs["pybullet"].refused == found.outputs[PLAIN].refused
    assert found.errors("pybullet") == found.errors(PLAIN)


def _with_shapes(case: Case, data: st.DataObject) -> Case:
    """Add up to two primitive collision shapes to each link."""
    sizes = st.lists(st.floats(0.01, 2.0), min_size=3, max_size=3)
    source = case.source
    edits = []
    for link in source.root.all("link"):
        shapes = data.draw(st.lists(st.tuples(st.sampled_from(SHAPES), sizes), max_size=2))
        texts = [f"<collision><geometry>{form.format(*size)}</geometry></collision>" for form, size in shapes]
        if texts:
            edits.append(source.insertion(link, "".join(texts)))
    return case.with_source(source.apply(*edits))
