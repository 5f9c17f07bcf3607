"""Diagnosis from beginning to end: differences, causes, proofs and the mended file."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dynx
from dynx.agreement.tolerances import BAR
from dynx.doctor import DoctorReport, compare_as_loaded, diagnose, results_document
from dynx.doctor.formats.baseline import Baseline
from dynx.errors import (
    ArgumentError,
    DescriptionError,
    NotInstalledError,
    UnknownBackendError,
    UnknownNameError,
)
from dynx.loaded import ENGINES, installed_engines, loader_class, registry
from dynx.model import Model
from dynx.model.tree import Base
from dynx.rules import Level, Rule, all_rules
from dynx.rules.registry import find_rule, find_trap, trap_case
from dynx.testing.strategies import models

BOTH = ["pinocchio", "pybullet"]
TRAP = find_trap("DX101")


def difference_rules() -> list[Rule]:
    """List the rules about differences that hold for an installed engine, without those about variants."""
    versions = {engine: loader_class(engine).engine_version() for engine in installed_engines()}
    return [rule for rule in all_rules() if rule.kind == "difference" and rule.holds_for(versions)]


@pytest.mark.parametrize("rule", difference_rules(), ids=lambda rule: rule.id)
def test_each_trap_is_explained_by_its_rule(rule: Rule) -> None:
    case = trap_case(rule)
    # A rule that by default leaves what it finds has a choice that mends it.
    options = [None, *({rule.id: choice} for choice in rule.choices)]
    cases = [replace(case, choices=each) for each in options]
    case = next((each for each in cases if rule.remedy(each, rule.detect(each)) is not None), case)
    remedy = rule.remedy(case, rule.detect(case))
    # PyBullet holds numbers of MJCF in single precision (DX612), those of the mended file too.
    rounded = (
        remedy is not None and rule.id.startswith("DX6") and bool(find_rule("DX612").detect(remedy.case))
    )
    report = diagnose(
        find_trap(rule),
        base=case.base,
        samples=3,
        counterexamples=False,
        choose=dict(case.choices or {}),
        tolerance=float(np.finfo(np.float32).eps) if rounded else BAR,
    )
    mine = [finding for finding in report.differences if finding.rule == rule.id]
    assert report.error is None
    assert not report.alike
    assert report.explained, report.unexplained
    if remedy is not None:
        assert mine, (report.verdict, report.findings)
        assert all(finding.proved for finding in mine)
    others = sorted({engine for finding in mine for engine in finding.engines} - {"pybullet"})
    if rounded and others:
        # The other engines hold all digits.
        alone = diagnose(
            find_trap(rule), base=case.base, samples=3, counterexamples=False, engines=others, tolerance=BAR
        )
        assert all(finding.proved for finding in alone.differences if finding.rule == rule.id)
        assert alone.explained, alone.unexplained


def test_a_proved_cause_has_place_engine_effect_and_remedy() -> None:
    report = diagnose(TRAP, engines=BOTH)
    (finding,) = report.differences
    assert (finding.rule, finding.engines, finding.proved) == ("DX101", ("pybullet",), True)
    assert finding.effect is not None
    assert finding.effect.relative_error > BAR
    assert finding.line is not None
    assert finding.link is not None
    assert finding.link in TRAP.read_text(encoding="utf-8").splitlines()[finding.line - 1]
    assert finding.remedy
    assert report.residual <= BAR < max(report.engines[1].before.values())
    assert report.referee <= BAR


def test_the_mended_text_is_alike_and_needs_no_further_mending() -> None:
    report = diagnose(TRAP)
    assert report.mended is not None
    again = diagnose(report.mended)
    assert again.alike
    assert again.mended is None
    assert not again.differences


@settings(max_examples=20)
@given(st.data())
def test_robots_without_a_cause_are_alike(data: st.DataObject) -> None:
    model = data.draw(models(max_links=5))
    first = diagnose(model, engines=BOTH, samples=2, counterexamples=False, base=model.base)
    # The causes of a random robot are removed; then no difference may remain.
    assert first.explained, first.unexplained
    if first.mended is None:
        return
    second = diagnose(first.mended, engines=BOTH, samples=2, counterexamples=False, base=model.base)
    assert second.explained
    assert not [finding for finding in second.differences if finding.remedy and not second.calls]


def test_a_report_is_the_same_again_and_is_plain_json() -> None:
    one, two = (diagnose(TRAP, seed=3) for _ in range(2))
    assert {**one.to_dict(), "seconds": 0} == {**two.to_dict(), "seconds": 0}
    document = results_document([one])
    assert json.loads(json.dumps(document, allow_nan=False)) == document
    assert document["summary"] == {
        "robots": 1,
        "alike": 0,
        "explained": 1,
        "massless": 0,
        "unexplained": 0,
        "refused": 0,
        "not_done": 0,
    }


def test_what_no_rule_explains_is_said_with_the_smallest_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    others = tuple(rule for rule in all_rules() if rule.id != "DX101")
    monkeypatch.setattr("dynx.doctor.diagnosis.all_rules", lambda: others)
    report = diagnose(TRAP, engines=BOTH)
    assert not report.explained
    assert not report.alike
    (left,) = report.unexplained
    assert left.engine == "pybullet"
    assert left.counterexample is not None
    small = dynx.load(left.counterexample.urdf)
    whole = dynx.load(TRAP)
    assert len(small.links) <= len(whole.links)
    assert left.counterexample.moving_joints == len(small.joint_names) <= 1
    assert left.counterexample.relative_error > BAR


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_as_loaded_is_the_same_measurement_without_causes(base: Base) -> None:
    plain, full = compare_as_loaded(TRAP, base=base), diagnose(TRAP, base=base, counterexamples=False)
    assert [each.before for each in plain.engines] == [each.before for each in full.engines]
    assert plain.pairs == full.pairs
    assert plain.findings == ()
    assert plain.mended is None


@settings(max_examples=8)
@given(st.sampled_from(["DX101", "DX120", "DX204", "DX301"]), st.lists(st.sampled_from(ENGINES), min_size=1))
def test_no_verdict_states_a_cause_that_was_not_searched_for(trap: str, engines: list[str]) -> None:
    report = compare_as_loaded(find_trap(trap), engines=engines, samples=1)
    assert report.explained == report.alike
    assert report.status == ("alike" if report.alike else "unexplained")
    assert ("dynx doctor search" in report.verdict) == (
        any(each.no_results for each in report.engines)
        or max((error for each in report.engines for error in each.before.values()), default=0.0)
        > report.tolerance
    )
    assert "cannot be mended" not in report.verdict


def test_a_comparison_names_the_engine_that_is_farthest_off() -> None:
    report = compare_as_loaded(TRAP, engines=BOTH)
    largest = max((error, each.engine, key) for each in report.engines for key, error in each.before.items())
    assert f"{largest[2].replace('_', ' ')} of {largest[1]} is off by {100 * largest[0]:.0f} %" in (
        report.verdict
    )


ROOT = """<robot name="arm">
  <link name="base">
    <inertial><mass value="{}"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <link name="arm">
    <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="j" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="1 0 0"/></joint>
