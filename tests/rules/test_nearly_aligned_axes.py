"""DX226: the deviations up to which Drake and Pinocchio take a coordinate axis, measured, and the rule's."""

from __future__ import annotations

import math

import pytest

from dynx.agreement.tolerances import BAR
from dynx.doctor import compare_as_loaded
from dynx.loaded import installed_engines
from dynx.rules import Case, find_rule
from tests.rules.documents import case_of, link
from tests.rules.trap_cases import mended, trap

RULE = find_rule("DX226")
LIMIT = '<limit lower="-3" upper="3" effort="1" velocity="1"/>'


def turning(axis: str, kind: str = "revolute") -> Case:
    """Make the case of an arm on one joint."""
    ends = '<parent link="base"/><child link="arm"/>'
    origin = '<origin xyz="0.1 0.2 0.3" rpy="0.3 0.2 0.1"/>'
    joint = f'<joint name="j" type="{kind}">{ends}{origin}<axis xyz="{axis}"/>{LIMIT}</joint>'
    return case_of(link("base"), link("arm", center=(0.1, 0.2, 0.3)), joint)


def error(case: Case, engine: str) -> float:
    """Return the error of the poses of links as an engine loads the file."""
    if engine not in installed_engines():
        pytest.skip(f"needs {engine}")
    report = compare_as_loaded(case.source.text, engines=[engine])
    assert report.error is None
    return float(report.engines[0].before["forward_kinematics"])


@pytest.mark.parametrize("kind", ["revolute", "continuous", "prismatic"])
@pytest.mark.parametrize(
    ("axis", "dropped"),
    [
        ("1e-10 0 1", True),
        ("0 1 -1.8e-8", True),
        ("1 1e-8 1e-8", True),
        ("0 1.85e-8 1", False),
        ("1.5e-8 1.5e-8 1", False),
        ("1e-10 0 -1", False),
    ],
)
def test_drake_drops_a_deviation_that_rounds_away(axis: str, dropped: bool, kind: str) -> None:
    case = turning(axis, kind)
    assert (error(case, "drake") > BAR) == dropped
    assert bool(RULE.detect(case)) == dropped


@pytest.mark.parametrize(("axis", "dropped"), [("9.9e-13 0 1", True), ("1.01e-12 0 1", False)])
def test_pinocchio_drops_a_deviation_up_to_its_precision(axis: str, dropped: bool) -> None:
    case = turning(axis)
    (found,) = RULE.detect(case)
    assert ("Pinocchio" in found.sentence(["pinocchio"])) == dropped
    assert (error(case, "pinocchio") > 0.1 * BAR) == dropped


def test_the_message_states_the_deviation_and_the_axis() -> None:
    (found,) = RULE.detect(turning("0 1 1e-9"))
    assert found.sentence(["drake", "pinocchio"]) == "the axis is 1e-09 rad off y: exactly y in Drake"


@pytest.mark.parametrize("axis", ["0 0 1", "1 6e-17 0", "0.6 0.8 0", "0 -1 1e-9", "1e-7 1 0"])
def test_other_axes_are_not_found(axis: str) -> None:
    assert not RULE.detect(turning(axis))


def test_the_remedy_writes_coordinate_axes_and_says_so() -> None:
    case = trap("DX226")
    found, remedy = mended("DX226", case)
    assert [each.joint for each in found] == ["shoulder", "elbow", "slide"]
    assert remedy.changes_physics
    axes = [remedy.case.model.joint(name).axis for name in ("shoulder", "elbow", "slide")]
    assert axes == [(0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)]
    assert all(math.hypot(*axis) == 1.0 for axis in axes)
    kept = trap("DX226", DX226="keep")
    assert RULE.remedy(kept, RULE.detect(kept)) is None
