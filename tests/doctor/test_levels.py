"""The mended file changes what the report names, as far as its level allows, and nothing else."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from io import StringIO

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console

from dynx.cli.doctor.tables import show_one
from dynx.doctor.diagnosis import diagnose
from dynx.doctor.examination import draw_states, model_without_mimics, reference_values
from dynx.doctor.formats import sarif_document
from dynx.doctor.formats.html import engine_map
from dynx.doctor.mending import level_of
from dynx.doctor.report import DoctorReport
from dynx.errors import UnknownNameError
from dynx.loaded import ENGINES, installed_engines
from dynx.model.xml.source import XmlSource
from dynx.rules import LEVELS, Case, Level, find_rule
from dynx.rules.registry import trap_case
from dynx.spatial.scalar import Floats
from tests.doctor.planting.catalogue import PLANTERS
from tests.doctor.planting.plan import Trial, pair_trials, plant_defects
from tests.doctor.planting.robots import QUICK
from tests.examples import PROFILE
from tests.rules.documents import case_of, joint, link

needs_all_engines = pytest.mark.skipif(
    set(installed_engines()) != set(ENGINES), reason="a cause shows in the engines that it concerns"
)


@cache
def trials() -> tuple[Trial, ...]:
    """Plan pairs of defects in fast robots."""
    return tuple(pair_trials(tuple(PLANTERS), 1, seed=7, among=QUICK))


def elements(source: XmlSource) -> dict[str, list[bytes]]:
    """Return the bytes of each element of the robot by tag and name."""
    found: dict[str, list[bytes]] = {}
    for each in source.root.children:
        key = f"{each.tag} {each.attributes.get('name', '')}".rstrip()
        found.setdefault(key, []).append(source.data[each.span.start : each.span.end])
    return found


def changed(report: DoctorReport) -> set[str]:
    """Name the elements in which the mended file differs from the text that was read."""
    if report.mended is None or report.text is None:
        return set()
    one, other = (elements(XmlSource(text)) for text in (report.text, report.mended))
    return {key for key in {*one, *other} if one.get(key) != other.get(key)}


def named(report: DoctorReport) -> set[str]:
    """Name the elements that the report says were changed."""
    made = [each for each in report.changes if each.made]
    links = {f"link {name}" for each in made for name in each.links}
    joints = {f"joint {name}" for each in made for name in each.joints}
    return links | joints | {other for each in made for other in each.others}


def values(text: str) -> Iterator[Floats]:
    """Yield the reference values of a file on the floating base."""
    model = model_without_mimics(XmlSource(text), "floating")
    found = reference_values(model, draw_states(model, 3, 0))
    yield from (found.poses, found.mass_matrix, found.torque, found.bias, *found.jacobians.values())


def check_changes(report: DoctorReport, text: str, trial: Trial, level: Level) -> None:
    """Every changed element is named, and no change exceeds the level."""
    assert report.level == level
    assert changed(report) <= named(report)
    assert all(LEVELS.index(each.level) <= LEVELS.index(level) for each in report.changes if each.made)
    if level != "physics" and report.mended is not None and Case(XmlSource(text), trial.base).readable:
        for before, after in zip(values(text), values(report.mended), strict=True):
            if level == "safe":
                assert before.tobytes() == after.tobytes()
            else:
                size = np.max(np.abs(before), initial=0.0)
                np.testing.assert_allclose(after, before, rtol=0.0, atol=1e-12 * size)


@needs_all_engines
@settings(max_examples=min(PROFILE, max(8, PROFILE // 4)))
@given(st.data())
def test_changes_are_named_keep_to_their_level_and_are_all_done_at_the_highest(data: st.DataObject) -> None:
    trial = data.draw(st.sampled_from(trials()))
    text = plant_defects(trial)[-1].source.text
    safe, rounding, physics = (
        diagnose(text, base=trial.base, level=level, counterexamples=False) for level in LEVELS
    )
    for level, report in zip(LEVELS, (safe, rounding, physics), strict=True):
        check_changes(report, text, trial, level)
    assert all(each.made for each in physics.changes)
    assert {each.rule for each in safe.changes} == {each.rule for each in physics.changes}
    assert [each.effects.keys() for each in safe.findings] == [
        each.effects.keys() for each in physics.findings
    ]


def tensors(count: int) -> str:
    """Write a chain of links with products of inertia, of which the last are too light to matter."""
    links = [link("l0")]
    joints = []
    for k in range(1, count + 1):
        mass = 10.0 ** -(k - 1)
        inertia = f'ixx="{0.3 * mass}" ixy="{0.05 * mass}" ixz="{0.02 * mass}" iyy="{0.4 * mass}" iyz="0"'
        links.append(
            f'<link name="l{k}"><inertial><mass value="{mass}"/><inertia {inertia} izz="{0.5 * mass}"/>'
            "</inertial></link>"
        )
        joints.append(joint(f"j{k}", f"l{k - 1}", f"l{k}", '<origin xyz="0.1 0.2 0.3" rpy="0.3 0.2 0.1"/>'))
    return case_of(*links, *joints).source.text


@pytest.mark.skipif("pybullet" not in installed_engines(), reason="PyBullet is not installed")
def test_only_tensors_that_are_listed_with_an_effect_are_rewritten() -> None:
    report = diagnose(tensors(6), counterexamples=False)
    listed = {each.link for each in report.differences if each.rule == "DX105"}
    (change,) = (each for each in report.changes if each.rule == "DX105")
    assert {*change.links} == listed
    assert "l1" in listed
    assert "l6" not in listed
    assert diagnose(report.mended or "", counterexamples=False).alike


LEVEL_OF = {
    "DX101": "safe",
    "DX102": "rounding",
    "DX105": "rounding",
    "DX107": "rounding",
    "DX113": "physics",
    "DX114": "safe",
    "DX201": "safe",
    "DX205": "physics",
    "DX213": "physics",
    "DX214": "physics",
    "DX305": "safe",
    "DX401": "physics",
    "DX402": "safe",
    "DX405": "safe",
    "DX417": "physics",
}


@pytest.mark.parametrize("rule_id", LEVEL_OF)
def test_the_level_of_a_remedy(rule_id: str) -> None:
    rule, case = find_rule(rule_id), trap_case(rule_id)
    remedy = rule.remedy(case, rule.detect(case))
    assert remedy is not None
    assert level_of(rule, case, remedy) == LEVEL_OF[rule_id]


def test_a_merged_inertia_names_both_links() -> None:
    case = case_of(
        *(link("base"), link("arm", mass=8.22, center=(0.1, 0.2, 0.3))),
        link("tip", mass=0.5, moments=(1e-6, 1e-6, 1e-5)),
        joint("j", "base", "arm"),
        joint("k", "arm", "tip", type="fixed"),
    )
    report = diagnose(case.source.text, counterexamples=False)
    (change,) = (each for each in report.changes if each.rule == "DX103")
    assert (change.level, change.links) == ("rounding", ("arm", "tip"))
    assert report.mended is not None
    assert 'value="8.72"' in report.mended


def test_calls_only_for_causes_with_an_effect_and_marked_for_comparison() -> None:
    case = case_of(
        link("base"),
        link("arm", center=(0.1, 0.2, 0.3)),
        joint("j", "base", "arm", '<dynamics damping="0.5" friction="1e-18"/>'),
    )
    report = diagnose(case.source.text, counterexamples=False)
    assert report.calls
    assert all(call.comparison and "damping" in call.code.lower() for call in report.calls)


def test_an_unknown_level_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="safe"):
        diagnose("<robot/>", level="save")  # type: ignore[arg-type]


@pytest.mark.skipif("pybullet" not in installed_engines(), reason="PyBullet is not installed")
def test_what_remains_at_a_lower_level_is_in_the_headline_and_in_every_report() -> None:
    """A file that `safe` leaves as it is has errors that a reader has to see."""
    report = diagnose(tensors(1), level="safe", counterexamples=False)
    pybullet = next(each for each in report.engines if each.engine == "pybullet")
    assert report.mended is None
    assert report.undone
    assert report.remaining == max(pybullet.after.values()) > report.tolerance
    size = f"{report.remaining:.0e}"
    assert report.verdict.endswith(f"all proved; off by up to {size} when mended at level safe")
    out = StringIO()
    show_one(Console(file=out, width=200), report, {}, None, "dynx doctor arm.urdf")
    assert "as loaded -> mended at level safe\n" in out.getvalue()
    assert f"-> {report.remaining:.1e}" in out.getvalue()
    entry = report.to_dict()
    assert (entry["status"], entry["remaining"]) == ("explained", report.remaining)
    assert any("mended" in head for head in engine_map(report).heads)
    results = sarif_document([report])["runs"][0]["results"]
    assert any(each["message"]["text"].endswith("Left undone at level safe.") for each in results)
    higher = diagnose(tensors(1), level="rounding", counterexamples=False)
    assert higher.remaining <= higher.tolerance
    assert higher.verdict.endswith("all proved")