</robot>"""


@settings(max_examples=5)
@given(st.floats(1e-3, 1e3), st.sampled_from([compare_as_loaded, diagnose]))
def test_a_file_that_dynx_refuses_is_not_alike_though_its_engines_are(
    mass: float, examine: Callable[..., DoctorReport]
) -> None:
    text = ROOT.format(-mass)
    with pytest.raises(DescriptionError) as refused:
        dynx.load(text)
    report = examine(text, engines=["pinocchio"], samples=1)
    assert all(error <= report.tolerance for each in report.engines for error in each.before.values())
    assert report.refusal is not None
    assert report.refusal.message == str(refused.value)
    assert report.refusal.message in report.verdict
    assert not report.alike
    [new] = Baseline("").compare(report).new
    assert new.engines == {"dynx"}
    assert not Baseline("", (new,)).compare(report).new
    sound = examine(ROOT.format(mass), engines=["pinocchio"], samples=1)
    assert sound.alike
    assert sound.refusal is None
    assert Baseline("", (new,)).compare(sound).vanished == (new,)


@pytest.mark.parametrize("level", ["safe", "physics"])
def test_the_cause_for_which_only_dynx_refuses_a_file_is_named_and_mended(level: Level) -> None:
    report = diagnose(ROOT.format(-1.0), engines=["pinocchio"], samples=1, level=level)
    [finding] = report.differences
    assert (finding.rule, finding.link, finding.line) == ("DX120", "base", 3)
    assert (finding.engines, finding.proved) == (("dynx",), True)
    assert report.explained
    assert (report.mended is not None) == (level == "physics")
    if report.mended is not None:
        assert dynx.load(report.mended).inertial("base").mass == 1.0


def test_a_choice_changes_what_is_done() -> None:
    trap = find_trap("DX103")
    rule = next(rule for rule in all_rules() if rule.id == "DX103")
    texts = {choice: diagnose(trap, engines=BOTH, choose={"dx103": choice}).mended for choice in rule.choices}
    assert len(set(texts.values())) > 1
    assert diagnose(trap, engines=BOTH).choices


def test_a_robot_that_cannot_be_read_gives_a_report_with_its_error(tmp_path: Path) -> None:
    broken = tmp_path / "broken.urdf"
    broken.write_text("<robot>\n<link></robot>", encoding="utf-8")
    report = diagnose(broken)
    assert report.error is not None
    assert f"{broken}:2" in report.error.message
    assert not report
    assert "not examined" in report.verdict
    missing = diagnose(tmp_path / "none.urdf")
    assert missing.error is not None
    assert missing.error.type == "RobotNotFoundError"


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"engines": ["pinochio"]}, UnknownBackendError, "did you mean 'pinocchio'"),
        ({"engines": "pinocchio"}, ArgumentError, "wanted names"),
        ({"engines": []}, ArgumentError, "wanted names"),
        ({"samples": 0}, ArgumentError, "at least 1"),
        ({"samples": True}, ArgumentError, "whole number"),
        ({"seed": -1}, ArgumentError, "at least 0"),
        ({"tolerance": 0.0}, ArgumentError, "between 0 and 1"),
        ({"tolerance": math.nan}, ArgumentError, "between 0 and 1"),
        ({"base": "flying"}, ArgumentError, "floating"),
        ({"choose": {"DX999": "keep"}}, UnknownNameError, "no rule 'DX999'"),
        ({"choose": {"DX103": "kep"}}, ArgumentError, "did you mean 'keep'"),
        ({"choose": {"DX101": "keep"}}, ArgumentError, "leaves no choice"),
    ],
)
def test_arguments_that_are_right_for_no_robot_are_refused(
    arguments: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        diagnose(TRAP, **arguments)


def test_a_missing_engine_is_named_when_asked_for_and_left_out_otherwise(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse_to_load(engine: str) -> type:
        if engine in ("mujoco", "drake"):
            raise NotInstalledError(f"pip install 'dynx[{engine}]'")
        return known(engine)

    known = registry.loader_class
    monkeypatch.setattr(registry, "loader_class", refuse_to_load)
    monkeypatch.setattr("dynx.doctor.examination.loader_class", refuse_to_load)
    report = diagnose(TRAP, counterexamples=False)
    assert [each.engine for each in report.engines] == [e for e in ENGINES if e not in ("mujoco", "drake")]
    with pytest.raises(NotInstalledError, match=r"pip install '\S*\[drake\]'"):
        diagnose(TRAP, engines=["pinocchio", "drake"])


def test_a_model_is_examined_as_the_file_it_writes() -> None:
    model = dynx.load("panda")
    report = diagnose(model, engines=BOTH, samples=2, counterexamples=False)
    assert isinstance(model, Model)
    assert isinstance(report, DoctorReport)
    assert report.robot == model.name
    assert report.explained


MILLIMETRES = """<robot name="millimetres">
  <link name="base"/>
  <joint name="yaw" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="40" velocity="3"/>
  </joint>
  <link name="upper"><inertial>
    <origin xyz="0 0 150"/><mass value="2"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.001" ixy="0" ixz="0" iyz="0"/>
  </inertial></link>
  <joint name="elbow" type="revolute">
    <parent link="upper"/><child link="hand"/><origin xyz="0 0 0.3" rpy="0 0 90"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="40" velocity="3"/>
  </joint>
  <link name="hand"><inertial>
    <mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
  </inertial></link>
</robot>"""


def test_rounding_of_the_reference_values_is_no_difference() -> None:
    report = diagnose(MILLIMETRES)
    assert BAR / 10.0 < report.referee < 1e-10  # terms of 45,000 kg m^2 cancel in an inertia of 1 kg m^2
    assert report.tolerance == pytest.approx(10.0 * report.referee)
    assert report.alike, report.unexplained
    assert compare_as_loaded(MILLIMETRES).tolerance == report.tolerance
    # Differences beyond rounding are found all the same.
    lame = MILLIMETRES.replace("</inertial></link>\n</robot>", "</inertial></link>\n", 1)
    lame += '<joint name="tip" type="fixed"><parent link="hand"/><child link="tool"/></joint>'
    lame += '<link name="tool"/></robot>'
    found = diagnose(lame, engines=BOTH)
    assert [finding.rule for finding in found.differences] == ["DX101"]
    assert found.explained
